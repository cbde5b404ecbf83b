"""RATTLE with contacts: the position-based step of rigid bodies, of second order, with impacts at their own times.

Source: Andersen 1983 for equality constraints. As in PBD positions are projected onto the constraints; here they act
along their gradients at the start (SHAKE), velocities take the impulses, half a kick comes before and half after, and a
second pass projects the velocities:

    v <- v + h/2 g + M^-1 J(x)^T p     such that the gaps at x + h v are >= 0, p >= 0, |friction| <= mu p
    x <- x + h v
    v <- v + h/2 g + M^-1 J(x)^T p'    such that the gaps do not close, or open by e times the speed of an impact,
                                       p + p' >= 0

The two passes have one budget of friction, and the second may take back what the first has pushed: what foresaw the
turn of a body not quite is no speed after it. What undoes a deep overlap is taken back before, whole. Gaps are taken
where the bodies will be, so that both are of second order for turning bodies; sticking contacts pull back what they
have slipped. Both start from the forces of the last velocity pass: started from what positions asked for, a pass that
is not solved to the end would feed its own errors, with an amplification of up to 1.1 a step, as the recurrence of one
mode shows; so it is at most 1.

An impact is found as the root of the gap's motion in the sub-step, which is then divided there: free flights stay
exact parabolas, and a ball that bounces keeps its energy to round-off. The impact is a velocity pass of its own: those
that carry a body up to it need not be those that carry it after. Where more than ``events`` contacts close at
once or one after the other, they end with the sub-step, to first order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from pbd import fields
from pbd.arrangement import Problem
from pbd.errors import InvalidInput
from pbd.jit import device
from pbd.stages import (
    accelerate,
    drift,
    foresee,
    mark,
    relieve,
    settle,
    solve,
    solve_velocities,
    strike,
    turn_over,
    warm_start,
)
from pbd.state import EARLIEST, IMPACTS, LEAST

NEGLIGIBLE = 1e-9
"""A part of a sub-step shorter than this share of it is none."""


@dataclass(frozen=True)
class Rattle:
    """The step of rigid bodies; a sub-step is divided at ``events`` impacts at most."""

    events: int = fields.whole(8, 0, 1000, "impacts in a sub-step that are resolved in time")

    def __post_init__(self) -> None:
        fields.check(self, "integrator")

    def bind(self, problem: Problem) -> Impulses:
        """The kernel's integrator; refuses what it does not step."""
        if problem.particles is not None or problem.bodies is None:
            raise InvalidInput("settings.integrator", "rattle", "euler or shake for particles", "it steps bodies")
        settings = problem.settings
        for field, value, is_bad, allowed in (
            ("damping", settings.damping, settings.damping and settings.damping.k, "none"),
            ("precision", settings.precision, settings.precision != "float64", "float64"),
        ):
            if is_bad:
                raise InvalidInput(f"settings.{field}", value, f"{allowed} with rattle")
        return Impulses(int(self.events))


class Impulses(NamedTuple):
    """The kernel's RATTLE."""

    events: int

    def step(self, solver, scene, h):
        left = h
        for event in range(self.events + 1):
            left -= advance(self, solver, scene, (left, h), event)
            if left <= NEGLIGIBLE * h:
                break


@device
def advance(rattle, solver, scene, lengths, event):
    """One step up to the first impact within what is left of the whole sub-step, or all of it; returns its length."""
    h, whole = lengths
    state, batches = scene.state, scene.batches
    mark(batches, state)
    kick_half(scene, h)
    look_ahead(batches, state, h, whole)
    first, impacts = state.signals[EARLIEST], state.signals[IMPACTS]
    strikes = event < rattle.events and impacts <= rattle.events and NEGLIGIBLE * h < first < h
    if strikes:
        accelerate(scene.external, state, 0.5 * (first - h))
        h = first
        look_ahead(batches, state, h, whole)
    solve(solver, batches, state, h)
    drift(state.bodies, h)
    relieve(batches, state)
    turn_over(batches, state, h, strikes)
    kick_half(scene, h)
    warm_start(batches, state, h)
    solve_velocities(solver, batches, state)
    if strikes:
        strike(batches, state)
        solve_velocities(solver, batches, state)
    settle(batches, state, h, impacts == 0.0 and h > 0.5 * whole)  # impulses in a short part are no forces
    return h


@device
def kick_half(scene, h):
    """v <- v + h/2 g."""
    accelerate(scene.external, scene.state, 0.5 * h)


@device
def look_ahead(batches, state, h, whole):
    """The motion over h under the last forces: its gaps, and the first impact."""
    warm_start(batches, state, h)
    state.signals[EARLIEST], state.signals[IMPACTS], state.signals[LEAST] = math.inf, 0.0, 0.0
    foresee(batches, state, h, whole)
