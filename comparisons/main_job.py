"""The main job: the studies of the report, in its chapters."""

from __future__ import annotations

from typing import Any

from comparisons import body_chapters, fluid_chapters
from comparisons.isolation import Workers
from comparisons.studies import (
    calibration,
    convergence,
    implicit_euler,
    scaling,
    small_steps,
    solvers,
    stiffness,
    throughput,
    work_precision,
)
from comparisons.study import Chapter, Study

SCENE = "pendulum_chain"
CHAINS = (1, 2, 10, 100)
COMPLIANCE = 1e-2
"""Of a link in a chain of N, times N^2 [m/N]: 1 kg stretches a single link by 10 %."""

BEFORE_BUCKLING = 0.6
"""Seconds: from 0.7 s on the compliant chain of 100 is compressed and buckles, which no step predicts for long."""

SECONDS_PER_RUN = {1: 0.01, 2: 0.012, 10: 0.025, 100: 0.045}
ROUNDS = 2
CONVERGENCE_SECONDS_PER_RUN = {1: 0.1, 2: 0.1, 10: 0.2, 100: 0.4}
"""Longer chains reach their asymptotic range later: 100 links only below dt = 3e-5 s."""

COINCIDE = "pymunk's undamped spring is symplectic Euler, so these two lines coincide."

SETTINGS_OF = ("symplectic_euler", "pbd", "pymunk", "pybullet")
SETTINGS_LINKS = 10

PARTICLES = (10, 100, 1000, 10_000)
"""For throughput; a peer takes 20 µs a particle to build its scenes, which more of them would only wait for."""

SCALES = (1000, 3000, 10_000, 30_000, 100_000)
SOLVED = (("pendulum_chain", {"links": 100}), ("pendulum_chain", {"links": 1000}), ("hanging_cloth", {"size": 32}))
SWINGING = {"size": 32, "density": 1024.0}
SOLVER_SWEEPS = (1, 10, 100, 1000)


def run(*, quiet: bool = False) -> list[Chapter]:
    """Work-precision and convergence of chains, what solvers do and cost, rigid bodies, and calibration."""
    with Workers() as workers:
        return _chapters({"workers": workers, "quiet": quiet})


def _chapters(how: dict[str, Any]) -> list[Chapter]:
    chapters = []
    for name, compliance in (("rigid", 0.0), ("compliant", COMPLIANCE)):
        scenes = [_scene(links, compliance) for links in CHAINS]
        races = [
            work_precision.run(SCENE, scene=scene, cap=SECONDS_PER_RUN[scene["links"]], rounds=ROUNDS, **how)
            for scene in scenes
        ]
        chapters.append(_races(name, races))
        if compliance == 0.0:
            chapters.append(_settings(races[CHAINS.index(SETTINGS_LINKS)]))
        chapters.append(_convergence(name, scenes, how))
    return [*chapters, *(make(how) for make in OTHERS)]


def _scene(links: int, compliance: float) -> dict[str, Any]:
    buckles = compliance > 0.0 and links == CHAINS[-1]
    shorter = {"duration": BEFORE_BUCKLING} if buckles else {}
    return {"links": links, "compliance": compliance / links**2, **shorter}


def _races(name: str, races: list[Study]) -> Chapter:
    return Chapter(
        heading=f"Run time against error, {name} chains",
        caption=(
            "Every dot is one setting of one engine, every line an engine's best. A chain of 1 m, masses of 1 kg, "
            "is released from horizontal. Fronts towards the lower left are better."
        ),
        studies=races,
    )


def _settings(race: Study) -> Chapter:
    return Chapter(
        heading=f"Each engine's settings, {race.subject}",
        caption=(
            "One line a setting, the time step varies along it. Symplectic Euler's springs set a floor that falls "
            "with their stiffness, at the price of smaller stable steps. Matched means with a half kick: leapfrog."
        ),
        studies=[s for s in (work_precision.by_setting(race, engine) for engine in SETTINGS_OF) if s.series],
    )


def _convergence(name: str, scenes: list[dict], how: dict[str, Any]) -> Chapter:
    return Chapter(
        heading=f"Convergence, {name} chains",
        caption=(
            "Error against time step, sub-steps and iterations. Iterations buy link length, not trajectory accuracy; "
            "sub-steps buy both. " + (COINCIDE if name == "compliant" else "")
        ),
        studies=[
            convergence.run(SCENE, scene=scene, cap=CONVERGENCE_SECONDS_PER_RUN[scene["links"]], **how)
            for scene in scenes
        ],
    )


def _stiffness(how: dict[str, Any]) -> Chapter:
    return Chapter(
        heading="What stiffness k does",
        caption=(
            "k' makes one constraint's residual independent of the iterations; for a chain only nearly, and the "
            "stretch of a hung mass still falls with the time step squared. Compliance depends on neither. "
            "Broad grey dashes: closed forms."
        ),
        studies=[stiffness.run(SCENE, **how)],
    )


def _small_steps(how: dict[str, Any]) -> Chapter:
    return Chapter(
        heading="Small steps: n sub-steps or n iterations",
        caption=(
            "A chain hangs straight down, and its bottom below its place: all of that is error, after 1000 frames. For "
            "the same number of projections sub-steps leave 1/n^2 of the error, iterations 1/n at best. "
            "Broad grey: closed form."
        ),
        studies=[small_steps.run(SCENE, rounds=ROUNDS, **how)],
    )


def _solvers(how: dict[str, Any]) -> Chapter:
    return Chapter(
        heading="What a projection buys, by solver",
        caption=(
            "Every link starts 10 % too long; one step without gravity. Sweeps carry a correction a link at a time, "
            "the multilevel solver over all lengths at once, and the direct solver, for chains only, to round-off."
        ),
        studies=[solvers.run(scene, scene=size, sweeps=SOLVER_SWEEPS, rounds=ROUNDS, **how) for scene, size in SOLVED],
    )


def _throughput(how: dict[str, Any]) -> Chapter:
    return Chapter(
        heading="What a projection costs",
        caption=(
            "One thread. Natural order waits for each projection before the next; coloured order fills vector "
            "registers, and a wavefront runs many sweeps at once with the result of natural order. A cheap "
            "projection may be worth less: the second table gives the time to equal residual."
        ),
        studies=[throughput.run(SCENE, particles=PARTICLES, rounds=ROUNDS, brief=True, **how)],
    )


def _scaling(how: dict[str, Any]) -> Chapter:
    return Chapter(
        heading="What size costs",
        caption=(
            "A step with one sweep, per particle: flat while all that a step reads and writes stays in a cache. "
            "Broad grey: the size of a cache."
        ),
        studies=[scaling.run(SCENE, particles=SCALES, engines=["pbd"], rounds=ROUNDS, **how)],
    )


def _calibration(how: dict[str, Any]) -> Chapter:
    return Chapter(
        heading="Calibration of the engines",
        caption="What every engine makes of problems with a known answer: its order, its conventions, its traps.",
        studies=[calibration.run(**how)],
    )


def _implicit_euler(how: dict[str, Any]) -> Chapter:
    return Chapter(
        heading="What XPBD's compliance converges to",
        caption=(
            "A swinging cloth, about 1 kg a particle: how far a step ends from implicit Euler's minimiser. Sweeps "
            "alone stall; re-synchronisation or Newton's method get there."
        ),
        studies=[implicit_euler.run("hanging_cloth", scene=SWINGING, rounds=ROUNDS, **how)],
    )


OTHERS = (
    _stiffness,
    _small_steps,
    _solvers,
    _implicit_euler,
    _throughput,
    _scaling,
    *body_chapters.CHAPTERS,
    *fluid_chapters.CHAPTERS,
    _calibration,
)
"""The chapters after those on chains."""
