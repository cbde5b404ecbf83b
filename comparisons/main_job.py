"""The main job: the studies of the report, in its chapters."""

from __future__ import annotations

from typing import Any

from comparisons.isolation import Workers
from comparisons.studies import convergence, stiffness, work_precision
from comparisons.study import Chapter, Study

SCENE = "pendulum_chain"
CHAINS = (1, 2, 10, 100)
COMPLIANCE = 1e-2
"""Of a link in a chain of N, times N^2 [m/N]: 1 kg stretches a single link by 10 %."""

BEFORE_BUCKLING = 0.6
"""Seconds: from 0.7 s on the compliant chain of 100 is compressed and buckles, which no step predicts for long."""

SECONDS_PER_RUN = {1: 0.02, 2: 0.02, 10: 0.04, 100: 0.1}
ROUNDS = 2
CONVERGENCE_SECONDS_PER_RUN = {1: 0.1, 2: 0.1, 10: 0.25, 100: 0.8}
"""Longer chains reach their asymptotic range later: 100 links only below dt = 3e-5 s."""

COINCIDE = "pymunk's undamped spring is symplectic Euler, so these two lines coincide."

SETTINGS_OF = ("symplectic_euler", "pbd", "pymunk", "pybullet")
SETTINGS_LINKS = 10


def run(*, quiet: bool = False) -> list[Chapter]:
    """Work-precision and convergence of rigid and compliant chains, each engine's settings, and stiffness."""
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
    return [*chapters, _stiffness(how)]


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
