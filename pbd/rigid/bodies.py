"""Rigid bodies: the second state group of the step loop.

The last row of every array stands for the ground, which nothing moves: a contact with a fixed plane is then a contact
of two bodies like any other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pbd.arrays import broadcast, indices, number, real_array
from pbd.errors import InvalidInput
from pbd.rigid.turning import AXES, move_and_turn, set_turn
from pbd.state import MIN_MASS, all_finite
from pbd.vector import Store, aligned, from_store, to_store, zeros

BOX, BALL = 0, 1
MAX_BODIES = 10_000_000
MAX_SIZE = 1e9
"""[m] Also of a radius."""

COLUMNS = {2: 8, 3: 16}
"""Dimension -> columns of `Bodies.motion`: one cache line, or two."""

UNIT = 1e-6
"""A given quaternion may be so far from length 1."""


@dataclass(frozen=True)
class Box:
    """A solid box of uniform density; ``size`` (d,) are its edges [m] along the axes of its frame."""

    size: tuple[float, ...]

    def checked(self, field: str, dimension: int) -> np.ndarray:
        """(d,) half extents [m]; raises `InvalidInput` for sizes that are not > 0."""
        size = real_array(f"{field}.size", self.size)
        if size.shape != (dimension,):
            raise InvalidInput(f"{field}.size", self.size, f"{dimension} edges [m]")
        if not (size.min() > 0.0 and size.max() <= MAX_SIZE):
            raise InvalidInput(f"{field}.size", self.size, f"> 0 and <= {MAX_SIZE:g} m")
        return 0.5 * size

    def inertia(self, mass: float, dimension: int) -> np.ndarray:
        """About the centre [kg m^2]: (1,) in 2D, (3,) along the axes of its frame in 3D."""
        squares = np.square(np.asarray(self.size, dtype=float))
        return mass / 12.0 * (squares.sum(keepdims=True) if dimension == 2 else squares.sum() - squares)


@dataclass(frozen=True)
class Ball:
    """A solid disc in 2D or sphere in 3D, of uniform density and ``radius`` [m]."""

    radius: float

    def checked(self, field: str, dimension: int) -> np.ndarray:
        """(d,) times the radius [m]; raises `InvalidInput` for one that is not > 0."""
        allowed = f"> 0 and <= {MAX_SIZE:g} m"
        return np.full(dimension, number(f"{field}.radius", self.radius, np.nextafter(0.0, 1.0), MAX_SIZE, allowed))

    def inertia(self, mass: float, dimension: int) -> np.ndarray:
        """About the centre [kg m^2]: (1,) in 2D, (3,) in 3D."""
        return np.full(AXES[dimension], (0.5 if dimension == 2 else 0.4) * mass * self.radius**2)


class BodyRecording(NamedTuple):
    """Samples of bodies: stores of arrays (samples, n) of centres, velocities, turns and spins.

    load : store of arrays (samples, 1), the sum of all planes' forces on them
    """

    x: Store
    v: Store
    turn: Store
    spin: Store
    load: Store


class BodyMotion(NamedTuple):
    """Samples of bodies in the user's layout.

    positions, velocities : (s, n, d) of the centres [m], [m/s]
    orientations : (s, n) angles [rad] in 2D, (s, n, 4) unit quaternions (w, x, y, z) in 3D
    spins : (s, n) [rad/s] in 2D, (s, n, 3) about the world's axes in 3D
    loads : (s, d) sum of all planes' forces on the bodies [N], at the end of the last sub-step
    """

    positions: np.ndarray
    velocities: np.ndarray
    orientations: np.ndarray
    spins: np.ndarray
    loads: np.ndarray


class Bodies(NamedTuple):
    """n bodies and, as row n, the ground.

    x : store of the centres [m]
    turn : the angle [rad], or the unit quaternion w, x, y, z
    motion (n + 1, 8 or 16) : what a contact reads and writes, a cache line or two a body: velocity [m/s], spin [rad/s]
        (in 3D about the world's axes), 1/m [1/kg], and the inverse inertia [1/(kg m^2)] in the world's frame
    frame (n + 1, 2 or 9) : the rotation: cos and sin, or the matrix by rows
    half : half extents [m]; of a ball its radius
    radius : of the bounding ball [m]
    kind : BOX or BALL
    inertia : principal moments [kg m^2], of one or three axes; 0 for what cannot turn
    """

    x: Store
    turn: Store
    motion: np.ndarray
    frame: np.ndarray
    half: Store
    radius: np.ndarray
    kind: np.ndarray
    inertia: Store

    def new_recording(self, samples: int) -> BodyRecording:
        """An empty recording (called by Python, not by kernels)."""
        shape, d = (samples, len(self.radius) - 1), len(self.x)
        x, v, turn, spin = (zeros(shape, count) for count in (d, d, len(self.turn), AXES[d]))
        return BodyRecording(x, v, turn, spin, zeros((samples, 1), d))

    def from_recording(self, recording: BodyRecording, samples: int) -> BodyMotion:
        """The first so many samples (called by Python, not by kernels)."""
        x, v, turn, spin, load = (from_store(store)[:samples] for store in recording)
        if len(self.x) == 2:
            turn, spin = turn[..., 0], spin[..., 0]
        return BodyMotion(x, v, turn, spin, load[:, 0])

    def kick(self, acceleration, h):
        d = len(self.x)
        mass = 3 * (d - 1)
        for i in range(self.radius.shape[0] - 1):
            if self.motion[i, mass] > 0.0:
                for k in range(d):
                    self.motion[i, k] += h * acceleration[k]

    def drift(self, h):
        move_and_turn(self, h)

    def record(self, recording, k):
        for axis in range(len(self.x)):
            for i in range(self.radius.shape[0] - 1):
                recording.x[axis][k, i] = self.x[axis][i]
                recording.v[axis][k, i] = self.motion[i, axis]
        for axis in range(len(self.turn)):
            for i in range(self.radius.shape[0] - 1):
                recording.turn[axis][k, i] = self.turn[axis][i]
        for axis in range(len(recording.spin)):
            for i in range(self.radius.shape[0] - 1):
                recording.spin[axis][k, i] = self.motion[i, len(self.x) + axis]

    def not_finite(self):
        for axis in range(len(self.x)):
            if not all_finite(self.x[axis]):
                return 1
        for axis in range(len(self.turn)):
            if not all_finite(self.turn[axis]):
                return 1
        total = 0.0
        for i in range(self.motion.shape[0]):
            for k in range(self.motion.shape[1]):
                total += self.motion[i, k] - self.motion[i, k]
        return 0 if total == 0.0 else 2


def bodies(
    shapes: Sequence[Box | Ball],
    positions: Any,
    *,
    masses: Any = 1.0,
    orientations: Any = None,
    velocities: Any = 0.0,
    spins: Any = 0.0,
    fixed: Sequence[int] = (),
) -> Bodies:
    """Rigid bodies from arrays in the user's layout; everything is copied.

    Parameters
    ----------
    shapes : n of `Box` or `Ball`, solid and of uniform density
    positions : (n, d) centres of mass [m], d 2 or 3
    masses : (n,) or one number [kg], > 0
    orientations : (n,) angles [rad] in 2D, (n, 4) unit quaternions (w, x, y, z) in 3D; default unturned
    velocities : (n, d) or one number [m/s]
    spins : (n,) [rad/s] in 2D, (n, 3) about the world's axes in 3D, or one number
    fixed : indices of bodies that nothing moves

    Raises
    ------
    InvalidInput : a value outside its range, an index outside [0, n), a shape that does not fit
    """
    x = real_array("positions", positions)
    if x.ndim != 2 or x.shape[1] not in (2, 3):
        raise InvalidInput("positions", x.shape, "of shape (n, d) with d = 2 or 3")
    n, d = x.shape
    if not isinstance(shapes, Sequence) or not all(isinstance(shape, Box | Ball) for shape in shapes):
        raise InvalidInput("shapes", type(shapes).__name__, "a list of pbd.Box and pbd.Ball")
    if n > MAX_BODIES or len(shapes) != n:
        raise InvalidInput("shapes", len(shapes), f"{n}, one for each position, at most {MAX_BODIES}")
    m = broadcast("masses", masses, (n,))
    if n and not m.min() >= MIN_MASS:
        raise InvalidInput("masses", float(m.min()), "> 0 kg", "list immovable bodies in fixed")
    held = indices("fixed", fixed, n)
    half = np.array([shape.checked(f"shapes[{i}]", d) for i, shape in enumerate(shapes)]).reshape(n, d)
    kind = np.array([BALL if isinstance(shape, Ball) else BOX for shape in shapes], dtype=np.int64)
    inertia = np.array([s.inertia(mass, d) for s, mass in zip(shapes, m, strict=True)]).reshape(n, AXES[d])
    motion = np.zeros((n + 1, COLUMNS[d]))
    motion[:n, :d] = broadcast("velocities", velocities, (n, d))
    motion[:n, d : d + AXES[d]] = broadcast("spins", spins, (n, AXES[d]) if d == 3 else (n,)).reshape(n, AXES[d])
    motion[:n, d + AXES[d]] = 1.0 / m
    motion[held] = 0.0
    made = Bodies(
        x=to_store(np.vstack([x, np.zeros((1, d))])),
        turn=to_store(np.zeros((n + 1, {2: 1, 3: 4}[d]))),
        motion=aligned(motion),
        frame=np.zeros((n + 1, {2: 2, 3: 9}[d])),
        half=to_store(np.vstack([half, np.zeros((1, d))])),
        radius=np.append(np.where(kind == BALL, half[:, 0], np.linalg.norm(half, axis=1)), 0.0),
        kind=np.append(kind, BOX),
        inertia=to_store(np.vstack([inertia, np.ones((1, AXES[d]))])),
    )
    _orient(made, orientations)
    return made


def _orient(made: Bodies, orientations: Any) -> None:
    """Set all turns, and what follows from them."""
    n, d = len(made.radius) - 1, len(made.x)
    if d == 2:
        made.turn[0][:n] = 0.0 if orientations is None else broadcast("orientations", orientations, (n,))
        made.frame[:, 0], made.frame[:, 1] = np.cos(made.turn[0]), np.sin(made.turn[0])
        made.motion[:n, 4] = np.where(made.motion[:n, 3] > 0.0, 1.0 / made.inertia[0][:n], 0.0)
        return
    q = np.tile([1.0, 0.0, 0.0, 0.0], (n + 1, 1))
    if orientations is not None:
        q[:n] = broadcast("orientations", orientations, (n, 4))
    lengths = np.linalg.norm(q, axis=1)
    if not np.allclose(lengths, 1.0, rtol=0.0, atol=UNIT):
        worst = int(np.argmax(np.abs(lengths - 1.0)))
        raise InvalidInput(f"orientations[{worst}]", q[worst].tolist(), "a quaternion of length 1")
    for i in range(n + 1):
        set_turn(made, i, tuple(q[i]))
