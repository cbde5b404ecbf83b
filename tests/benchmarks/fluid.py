"""What a step of a fluid costs, stage by stage, and a dam break's error against its time.

Run as ``python tests/benchmarks/fluid.py``. A dam break is run until its particles are in disorder; from that state
each stage is then run in turn, and the minimum of the repeats counts. Single precision, 4 iterations, one thread; then
one against two and more threads, in turn, without the start of a run.

The floor of this design is the square root of each candidate, two in an iteration: with AVX-512 one register of 16 in
12.6 cycles, during which the other 12 to 19 operations of a candidate find room. In 2D that is 3.1 registers x 8 x
12.6 cycles, 99 ns a particle and step at 3.2 GHz; in 3D 10.5 registers, 335 ns. Measured are 165 to 180 and 600 ns:
the rest is sorting (12 and 20 ns), copying candidates (8 x 3 and 8 x 11 ns), adding up lanes, and loops that end
unforeseen. Two threads take 92 to 100 and 390 ns: each pass is 1.7 to 1.9 times as fast, half of the sorting is not
shared. In 3D five of six candidates are no neighbours; lists of neighbours would have to fetch through indices,
and were not tried.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import math
import os
import time
from typing import Any, NamedTuple

import numpy as np

import pbd
from pbd.fluid.candidates import for_each
from pbd.fluid.cells import cut
from pbd.fluid.tasks import GATHER, MOVES, MULTIPLIERS, PUSHES
from pbd.jit import kernel
from pbd.projection import begin
from pbd.team import together

G, ITERATIONS, COURANT = 9.81, 4, 0.16
CASES = {"2D": ((100, 200), 2.5, 260.0, 180.0), "3D": ((24, 30, 50), 2.0, 700.0, 450.0)}
"""Particles along each axis, h/spacing, goal and aim [ns a particle and step]."""

REFERENCE = {1: 1.558, 2: 2.662}
"""T -> front of the dam break [widths]."""


@kernel
def sorting(fluid, state, h, sweeps):
    for _ in range(sweeps):
        begin(fluid, state, h)


@kernel
def gathering(fluid, state, h, sweeps):
    for _ in range(sweeps):
        together(fluid.team, fluid, GATHER, state, h)


class Counting(NamedTuple):
    """Nothing but how many candidates there are, filled up."""

    total: Any

    def visit(self, k, first, last):
        self.total[0] += last - first


@kernel
def picking(fluid, state, h, sweeps):
    for _ in range(sweeps):
        state.work[1] = 0
        low, high = cut(fluid.cells, 0, 1)
        for_each(fluid.cells, fluid.position, Counting(state.work[1:]), low, high)


@kernel
def multipliers(fluid, state, h, sweeps):
    for _ in range(sweeps):
        together(fluid.team, fluid, MULTIPLIERS, state, h)


@kernel
def displacing(fluid, state, h, sweeps):
    for _ in range(sweeps):
        together(fluid.team, fluid, PUSHES, state, h)
        together(fluid.team, fluid, MOVES, state, h)


STAGES = {
    "walls and sort": (sorting, 1),
    "gather": (gathering, 0),
    "copy candidates": (picking, 0),
    "multipliers": (multipliers, ITERATIONS),
    "displacements": (displacing, ITERATIONS),
}
"""Stage -> kernel, how often in a step. Positions are gathered in each iteration only if there are other batches;
candidates are copied in both passes of an iteration, which hold that."""


def scene(counts, support, precision, rest="lattice"):
    """A column of that many particles, 1 m wide, in a tank 4 m long, gravity, and how to step."""
    s, d = 1.0 / counts[0], len(counts)
    axes = [(np.arange(count) + 0.5) * s for count in counts]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, d)
    particles = pbd.particles(x, masses=1000.0 * s**d)
    offset = np.concatenate([np.zeros(d), [-4.0], *[[-counts[1] * s]] * (d - 2)])
    normal = np.concatenate([np.eye(d), -np.eye(d)[: d - 1]])
    fluid = pbd.density(particles, spacing=s, support=support, normal=normal, offset=offset, rest=rest)
    settings = pbd.Settings(dt=COURANT * s / math.sqrt(G), iterations=ITERATIONS, precision=precision)
    gravity = [0.0] * (d - 1) + [-G]
    return particles, fluid, settings, gravity


def in_disorder(counts, support, precision="float32"):
    """As `scene`, when the column has collapsed for a while."""
    particles, fluid, settings, gravity = scene(counts, support, precision)
    steps = round(0.5 * math.sqrt(1.0 / G) / settings.dt)
    out = pbd.Simulation(particles, [fluid], gravity=gravity, settings=settings).run(steps, [steps])
    moved = pbd.particles(out.positions[-1], velocities=out.velocities[-1], masses=1.0 / particles.w)
    return moved, fluid, settings, gravity


def throughput(name, counts, support, goal, aim, repeats, precision="float32"):
    particles, fluid, settings, gravity = in_disorder(counts, support, precision)
    n = particles.w.shape[0]
    simulation = pbd.Simulation(particles, [fluid], gravity=gravity, settings=settings)
    simulation.run(1, [1])
    best = dict.fromkeys((*STAGES, "whole step"), math.inf)
    prepared, state = simulation._scene.batches[0], simulation._scene.state
    h = settings.dtype.type(settings.h)
    for _ in range(repeats):
        for stage, (run, _) in STAGES.items():
            run(prepared, state, h, 0)
            start = time.perf_counter()
            run(prepared, state, h, 4)
            best[stage] = min(best[stage], (time.perf_counter() - start) / 4)
        start = time.perf_counter()
        simulation.run(20, [20])
        best["whole step"] = min(best["whole step"], (time.perf_counter() - start) / 20)
    near = neighbours(np.column_stack(particles.x), support / counts[0])
    print(f"{name}, {n} particles, {near:.1f} neighbours, {state.work[1] / n:.1f} candidates, {precision}")
    for stage, (_, times) in STAGES.items():
        print(f"  {stage:18s} {best[stage] / n * 1e9:7.1f} ns a particle" + (f", {times} times" if times else ""))
    whole = best["whole step"] / n * 1e9
    verdict = "aim met" if whole <= aim else "goal met" if whole <= goal else "missed"
    print(f"  {'whole step':18s} {whole:7.1f} ns a particle   goal {goal:g}, aim {aim:g}: {verdict}", flush=True)


def threads(name, counts, support, repeats):
    """A step with one, two, ... threads against one, up to the machine's."""
    particles, fluid, settings, gravity = in_disorder(counts, support)
    n, first = particles.w.shape[0], None
    teams = [1 << k for k in range((os.cpu_count() or 1).bit_length())]
    runs = {}
    for count in teams:
        chosen = dataclasses.replace(settings, threads=count)
        runs[count] = pbd.Simulation(particles, [fluid], gravity=gravity, settings=chosen)
        runs[count].run(1, [1])
    best = {(count, steps): math.inf for count in teams for steps in (2, 12)}
    for _ in range(2 * repeats):
        for count, steps in best:
            start = time.perf_counter()
            runs[count].run(steps, [steps])
            best[count, steps] = min(best[count, steps], time.perf_counter() - start)
    for count in teams:
        ns = (best[count, 12] - best[count, 2]) / 10 / n * 1e9
        first = first or ns
        print(
            f"{name}, {n} particles, threads: {count}, {ns:6.1f} ns a particle, {first / ns:.2f} times one", flush=True
        )


def neighbours(x, h):
    """Mean number of particles within h of one, without itself."""
    from scipy.spatial import cKDTree

    tree = cKDTree(x)
    return tree.count_neighbors(tree, h) / len(x) - 1.0


def scaling():
    """A step of more and more particles in a random order in memory, against 1e4 of them."""
    first, rng = None, np.random.default_rng(0)
    for across in (70, 224, 707):
        particles, fluid, settings, gravity = scene((across, 2 * across), 2.5, "float32")
        n = particles.w.shape[0]
        x = rng.permutation(np.column_stack(particles.x))
        mixed = pbd.particles(x + rng.uniform(-0.1, 0.1, x.shape) / across, masses=1.0 / particles.w)
        simulation = pbd.Simulation(mixed, [fluid], gravity=gravity, settings=settings)
        simulation.run(1, [1])
        best = {4: math.inf, 8: math.inf}
        for _ in range(5):
            for steps in best:
                start = time.perf_counter()
                simulation.run(steps, [steps])
                best[steps] = min(best[steps], time.perf_counter() - start)
        ns = (best[8] - best[4]) / 4 / n * 1e9
        first = first or ns
        size = memory(simulation._scene) / n
        print(f"{n:8d} particles: {ns:6.1f} ns a particle, {ns / first:.2f} of the first, {size:.0f} bytes", flush=True)


def memory(value):
    """Bytes of all arrays in nested tuples."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    return sum(memory(part) for part in value) if isinstance(value, tuple) else 0


def fronts(repeats):
    """A dam break's largest relative error of the front at T = 1, 2 against its time."""
    unit = math.sqrt(1.0 / (2.0 * G))
    for across, rest in itertools.product((10, 14, 20, 28, 40), ("lattice", "start")):
        particles, fluid, settings, gravity = scene((across, 2 * across), 2.5, "float32", rest)
        fluid.walls.planes.offset[2] = -8.0
        steps = math.ceil(unit / settings.dt)
        simulation = pbd.Simulation(
            particles,
            [fluid],
            gravity=gravity,
            settings=pbd.Settings(dt=unit / steps, iterations=ITERATIONS, precision="float32"),
        )
        best = math.inf
        for _ in range(repeats):
            start = time.process_time()
            out = simulation.run(3 * steps, steps * np.arange(1, 4))
            best = min(best, time.process_time() - start)
        front = out.positions[:2, :, 0].max(axis=1) + 0.5 / across
        error = np.abs(front / np.array(list(REFERENCE.values())) - 1.0).max()
        said = f"dam break to T = 3, {across} across, rest by {rest}: {best:.3f} s"
        print(f"{said}, front off by {100 * error:.2f} % at T = 1, 2", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--repeats", type=int, default=20)
    repeats = parser.parse_args().repeats
    for name, case in CASES.items():
        throughput(name, *case, repeats)
        threads(name, *case[:2], repeats)
    scaling()
    fronts(max(1, repeats // 4))


if __name__ == "__main__":
    main()
