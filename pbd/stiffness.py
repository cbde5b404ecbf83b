"""How stiffly a constraint is enforced: the laws that a user chooses, and their conversions.

A law here is plain data; `bind` turns it into the kernel's law (`pbd.projection`) once the number of
constraints and of iterations is known, and picks the cheapest: k = 1 costs no multiplication, a
PBD law holds no multiplier, compliance without damping computes no velocity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from pbd.errors import InvalidInput, unknown
from pbd.projection import AtLeast, AtMost, Compliant, DampedCompliant, Equality, Hard, Scaled

RELATIONS: dict[str, Any] = {"equality": Equality(), "at_least": AtLeast(), "at_most": AtMost()}
"""C = 0; C >= 0; C <= 0. For a distance: rod; strut that only keeps apart; rope that only holds together."""


def corrected(k: Any, iterations: int) -> Any:
    """k' = 1 - (1 - k)^(1/n_s): after n_s iterations the residual of ONE constraint is 1 - k.

    Source: Mueller et al. 2006, section 3.3. Limits: a chain's residual still depends (a little) on n_s,
    and every k-law depends on the time step.
    """
    return -np.expm1(np.log1p(-np.minimum(k, 1.0 - 1e-300)) / iterations) if iterations != 1 else k


def stiffness_of_compliance(compliance: Any, weight: Any, dt: float) -> np.ndarray:
    """The PBD k whose single projection equals XPBD's first: k = W / (W + alpha/dt^2).

    weight W = sum_j w_j |grad_j C|^2 [1/kg for a distance], compliance alpha [m/N], dt [s]; k = 1 where
    nothing can move.
    """
    total = np.asarray(weight + compliance / dt**2, dtype=float)
    return np.divide(weight, total, out=np.ones_like(total), where=total > 0.0)


@dataclass(frozen=True)
class Stiffness:
    """PBD stiffness k in [0, 1] with k' = 1-(1-k)^(1/n_s); ``raw`` applies k itself in each iteration."""

    k: Any = 1.0
    relation: str = "equality"
    raw: bool = False

    def __post_init__(self) -> None:
        _relation(self.relation)
        _range("stiffness.k", self.k, 0.0, 1.0, "a number in [0, 1]")

    def bind(self, count: int, iterations: int) -> Any:
        """The kernel's law for ``count`` constraints under ``iterations`` iterations."""
        relation = RELATIONS[self.relation]
        k = _per_constraint("stiffness.k", self.k, count)
        if np.all(k == 1.0):
            return Hard(relation)
        if not self.raw:
            k = np.where(k == 1.0, 1.0, corrected(k, iterations))
        return Scaled(relation, k)


@dataclass(frozen=True)
class Compliance:
    """XPBD compliance alpha >= 0 [m/N for a distance] and damping stiffness beta >= 0 [N s/m].

    Source: Macklin et al. 2016, equations 18 and 26. alpha = 0 is rigid, and then beta has no effect.
    """

    alpha: Any = 0.0
    beta: Any = 0.0
    relation: str = "equality"

    def __post_init__(self) -> None:
        _relation(self.relation)
        _range("compliance.alpha", self.alpha, 0.0, math.inf, "finite and >= 0 m/N")
        _range("compliance.beta", self.beta, 0.0, math.inf, "finite and >= 0 N s/m")

    def bind(self, count: int, iterations: int) -> Any:
        """The kernel's law for ``count`` constraints; XPBD needs no number of iterations."""
        relation = RELATIONS[self.relation]
        alpha = _per_constraint("compliance.alpha", self.alpha, count)
        beta = _per_constraint("compliance.beta", self.beta, count)
        if np.any(alpha * beta > 0.0):
            return DampedCompliant(relation, alpha, beta, np.zeros(count))
        return Compliant(relation, alpha, np.zeros(count))


def _relation(name: str) -> None:
    if name not in RELATIONS:
        raise unknown("relation", name, RELATIONS)


def _range(field: str, values: Any, low: float, high: float, allowed: str) -> None:
    array = np.asarray(values, dtype=np.float64)
    bad = array[~((array >= low) & (array <= high) & np.isfinite(array))]
    if bad.size:
        raise InvalidInput(field, float(bad.flat[0]), allowed)


def _per_constraint(field: str, values: Any, count: int) -> np.ndarray:
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (count,)):
        raise InvalidInput(field, array.shape, f"one number or an array of shape ({count},)")
    return np.broadcast_to(array, (count,)).copy()
