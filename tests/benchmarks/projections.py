"""What a projection costs, beside the C++ reference of position-based dynamics, and what a direct solve costs.

Run as ``python tests/benchmarks/projections.py``. Both engines run in this process, one thread, in turn, each run
built anew; the minimum of the repeats counts. A projection is (time with MORE sweeps - time with one) over the
difference. The unruly mesh is the cloth with its particles and links in random order: it has no runs.
"""

from __future__ import annotations

import dataclasses
import os
import time

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"))

import numpy as np

import pbd
from comparisons import engine
from comparisons.run import build_scene
from comparisons.scene import PointMasses, Rods

STEPS, MORE, REPEATS, DT = 12, 51, 9, 1e-3
OVERSTRETCHED = {"stretch": 1.1, "gravity": 0.0, "duration": STEPS * DT, "samples": 1}
COLOURED = {"order": "coloured"}
SINGLE = {"order": "coloured", "precision": "float32"}
PEER = "pypbd"


def chain(links):
    return build_scene("pendulum_chain", {"links": links, **OVERSTRETCHED})


def cloth(size=64):
    return build_scene("hanging_cloth", {"size": size, "pinned": "corners", **OVERSTRETCHED})


def unruly(scene):
    """The scene with particles and links in random order."""
    rng = np.random.default_rng(0)
    place = rng.permutation(len(scene.masses.masses))  # where each particle goes
    back, (rods,) = np.argsort(place), scene.links
    order = rng.permutation(len(rods.lengths))
    masses = PointMasses(
        scene.masses.positions[back],
        scene.masses.velocities[back],
        scene.masses.masses[back],
        tuple(place[list(scene.masses.pinned)].tolist()),
    )
    return dataclasses.replace(scene, masses=masses, links=(Rods(place[rods.pairs][order], rods.lengths[order]),))


CASES = (
    ("any mesh, coloured", unruly(cloth()), COLOURED, 4.0),
    ("cloth 64x64, coloured", cloth(), COLOURED, 9.0),
    ("cloth 64x64, coloured, float32", cloth(), SINGLE, None),
    ("cloth 64x64, natural", cloth(), {}, None),
    *((f"chain {n}, coloured", chain(n), COLOURED, 15.0) for n in (1000, 10_000)),
    *((f"chain {n}, coloured, float32", chain(n), SINGLE, 25.0) for n in (1000, 10_000)),
    ("chain 1000, natural", chain(1000), {}, None),
    ("chain 1000, wavefront", chain(1000), {"order": "wavefront"}, None),
)
"""Name, scene, settings of ours, goal for the ratio."""

WAVEFRONT_GOAL = 6.0
"""ns a projection."""

DIRECT_LINKS, DIRECT_GOAL = 1000, 300.0
"""µs for a chain overstretched by 10 %, to a residual of 1e-12."""


def seconds(name, scene, iterations, settings):
    adapter = engine.load(name)
    run = adapter.prepare(scene, adapter.Settings(**{**settings, "dt": DT, "iterations": iterations}))
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def projection(name, scene, settings, times):
    """ns a projection from the minima so far, after one more repeat."""
    for iterations in (1, MORE):
        key = (name, iterations)
        times[key] = min(times.get(key, np.inf), seconds(name, scene, iterations, settings))
    links = sum(len(link.lengths) for link in scene.links)
    return (times[name, MORE] - times[name, 1]) / ((MORE - 1) * STEPS * links) * 1e9


def compare(what, scene, settings, goal):
    """One line: ours, the peer's, the ratio."""
    ours, theirs = {}, {}
    peer = not engine.load(PEER).missing()
    matched = engine.load(PEER).PRESETS["matched"] if peer else {}
    mine = other = np.nan
    for _ in range(REPEATS):
        mine = projection("pbd", scene, settings, ours)
        if peer:
            other = projection(PEER, scene, {**matched, "method": "pbd"}, theirs)
    ratio = other / mine
    verdict = f"  goal {goal:g}: {'met' if ratio >= goal else 'missed'}" if goal else ""
    if "wavefront" in what:
        verdict = f"  goal <= {WAVEFRONT_GOAL:g} ns: {'met' if mine <= WAVEFRONT_GOAL else 'missed'}"
    print(f"{what:34s} {mine:7.2f} ns   pyPBD {other:6.2f} ns   ratio {ratio:6.1f}{verdict}", flush=True)


def direct():
    """Time of one direct solve, and the residual that it leaves."""
    n = DIRECT_LINKS
    x = np.column_stack([1.1 / n * np.arange(n + 1), np.zeros(n + 1)])
    particles = pbd.particles(x, pinned=[0])
    links = pbd.distance(particles, [(i, i + 1) for i in range(n)], rest_length=1.0 / n)
    simulation = pbd.Simulation(particles, [links], settings=pbd.Settings(solver=pbd.Direct()))
    best = np.inf
    for _ in range(50):
        start = time.perf_counter()
        out = simulation.run(1, [1])
        best = min(best, time.perf_counter() - start)
    left = np.abs(n * np.linalg.norm(np.diff(out.positions[-1], axis=0), axis=1) - 1.0).max()
    met = best * 1e6 <= DIRECT_GOAL and left <= 1e-12
    print(
        f"direct solve, {n} links overstretched by 10 %: {best * 1e6:.0f} us with the call from Python, residual "
        f"{left:.1e}, {out.projections // n} Newton iterations  goal {DIRECT_GOAL:g} us to 1e-12: "
        f"{'met' if met else 'missed'}"
    )


def main():
    direct()
    for case in CASES:
        compare(*case)


if __name__ == "__main__":
    main()
