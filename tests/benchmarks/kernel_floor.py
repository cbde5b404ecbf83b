"""What the generic solver costs over kernels written by hand for one scene alone.

The scene: a hanging chain in 2D, rigid links, one Gauss-Seidel sweep in natural order, as PBD 2006 has it.
The hand-written kernels are compiled with the solver's own options. ``hand`` has the three loops of the
algorithm, predict, project, update. As information: ``indexed`` reads the links from arrays, as any solver
must, and ``fused`` does all three in one pass over the chain, which no general solver can. None of them
tests for finite values, records, or guards against coincident points.

Run as ``python tests/benchmarks/kernel_floor.py`` or ``python -m tests.benchmarks.kernel_floor``.
All variants are run in turn, and the minimum of the repeats counts.
"""

from __future__ import annotations

import argparse
import math
import time

import numpy as np

import pbd
from pbd.jit import kernel

G, DT = 9.81, 1e-4
GOALS = {"ratio": 1.05, 10: ("step", 300.0), 100: ("particle-step", 20.0)}
"""Generic over hand-written; ns a step with 10 links; ns a particle-step with 100 links."""


@kernel
def hand(x, y, px, py, vx, vy, w, rest, g, h, steps):
    """Three loops a step."""
    inverse_h = 1.0 / h
    for _ in range(steps):
        for i in range(x.shape[0]):
            vy[i] += h * g if w[i] > 0.0 else 0.0
            px[i] = x[i] + h * vx[i]
            py[i] = y[i] + h * vy[i]
        for c in range(rest.shape[0]):
            dx, dy = px[c] - px[c + 1], py[c] - py[c + 1]
            length = math.sqrt(dx * dx + dy * dy)
            s = (length - rest[c]) / (length * (w[c] + w[c + 1]))
            px[c] -= w[c] * s * dx
            py[c] -= w[c] * s * dy
            px[c + 1] += w[c + 1] * s * dx
            py[c + 1] += w[c + 1] * s * dy
        for i in range(x.shape[0]):
            vx[i] = (px[i] - x[i]) * inverse_h
            vy[i] = (py[i] - y[i]) * inverse_h
            x[i] = px[i]
            y[i] = py[i]


@kernel
def indexed(x, y, px, py, vx, vy, w, rest, g, h, steps, first, second):
    """As `hand`, but the links may join any two particles: what knowing the chain's order is worth."""
    inverse_h = 1.0 / h
    for _ in range(steps):
        for i in range(x.shape[0]):
            vy[i] += h * g if w[i] > 0.0 else 0.0
            px[i] = x[i] + h * vx[i]
            py[i] = y[i] + h * vy[i]
        for c in range(rest.shape[0]):
            i, j = first[c], second[c]
            dx, dy = px[i] - px[j], py[i] - py[j]
            length = math.sqrt(dx * dx + dy * dy)
            s = (length - rest[c]) / (length * (w[i] + w[j]))
            px[i] -= w[i] * s * dx
            py[i] -= w[i] * s * dy
            px[j] += w[j] * s * dx
            py[j] += w[j] * s * dy
        for i in range(x.shape[0]):
            vx[i] = (px[i] - x[i]) * inverse_h
            vy[i] = (py[i] - y[i]) * inverse_h
            x[i] = px[i]
            y[i] = py[i]


@kernel
def fused(x, y, px, py, vx, vy, w, rest, g, h, steps):
    """One pass a step: particle c is final once link c is projected, and p lives in registers."""
    inverse_h = 1.0 / h
    last = rest.shape[0]
    for _ in range(steps):
        ax, ay = x[0] + h * vx[0], y[0] + h * (vy[0] + (h * g if w[0] > 0.0 else 0.0))
        for c in range(last):
            bx, by = x[c + 1] + h * vx[c + 1], y[c + 1] + h * (vy[c + 1] + (h * g if w[c + 1] > 0.0 else 0.0))
            dx, dy = ax - bx, ay - by
            length = math.sqrt(dx * dx + dy * dy)
            s = (length - rest[c]) / (length * (w[c] + w[c + 1]))
            ax -= w[c] * s * dx
            ay -= w[c] * s * dy
            vx[c], vy[c] = (ax - x[c]) * inverse_h, (ay - y[c]) * inverse_h
            x[c], y[c] = ax, ay
            ax, ay = bx + w[c + 1] * s * dx, by + w[c + 1] * s * dy
        vx[last], vy[last] = (ax - x[last]) * inverse_h, (ay - y[last]) * inverse_h
        x[last], y[last] = ax, ay


def positions(links):
    """A horizontal chain of 1 m, pinned at its first particle."""
    return np.column_stack([np.linspace(0.0, 1.0, links + 1), np.zeros(links + 1)])


def generic(links, steps):
    """The solver: a function that runs and returns (seconds, final positions)."""
    particles = pbd.particles(positions(links), pinned=[0])
    batch = pbd.distance(particles, [(i, i + 1) for i in range(links)])
    simulation = pbd.Simulation(particles, [batch], gravity=(0.0, -G), settings=pbd.Settings(dt=DT))

    def run():
        start = time.perf_counter()
        outcome = simulation.run(steps, [0, steps])
        return time.perf_counter() - start, outcome.positions[-1]

    return run


def by_hand(function, links, steps):
    """A hand-written kernel, as `generic`."""
    rest, w = np.full(links, 1.0 / links), np.ones(links + 1)
    w[0] = 0.0
    more = (np.arange(links), np.arange(links) + 1) if function is indexed else ()

    def run():
        x, y = (axis.copy() for axis in positions(links).T)
        zeros = [np.zeros(links + 1) for _ in range(4)]
        start = time.perf_counter()
        function(x, y, *zeros, w, rest, -G, DT, steps, *more)
        return time.perf_counter() - start, np.column_stack([x, y])

    return run


def variants(links, steps):
    """All of them, by name."""
    hands = {function.__name__: by_hand(function, links, steps) for function in (hand, indexed, fused)}
    return {"generic": generic(links, steps), **hands}


def measure(links, steps, repeats):
    """Minimum ns a step of each variant, run in turn; refused where they do not compute the same motion."""
    ends = [run()[1] for run in variants(links, 200).values()]  # also compiles; short, since a chain is chaotic
    if not all(np.allclose(end, ends[0], rtol=0.0, atol=1e-9) for end in ends):
        raise SystemExit(f"{links} links: the variants do not agree")
    runs = variants(links, steps)
    times = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            times[name].append(run()[0] / steps * 1e9)
    return {name: min(found) for name, found in times.items()}


def report(links, found):
    """Lines of the table, and whether each goal is met."""
    for name, step in found.items():
        ratio = step / found["hand"]
        print(f"{links:6d}  {name:8s} {step:10.1f} {step / (links + 1):14.2f} {ratio:10.3f}")
    unit, limit = GOALS[links]
    value = found["generic"] if unit == "step" else found["generic"] / (links + 1)
    ratio = found["generic"] / found["hand"]
    verdict = ("missed", "met")
    print(f"        goals: {value:.1f} <= {limit:g} ns a {unit}: {verdict[value <= limit]};", end=" ")
    print(f"generic/hand {ratio:.3f} <= {GOALS['ratio']:g}: {verdict[ratio <= GOALS['ratio']]}")


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeats", type=int, default=25)
    parser.add_argument("--particle-steps", type=float, default=3e6, help="work in each run")
    chosen = parser.parse_args()
    print(f"{'links':>6s}  {'kernel':8s} {'ns/step':>10s} {'ns/particle':>14s} {'/ hand':>10s}")
    for links in (10, 100):
        steps = int(chosen.particle_steps / (links + 1))
        report(links, measure(links, steps, chosen.repeats))


if __name__ == "__main__":
    main()
