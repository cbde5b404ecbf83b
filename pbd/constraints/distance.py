"""Distance: C(p1, p2) = |p1 - p2| - d (PBD 2006, section 3.2 and figure 2)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pbd.arrays import broadcast, indices
from pbd.dispatch import stage
from pbd.errors import InvalidInput
from pbd.intrinsics import multiply_add
from pbd.jit import device
from pbd.roots import inverse_root
from pbd.state import Particles
from pbd.stiffness import Compliance, Stiffness
from pbd.vector import at, dot, from_store, like, load, negate, scale, subtract


@stage(required=True)
def pair(pairs, c):
    """The two particles of constraint c."""


@stage
def measure(pairs, squared, rest):
    """(length - rest, 1/length) of a difference of that squared length; the inverse of 0 is 0."""
    length = math.sqrt(squared)
    return length - rest, reciprocal(length)


@device
def reciprocal(length):
    return like(length, 1.0) / length if length > 0.0 else like(length, 0.0)


class Pairs(NamedTuple):
    """Any particles i with any j: arrays of shape (m,), unsigned so that no index can mean "from the end"."""

    i: np.ndarray
    j: np.ndarray

    def pair(self, c):
        return self.i[c], self.j[c]

    def as_array(self, count: int) -> np.ndarray:
        return np.column_stack([self.i, self.j]).astype(np.int64)


class Path(NamedTuple):
    """Particle first + c with the next one: the compiler keeps their common particle in registers (15 % of a step)."""

    first: np.uint64

    def pair(self, c):
        i = self.first + np.uint64(c)
        return i, i + np.uint64(1)

    def as_array(self, count: int) -> np.ndarray:
        i = int(self.first) + np.arange(count)
        return np.column_stack([i, i + 1])


class Shifted(NamedTuple):
    """Particle i + c with j + c: unit-stride, and so independent that lengths are best found by arithmetic.

    All is unsigned, c too: a signed index might count from the end, which no vector loop can allow for.
    """

    i: np.uint64
    j: np.uint64

    def pair(self, c):
        return self.i + c, self.j + c

    def measure(self, squared, rest):
        inverse = inverse_root(squared)
        return multiply_add(squared, inverse, -rest), inverse


class Distance(NamedTuple):
    """``pairs``, of one of the kinds above, kept at ``rest`` [m] from each other, an array or a `Constant`."""

    pairs: Any
    rest: Any
    law: Any

    def size(self):
        return self.rest.shape[0]

    def evaluate(self, c, x):
        """grad_1 C = n = (p1 - p2)/|p1 - p2|, grad_2 C = -n, both of norm 1.

        Limit: coincident points have no direction; n is then 0, and the pair is left as it is.
        """
        i, j = pair(self.pairs, c)
        difference = subtract(load(x, i), load(x, j))
        value, inverse = measure(self.pairs, dot(difference, difference), at(self.rest, c))
        normal = scale(inverse, difference)
        return (i, j), value, (normal, negate(normal)), (1.0, 1.0)

    def weights(self, w: np.ndarray) -> np.ndarray:
        """(m,) W = w_i + w_j [1/kg]: gradients have norm 1, so it never changes."""
        return w[self.pairs.as_array(self.size())].sum(axis=1)

    def renumbered(self, slot: np.ndarray) -> Distance:
        """The same for particles that now stand in ``slot``."""
        return self._replace(pairs=_select_pairs(slot[self.pairs.as_array(self.size())]))


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
