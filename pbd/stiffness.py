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

from pbd.arrays import real_array
from pbd.errors import InvalidInput, unknown
from pbd.projection import (
    AtLeast,
    AtMost,
    Compliant,
    DampedCompliant,
    Equality,
    Hard,
    Scaled,
    Weighted,
    WeightedCompliant,
)

RELATIONS: dict[str, Any] = {"equality": Equality(), "at_least": AtLeast(), "at_most": AtMost()}
"""C = 0; C >= 0; C <= 0. For a distance: rod; strut that only keeps apart; rope that only holds together."""


def corrected(k: Any, iterations: int) -> Any:
    """k' = 1 - (1 - k)^(1/n_s): after n_s iterations the residual of ONE constraint is 1 - k.

    Source: Mueller et al. 2006, section 3.3. Limits: a chain's residual still depends (a little) on n_s,
    and every k-law depends on the time step.
    """
    if iterations == 1:
        return k
    with np.errstate(divide="ignore"):  # k = 1 gives -inf, and then 1 as it should
        return -np.expm1(np.log1p(-np.asarray(k, dtype=np.float64)) / iterations)


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
        object.__setattr__(self, "k", _values("stiffness.k", self.k, 1.0, "a number in [0, 1]"))

    @property
    def is_rigid(self) -> bool:
        """Whether the constraints hold exactly once their projection has converged."""
        return bool(np.all(np.asarray(self.k) == 1.0))

    def bind(self, count: int, iterations: int, weight: np.ndarray | None = None, h: float = math.nan) -> Any:
        """The kernel's law for ``count`` constraints under ``iterations`` iterations.

        ``weight`` (m,) is their W = sum_j w_j |g_j|^2 [1/kg] where it never changes; h is not used.
        """
        relation = RELATIONS[self.relation]
        k = _per_constraint("stiffness.k", self.k, count)
        applied = k if self.raw else corrected(k, iterations)
        if weight is not None:
            return Weighted(relation, applied * _inverse(weight, weight))
        return Hard(relation) if self.is_rigid else Scaled(relation, applied)


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
        object.__setattr__(self, "alpha", _values("compliance.alpha", self.alpha, math.inf, "finite and >= 0 m/N"))
        object.__setattr__(self, "beta", _values("compliance.beta", self.beta, math.inf, "finite and >= 0 N s/m"))

    @property
    def is_rigid(self) -> bool:
        """Whether the constraints hold exactly once their projection has converged."""
        return bool(np.all(np.asarray(self.alpha) == 0.0))

    def bind(self, count: int, iterations: int, weight: np.ndarray | None = None, h: float = math.nan) -> Any:
        """The kernel's law for ``count`` constraints; XPBD needs no number of iterations.

        ``weight`` (m,) is their W = sum_j w_j |g_j|^2 [1/kg] where it never changes, h the sub-step [s] then.
        """
        relation = RELATIONS[self.relation]
        alpha = _per_constraint("compliance.alpha", self.alpha, count)
        beta = _per_constraint("compliance.beta", self.beta, count)
        if np.any(alpha * beta > 0.0):
            return DampedCompliant(relation, alpha, beta, np.zeros(count))
        if weight is not None:
            scaled = alpha / h**2
            return WeightedCompliant(relation, scaled, _inverse(weight + scaled, weight), np.zeros(count))
        return Compliant(relation, alpha, np.zeros(count))


def _inverse(total: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """1 / total; 0 where the weight is 0, because nothing can move there."""
    return np.divide(1.0, total, out=np.zeros_like(total), where=weight > 0.0)


def _relation(name: str) -> None:
    if name not in RELATIONS:
        raise unknown("relation", name, RELATIONS)


def _values(field: str, values: Any, high: float, allowed: str) -> float | np.ndarray:
    """One number, or an own array of them, checked to be finite and in [0, high]."""
    try:
        array = real_array(field, values)
    except InvalidInput as error:
        raise InvalidInput(error.field, error.value, allowed) from None
    bad = array[~((array >= 0.0) & (array <= high))]
    if bad.size:
        raise InvalidInput(field, float(bad.flat[0]), allowed)
    return array if array.ndim else float(array)


def _per_constraint(field: str, values: Any, count: int) -> np.ndarray:
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (count,)):
        raise InvalidInput(field, array.shape, f"one number or an array of shape ({count},)")
    return np.broadcast_to(array, (count,)).copy()
