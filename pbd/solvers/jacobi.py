"""Averaged Jacobi: all constraints see the same positions (Macklin et al. 2014, "Unified Particle Physics", section 4).

    dx_i = (omega / n_i) sum over the constraints c of i of w_i dl_c grad_i C_c,     all of them at the same p

with n_i the constraints that touched particle i in this iteration: every equality, and an inequality where it is
violated. The plain sum (n_i = 1) grows when constraints agree: of m equal ones each iteration leaves 1 - m of the
residual. The mean leaves 1 - omega, so it needs 0 < omega < 2. The result does not depend on the order of the
constraints, up to round-off.

Limits: converges more slowly than Gauss-Seidel, which uses each correction at once. Particles of one constraint
are averaged over different n_i, so momentum is not kept where these differ. What a batch applies by itself it must
be able to average: batches that project themselves are refused, and so is XPBD, whose multiplier would add up
corrections that were not made. Deviation: the paper averages within groups of constraints, and applies one group
before the next; here all constraints are one group.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pbd import fields
from pbd.arrangement import Arrangement, Problem, bind_laws, is_empty
from pbd.constraints.contact import Contact
from pbd.dispatch import stage
from pbd.errors import InvalidInput
from pbd.intrinsics import typed
from pbd.jit import device
from pbd.projection import increment, inverse_weight, violated
from pbd.stages import evaluate, size
from pbd.stiffness import Compliance
from pbd.vector import Store, accumulate, like


@dataclass(frozen=True)
class Jacobi:
    """``iterations`` averaged Jacobi iterations with over-relaxation ``omega`` in (0, 2)."""

    omega: float = fields.real(1.0, "1", 0.0, 2.0, "over-relaxation, < 2", above=True)

    def __post_init__(self) -> None:
        fields.check(self, "solver")
        if self.omega == 2.0:
            raise InvalidInput("solver.omega", self.omega, "a finite number > 0 and < 2", "2 never converges")

    def arrange(self, problem: Problem) -> Arrangement:
        """Bind everything; raises `InvalidInput` where a constraint cannot be averaged."""
        settings = problem.settings
        if problem.particles is None:
            raise _refusal("gauss_seidel here", "it moves particles, and there are none")
        for batch in problem.batches:
            if not is_empty(batch):
                _check(batch)
        n, dtype = problem.particles.w.shape[0], settings.dtype
        sums = tuple(np.zeros(n, dtype=dtype) for _ in problem.particles.x)
        solver = Averaged(int(settings.iterations), dtype.type(self.omega), sums, np.zeros(n, dtype=np.int64))
        return Arrangement(solver, problem.particles, bind_laws(problem))


def _check(batch: Any) -> None:
    """Refuse a batch whose corrections cannot be averaged, with the reason."""
    kind, law = type(batch).__name__, getattr(batch, "law", None)
    if law is None or hasattr(batch, "project") or not hasattr(batch, "evaluate"):
        raise _refusal("gauss_seidel here", f"{kind} projects itself, so its corrections cannot be averaged")
    if isinstance(law, Compliance) and not (law.is_rigid and law.relation == "equality"):
        reason = "a compliant or clamped multiplier of XPBD is no longer the correction once that is averaged"
        raise _refusal("gauss_seidel here, or constraints with Stiffness", reason)


def _refusal(allowed: str, reason: str) -> InvalidInput:
    return InvalidInput("settings.solver", "jacobi", allowed, reason)


class Averaged(NamedTuple):
    """The kernel's solver: ``sums`` (store of (n,)) of corrections [m] and their ``touched`` (n,), work arrays."""

    iterations: int
    omega: float
    sums: Store
    touched: np.ndarray

    def solve(self, batches, state, h):
        for _ in range(self.iterations):
            clear(self)
            gather(batches, self, state, h)
            settle(batches, self, state)
            apply(self, state.particles)


@device
def clear(work):
    for i in range(work.touched.shape[0]):
        work.touched[i] = 0
        for k in range(len(work.sums)):
            work.sums[k][i] = 0.0


@stage(needs="law")
def gather(batch, work, state, h):
    """Add up the corrections of a batch, all at the present p, and count them."""
    particles = state.particles
    for c in range(size(batch)):
        row = evaluate(batch, c, particles.p)
        change = increment(batch.law, c, row, particles, h)
        if touches(batch.law, row[1], change):
            indices, _, gradients, _ = row
            for j in range(len(indices)):
                i = indices[j]
                work.touched[i] += 1
                accumulate(work.sums, i, particles.w[i] * change, gradients[j])
    state.work[0] += size(batch)


def touches(law: Any, value: float, change: float) -> bool:
    """Whether a constraint of that value counts: its relation is violated, or, of a law without one, it moved."""
    return violated(law.relation, value) if hasattr(law, "relation") else change != 0.0


@typed(touches)
def _touches(law: Any, value: Any, change: Any) -> Any:
    if "relation" in law.fields:
        return lambda law, value, change: violated(law.relation, value)
    return lambda law, value, change: change != 0.0


@device
def share(work, i):
    """omega / n_i."""
    return work.omega / like(work.omega, work.touched[i])


def settle(batches: tuple, work: Averaged, state: Any) -> None:
    """Contacts remember for friction how much they pushed: only the part of it that is going to be applied."""
    for batch in batches:
        if isinstance(batch, Contact):
            settle_pushes(batch, work, state)


@typed(settle)
def _settle(batches: Any, work: Any, state: Any) -> Any:
    if len(batches) == 0:
        return lambda batches, work, state: None
    if batches[0].instance_class is not Contact:
        return lambda batches, work, state: settle(batches[1:], work, state)

    def first(batches, work, state):
        settle_pushes(batches[0], work, state)
        settle(batches[1:], work, state)

    return first


@device
def settle_pushes(contact, work, state):
    particles = state.particles
    for c in range(size(contact)):
        row = evaluate(contact, c, particles.p)
        if row[1] < 0.0:
            made = -row[1] * inverse_weight(particles.w, row, 1.0, 0.0)
            contact.law.push[c] -= made * (1.0 - share(work, row[0][0]))


@device
def apply(work, particles):
    """p_i <- p_i + (omega / n_i) sum."""
    for i in range(work.touched.shape[0]):
        if work.touched[i] > 0:
            factor = share(work, i)
            for k in range(len(work.sums)):
                particles.p[k][i] += factor * work.sums[k][i]
