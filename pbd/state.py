"""The state: groups of arrays. Particles are one group; a scene without a group holds None there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pbd.arrays import broadcast, indices, real_array
from pbd.errors import InvalidInput
from pbd.intrinsics import multiply_add
from pbd.jit import device
from pbd.vector import Store, aligned, like, to_store, zeros

MAX_PARTICLES = 50_000_000
"""About 5 GB of state in 3D; more is refused with this as the reason."""

MIN_MASS = float(np.finfo(np.float64).tiny)
"""[kg] Below it 1/m is infinite."""


WORK = 4
"""Counters of work: projections, unconverged solves, pairs of bodies tested, and pairs there was no room for."""

PAIRS_TESTED, LACKING = 2, 3

SIGNALS = 5
EARLIEST, IMPACTS, CHANGE, SIZE, LEAST = range(SIGNALS)
"""What constraints of bodies tell the integrator and the solver: when the first impact is [s], how many there are; the
squares [J] of a sweep's change of impulses and of the impulses, in the norm of K; and the least gap [m]."""


class Recording(NamedTuple):
    """Samples of one group: stores of arrays of shape (samples, n)."""

    x: Store
    v: Store


class Particles(NamedTuple):
    """Point masses: positions x [m], predictions p [m], velocities v [m/s], inverse masses w [1/kg].

    w = 0 marks a pinned particle: no force and no constraint moves it; its own velocity does.
    """

    x: Store
    p: Store
    v: Store
    w: np.ndarray

    def new_recording(self, samples: int) -> Recording:
        """An empty recording (called by Python, not by kernels)."""
        shape = (samples, self.w.shape[0])
        return Recording(zeros(shape, len(self.x)), zeros(shape, len(self.x)))

    def kick(self, acceleration, h):
        for k in range(len(self.v)):
            if acceleration[k] != 0.0:
                kick_axis(self.v[k], self.w, h * acceleration[k])

    def predict(self, h):
        for k in range(len(self.x)):
            predict_axis(self.p[k], self.x[k], self.v[k], h)

    def update(self, h):
        for k in range(len(self.x)):
            update_axis(self.x[k], self.v[k], self.p[k], like(h, 1.0) / h)

    def record(self, recording, k):
        for axis in range(len(self.x)):
            copy_row(recording.x[axis], k, self.x[axis])
            copy_row(recording.v[axis], k, self.v[axis])

    def not_finite(self):
        for k in range(len(self.x)):
            if not all_finite(self.x[k]):
                return 1
            if not all_finite(self.v[k]):
                return 2
        return 0


class State(NamedTuple):
    """All groups, and the counters of work done.

    ``work`` (WORK,) counts constraint projections, and solves that did not converge. ``bodies`` is a second
    group of any class with the group stages of `pbd.stages`, or None. ``signals`` (SIGNALS,) are set in a sub-step.
    """

    particles: Particles | None
    bodies: Any
    work: np.ndarray
    signals: np.ndarray = np.zeros(SIGNALS)


@device
def kick_axis(v, w, dv):
    for i in range(v.shape[0]):
        v[i] += dv if w[i] > 0.0 else 0.0


@device
def predict_axis(p, x, v, h):
    for i in range(p.shape[0]):
        p[i] = multiply_add(h, v[i], x[i])


@device
def update_axis(x, v, p, inverse_h):
    for i in range(x.shape[0]):
        v[i] = (p[i] - x[i]) * inverse_h
        x[i] = p[i]


@device
def copy_row(rows, k, a):
    for i in range(a.shape[0]):
        rows[k, i] = a[i]


@device
def all_finite(a):
    """True when every element is finite: a - a is 0 for finite a and nan otherwise."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] - a[i]
    return total == 0.0


def _refuse_too_many(shape: tuple[int, ...]) -> None:
    n, d = shape if len(shape) == 2 else (0, 0)
    if n > MAX_PARTICLES:
        raise InvalidInput(
            "positions", n, f"at most {MAX_PARTICLES} particles", f"{n * (3 * d + 1) * 8 / 1e9:.0f} GB needed"
        )


def particles(positions: Any, *, masses: Any = 1.0, velocities: Any = 0.0, pinned: Sequence[int] = ()) -> Particles:
    """Particles from arrays in the user's layout; everything is copied.

    Parameters
    ----------
    positions : (n, d) [m], d in 1, 2, 3
    masses : (n,) or one number [kg], > 0
    velocities : (n, d) or one number [m/s]
    pinned : indices of particles that nothing moves

    Raises
    ------
    InvalidInput : a value outside its range, an index outside [0, n), a shape that does not fit
    """
    if isinstance(positions, np.ndarray):
        _refuse_too_many(positions.shape)  # before any copy
    x = real_array("positions", positions)
    if x.ndim != 2 or x.shape[1] not in (1, 2, 3):
        raise InvalidInput("positions", x.shape, "of shape (n, d) with d = 1, 2 or 3")
    n, d = x.shape
    _refuse_too_many(x.shape)
    m = broadcast("masses", masses, (n,))
    if n and not m.min() >= MIN_MASS:
        raise InvalidInput("masses", float(m.min()), "> 0 kg", "list immovable particles in pinned")
    w = 1.0 / m
    w[indices("pinned", pinned, n)] = 0.0
    store = to_store(x)
    return Particles(
        store,
        tuple(aligned(axis) for axis in store),
        to_store(broadcast("velocities", velocities, (n, d))),
        aligned(w),
    )
