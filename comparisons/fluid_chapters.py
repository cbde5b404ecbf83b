"""The chapters of the report on fluids, small enough for it; the command line runs the same studies in full."""

from __future__ import annotations

from typing import Any

from comparisons.studies import blow_up, dam_break, density_stiffness, fluid_convergence, fluid_throughput
from comparisons.study import Chapter

ROUNDS = 2


def collapse(how: dict[str, Any]) -> Chapter:
    """Fronts, heights, run time against error, stills and the film."""
    return Chapter(
        heading="Dam break",
        caption=(
            "A column of water collapses: fronts over the experiments' points, and run time against the front's error, "
            "each line from coarse to fine particles. All inviscid fronts lead the measured ones by one shift in "
            "time. Discs and balls are grains: with them people imitate water in engines of rigid bodies."
        ),
        studies=[dam_break.run(across=(10, 20, 40), cap=5.0, rounds=ROUNDS, **how)],
    )


def limits(how: dict[str, Any]) -> Chapter:
    """Convergence."""
    return Chapter(
        heading="Convergence of the dam break",
        caption=(
            "Distance of the front from that of the finest point of the same line. Below a spacing the front is a "
            "single particle, which jumps."
        ),
        studies=[fluid_convergence.run(across=(5, 10, 20, 40), courant=(0.64, 0.32, 0.16, 0.08), **how)],
    )


def stiffness(how: dict[str, Any]) -> Chapter:
    """k', raw k and compliance."""
    return Chapter(
        heading="What stiffness does to a fluid",
        caption="Water at rest under its own weight. Broad grey: what a compliance allows, alpha m g H/2.",
        studies=[density_stiffness.run(iterations=(1, 2, 4, 8, 16), **how)],
    )


def stability(how: dict[str, Any]) -> Chapter:
    """The blow-up map."""
    return Chapter(
        heading="Where fluids blow up",
        caption=(
            "A dam break at each point. A single iteration needs relaxation; four hold at any step that is of use, "
            "unless they over-relax."
        ),
        studies=[blow_up.run(**how)],
    )


def cost(how: dict[str, Any]) -> Chapter:
    """A particle's step."""
    return Chapter(
        heading="What a fluid's step costs",
        caption=(
            "Time of one step of one particle, which hardly depends on how many there are; a second thread pays from "
            "some thousand on."
        ),
        studies=[fluid_throughput.run(across=(10, 30, 100), solids=(12, 24), cap=4.0, rounds=ROUNDS, **how)],
    )


CHAPTERS = (collapse, limits, stability, stiffness, cost)
