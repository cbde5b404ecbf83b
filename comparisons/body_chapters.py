"""The chapters of the report on rigid bodies, small enough for it; the command line runs the same studies in full."""

from __future__ import annotations

from typing import Any

from comparisons.studies import contacts, falling, piles, stacking, work_precision
from comparisons.study import Chapter

ROUNDS = 2
PHASES = 4
RACES = (
    ("slide", 2, 0.006),
    ("incline_slip", 1, 0.006),
    ("rolling", 1, 0.006),
    ("rebound", 2, 0.006),
    ("bouncing_ball", 2, 0.006),
    ("stack", 1, 0.03),
)
"""Scene, phases of the grid of steps, seconds that a run may take."""


def races(how: dict[str, Any]) -> Chapter:
    """Run time against error of six scenes."""
    return Chapter(
        heading="Run time against error, rigid bodies",
        caption=(
            "Every dot is one setting of one engine, every line an engine's best; fronts towards the lower left are "
            "better. Without events, schemes of second order are exact by construction (incline, rolling), which is no "
            "merit; impacts and stops, the worst of two phases of the grid of steps, tell more."
        ),
        studies=[
            work_precision.run(scene, cap=cap, rounds=ROUNDS, phases=phases, **how) for scene, phases, cap in RACES
        ],
    )


def errors(how: dict[str, Any]) -> Chapter:
    """The table of scenes and engines."""
    return Chapter(
        heading="Contacts: errors against closed forms",
        caption=(
            "Further left is better; hollow is a cheaper preset, or the engine's default. An impact or a stop is "
            "somewhere in a step, so scenes with events count the worst of several phases of the grid of steps. Rows "
            "with † are exact by construction for schemes of second order and count as no win."
        ),
        studies=[contacts.run(phases=PHASES, **how)],
    )


def stacks(how: dict[str, Any]) -> Chapter:
    """Drift against the number of boxes."""
    return Chapter(
        heading="Stacks",
        caption=(
            "Boxes on each other, shifted at random by up to a hundredth of their edge. Nothing should move. A line "
            "ends at a cross where a stack falls, or else where the next would take too long for this report."
        ),
        studies=[stacking.run(counts=(10, 20, 40, 80, 160), seeds=2, cap=1.5, **how)],
    )


def heaps(how: dict[str, Any]) -> Chapter:
    """Cost against overlap and motion."""
    return Chapter(
        heading="Piles",
        caption=(
            "Boxes fall into a container; after 3 s none should overlap or move. Further down is faster, further left "
            "is tighter, or more at rest."
        ),
        studies=[piles.run(counts=(100,), solids=(20,), sizes=(100, 300, 1000), cap=4.0, rounds=ROUNDS, **how)],
    )


def show(how: dict[str, Any]) -> Chapter:
    """The film."""
    return Chapter(
        heading="Falling boxes",
        caption=(
            "The same boxes and balls, dropped in every engine. No two heaps agree, and none is wrong for that: what "
            "tells is how deep bodies overlap, whether they come to rest, and whether energy rises."
        ),
        studies=[falling.run(seeds=3, solids=20, solid_seeds=2, cap=8.0, **how)],
    )


CHAPTERS = (show, errors, races, stacks, heaps)
