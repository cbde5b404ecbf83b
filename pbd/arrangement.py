"""What happens before a run: a solver arranges particles and constraints, and binds each law, once.

A solver that a user chooses has ``arrange(problem)``; it refuses what it cannot solve, with the reason.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pbd.errors import InvalidInput
from pbd.rigid.bodies import Bodies
from pbd.state import Particles
from pbd.vector import aligned

if TYPE_CHECKING:
    from pbd.settings import Settings


class Problem(NamedTuple):
    """Particles, the user's batches with the laws as chosen, how to step, and further bodies if any."""

    particles: Any
    batches: tuple
    settings: Settings
    bodies: Any = None


class Arrangement(NamedTuple):
    """What runs: the kernel's solver, particles and batches, laws bound.

    slot (n,) : where each of the user's particles stands; None where they stand as given
    """

    solver: Any
    particles: Particles | None
    batches: tuple
    slot: np.ndarray | None = None


def check_groups(problem: Problem) -> None:
    """Refuse batches of another state group than there is, or made for bodies of another number or dimension."""
    bodies = problem.bodies
    for k, batch in enumerate(problem.batches):
        name, kind = f"constraints[{k}]", type(batch).__name__
        if hasattr(batch, "made_for"):
            theirs, fits = batch.made_for(), "contacts and joints made for the bodies of the simulation"
            if bodies is None:
                raise InvalidInput(name, kind, "a batch of particles where there are no bodies", "give bodies=")
            ours = len(bodies.radius) - 1, len(bodies.x)
            if theirs != ours:
                raise InvalidInput(name, "{} bodies in {}D".format(*theirs), fits, "they are {} in {}D".format(*ours))
        elif problem.particles is None and isinstance(bodies, Bodies):
            raise InvalidInput(name, kind, "a batch of bodies, with made_for(), where there are no particles")


def bind_laws(problem: Problem) -> tuple:
    """The batches with their laws bound to sub-step and iterations; empty batches are dropped.

    One that is left alone, and has a form for that - alone() -, takes it.
    """
    batches = tuple(bind_law(batch, problem) for batch in problem.batches if not is_empty(batch))
    return (batches[0].alone(),) if len(batches) == 1 and hasattr(batches[0], "alone") else batches


def is_empty(batch: Any) -> bool:
    """Whether a batch of constraints that are known beforehand has none."""
    return has_law(batch) and batch.size() == 0


def has_law(batch: Any) -> bool:
    """Whether the user chose how stiffly the batch is enforced."""
    return hasattr(getattr(batch, "law", None), "bind")


def bind_law(batch: Any, problem: Problem) -> Any:
    """The batch with its law bound; one that brings its own kernel law stays as it is."""
    if not has_law(batch):
        return batch
    weight = batch.weights(problem.particles.w) if hasattr(batch, "weights") else None
    settings = problem.settings
    return batch._replace(law=batch.law.bind(batch.size(), int(settings.iterations), weight, settings.h))


def is_rigid_equality(batch: Any) -> bool:
    """Whether a batch is to hold exactly, C = 0."""
    return has_law(batch) and batch.law.is_rigid and batch.law.relation == "equality"


def renumbered(item: Any, slot: np.ndarray, solver: str) -> Any:
    """A batch or field for particles that now stand in ``slot``; refused where it cannot follow."""
    if not hasattr(item, "renumbered"):
        reason = f"it moves particles, and {type(item).__name__} has no renumbered(slot)"
        raise InvalidInput("settings.solver", solver, "another solver", reason)
    return item.renumbered(slot)


def placed(particles: Particles, slot: np.ndarray, slots: int) -> Particles:
    """The particles in their slots; what is free between them holds a pinned particle at the origin."""

    def moved(values: np.ndarray) -> np.ndarray:
        spread = np.zeros(slots)
        spread[slot] = values
        return aligned(spread)

    x, p, v = (tuple(moved(axis) for axis in store) for store in particles[:3])
    return Particles(x, p, v, moved(particles.w))
