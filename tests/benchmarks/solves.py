"""What solvers reach: Hierarchical PBD on cloth, small steps, implicit Euler's minimiser, cost over size.

Run as ``python tests/benchmarks/solves.py``. The studies' own tables and sentences are printed, with the goals.
"""

from __future__ import annotations

import numpy as np

import comparisons
import pbd
from comparisons import exact_projection
from comparisons.run import build_scene

RESIDUAL, SWEEPS_GOAL, DISTANCE_GOAL = 1e-3, 140, 1.2
SIZES = (32, 64)
KILOGRAMS = 1.0
"""Of a particle of the compliant cloth, about."""


def verdict(is_met):
    return "met" if is_met else "missed"


def until_met(scene, solver, counts):
    """(iterations, fine-sweep equivalents, end state) of the first count that leaves RESIDUAL rms C/rest."""
    masses, (rods,) = scene.masses, scene.links
    particles = pbd.particles(masses.positions, masses=masses.masses, pinned=masses.pinned)
    links = pbd.distance(particles, rods.pairs, rest_length=rods.lengths)
    for count in counts:
        out = pbd.Simulation(particles, [links], settings=pbd.Settings(iterations=count, solver=solver)).run(1, [1])
        x = out.positions[-1]
        lengths = np.linalg.norm(x[rods.pairs[:, 0]] - x[rods.pairs[:, 1]], axis=1)
        if np.sqrt(np.mean((lengths / rods.lengths - 1.0) ** 2)) <= RESIDUAL:
            return count, out.projections / links.size(), x
    raise SystemExit(f"{solver} did not reach {RESIDUAL:g}")


def multilevel():
    """Cloth 64 x 64, columns 10 % too long."""
    scene = build_scene("hanging_cloth", {"size": 64, "side": 63.0, "stretch": 1.1, "gravity": 0.0})
    exact = exact_projection.project(scene).positions
    found = {}
    for name, solver, counts in (
        ("multilevel", pbd.Multilevel(), range(1, 100)),
        ("Gauss-Seidel", pbd.GaussSeidel(), range(1000, 20_000, 500)),
    ):
        count, sweeps, x = until_met(scene, solver, counts)
        found[name] = sweeps, exact_projection.distance(scene.masses, x, exact)
        print(f"cloth 64x64 to {RESIDUAL:g} rms, {name}: {count} iterations, {sweeps:.0f} sweeps, ", end="")
        print(f"{found[name][1]:.2e} m rms from the exact projection of the start")
    (sweeps, far), (_, other) = found.values()
    print(f"  goal {SWEEPS_GOAL} sweeps: {verdict(sweeps <= SWEEPS_GOAL)};", end=" ")
    print(f"distance / Gauss-Seidel's {far / other:.2f}, goal {DISTANCE_GOAL}: {verdict(far <= DISTANCE_GOAL * other)}")


def implicit():
    """Four cases a size; time steps of 1/60 and 1/600 s."""
    for size in SIZES:
        density = KILOGRAMS * size**2
        study = comparisons.implicit_euler("hanging_cloth", scene={"size": size, "density": density}, quiet=True)
        print(study.title)
        print("\n".join("  ".join(cell.ljust(14) for cell in row) for row in study.tables[0].rows))
        print("\n".join(study.sentences))


def main():
    multilevel()
    print("\n".join(comparisons.small_steps("pendulum_chain", quiet=True).sentences))
    for scene in ("pendulum_chain", "hanging_cloth"):
        print("\n".join(comparisons.scaling(scene, engines=["pbd"], quiet=True).sentences))
    implicit()


if __name__ == "__main__":
    main()
