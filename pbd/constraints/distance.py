"""Distance: C(p1, p2) = |p1 - p2| - d (PBD 2006, section 3.2 and figure 2)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pbd.arrays import broadcast, indices
from pbd.dispatch import stage
from pbd.errors import InvalidInput
from pbd.state import Particles
from pbd.stiffness import Compliance, Stiffness
from pbd.vector import dot, from_store, load, scale, subtract


@stage(required=True)
def pair(pairs, c):
    """The two particles of constraint c."""


class Pairs(NamedTuple):
    """Any particles i with any j: arrays of shape (m,), unsigned so that no index can mean "from the end"."""

    i: np.ndarray
    j: np.ndarray

    def pair(self, c):
        return self.i[c], self.j[c]


class Path(NamedTuple):
    """Particle first + c with the next one: the compiler keeps their common particle in registers (15 % of a step)."""

    first: np.uint64

    def pair(self, c):
        i = self.first + np.uint64(c)
        return i, i + np.uint64(1)


class Distance(NamedTuple):
    """``pairs`` kept at ``rest`` (m,) [m] from each other."""

    pairs: Pairs | Path
    rest: np.ndarray
    law: Any

    def size(self):
        return self.rest.shape[0]

    def evaluate(self, c, x):
        """grad_1 C = n = (p1 - p2)/|p1 - p2|, grad_2 C = -n, both of norm 1.

        Limit: coincident points have no direction; n is then 0, and the pair is left as it is.
        """
        i, j = pair(self.pairs, c)
        difference = subtract(load(x, i), load(x, j))
        length = math.sqrt(dot(difference, difference))
        normal = scale(1.0 / length if length > 0.0 else 0.0, difference)
        return (i, j), length - self.rest[c], (normal, scale(-1.0, normal)), (1.0, 1.0)


def distance(
    particles: Particles, pairs: Any, *, rest_length: Any = None, law: Stiffness | Compliance | None = None
) -> Distance:
    """A batch of distance constraints; pairs of two pinned particles are dropped.

    Parameters
    ----------
    particles : the group that the indices refer to
    pairs : (m, 2) particle indices
    rest_length : (m,) or one number [m], > 0; the present distance where not given
    law : `Stiffness` (default, k = 1) or `Compliance`

    Raises
    ------
    InvalidInput : an index outside [0, n), a pair of one particle with itself, a length that is not > 0
    """
    index = indices("pairs", pairs, particles.w.shape[0])
    if index.size == 0:
        index = index.reshape(0, 2)
    if index.ndim != 2 or index.shape[1] != 2:
        raise InvalidInput("pairs", index.shape, "of shape (m, 2)")
    if np.any(index[:, 0] == index[:, 1]):
        raise InvalidInput("pairs", int(index[index[:, 0] == index[:, 1]][0, 0]), "of two different particles")
    rest = _rest_lengths(particles, index, rest_length)
    moves = particles.w[index].sum(axis=1) > 0.0
    law = _select(law or Stiffness(), moves)
    return Distance(_select_pairs(index[moves]), rest[moves], law)


def _select_pairs(index: np.ndarray) -> Pairs | Path:
    """The cheapest form that holds the (m, 2) pairs."""
    i, j = index.T
    if len(i) and np.array_equal(i, i[0] + np.arange(len(i))) and np.array_equal(j, i + 1):
        return Path(np.uint64(i[0]))
    return Pairs(i.astype(np.uint64), j.astype(np.uint64))


def _rest_lengths(particles: Particles, index: np.ndarray, rest_length: Any) -> np.ndarray:
    if rest_length is None:
        x = from_store(particles.x)
        rest = np.linalg.norm(x[index[:, 0]] - x[index[:, 1]], axis=1)
    else:
        rest = broadcast("rest_length", rest_length, (len(index),))
    if len(rest) and not rest.min() > 0.0:
        c = int(np.argmin(rest))
        raise InvalidInput(f"rest_length[{c}]", float(rest[c]), "> 0 m", "a zero-length link has no direction")
    return rest


def _select(law: Any, kept: np.ndarray) -> Any:
    """The law without the entries of dropped constraints."""
    arrays = {name: value for name, value in vars(law).items() if isinstance(value, np.ndarray)}
    for name, value in arrays.items():
        if value.shape != kept.shape:
            raise InvalidInput(name, value.shape, f"one number or an array of shape {kept.shape}, one for each pair")
    return type(law)(**{**vars(law), **{name: value[kept] for name, value in arrays.items()}})
