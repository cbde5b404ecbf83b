"""The world of a scene of rigid bodies in PyBullet.

A half-space is a fixed box whose edges are farther away than anything gets: on the engine's own plane a flat box
rebounds to a wrong height. Shapes are thicker by `SKIN`, as boxes that are apart by round-off would fall freely for a
step. Friction and restitution multiply: with the square root of the scene's on all, each pair has the scene's.

A planar scene lies in z = 0. Boxes are as deep as long. Discs are capsules along z: a pile of spheres buckles, and
cylinders touch less exactly. Turning about x and y is blocked by infinite inertia: 0 in maximal coordinates, where
Bullet takes it for infinite, and `HEAVY` in reduced ones, where 0 blocks all three axes. Friction along z is switched
off: it multiplies round-off, and without it nothing pushes out of the plane.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from comparisons.bodies import Ball, Bodies, Box
from comparisons.scene import Scene

HEAVY = 1e30
"""Moment of inertia [kg m^2] about an axis about which nothing turns."""

SKIN = 1e-10
"""By which shapes are thicker on each side [m]; inertia is the scene's."""

DEFAULT_FILTER = 1, -1
"""Collision group and mask of a body that moves."""

RESTING = {"contactProcessingThreshold": 1e30}, {"splitImpulsePenetrationThreshold": -0.04}
BOUNCING = {"contactProcessingThreshold": 0.0}, {"splitImpulsePenetrationThreshold": 0.0}
RECIPES = {"rest": RESTING, "bounce": BOUNCING}
"""What each recipe sets of a body, and of the world; rest has the engine's own."""


class BodyWorld:
    """The bodies in a client, in the scene's order.

    States are (n, 13): position, quaternion (x, y, z, w), velocity, spin, all in space; ``start`` is the scene's.
    """

    def __init__(self, client: int, scene: Scene, settings: Any) -> None:
        assert scene.bodies is not None
        self.client, self.scene, self.settings, self.bodies = client, scene, settings, scene.bodies
        self.is_planar = len(scene.gravity) == 2
        self.is_maximal = settings.formulation != "articulated"
        self.start = embedded(self.bodies)
        self._tune()
        self.take_over()
        # half-spaces come first: of a pair the engine tells the force on the one that was made first
        self.planes = self._half_spaces()
        self._ids = self._make()
        self._settle_inertia()
        self.write(self.start)

    def take_over(self) -> None:
        """Set what one process has once for all clients, and any may have changed; before stepping."""
        import pybullet as bullet

        bullet.setPhysicsEngineParameter(
            contactBreakingThreshold=self.settings.contact_breaking, physicsClientId=self.client
        )

    def read(self) -> np.ndarray:
        """The state, in double precision."""
        import pybullet as bullet

        place, rate, client = bullet.getBasePositionAndOrientation, bullet.getBaseVelocity, self.client
        placed = np.array([[*x, *q] for x, q in (place(body, client) for body in self._ids)])
        return np.hstack([placed, np.array([[*v, *w] for v, w in (rate(body, client) for body in self._ids)])])

    def write(self, states: np.ndarray) -> None:
        """Set the state."""
        import pybullet as bullet

        for body, row in zip(self._ids, states.tolist(), strict=True):
            bullet.resetBasePositionAndOrientation(body, row[:3], row[3:7], self.client)
            bullet.resetBaseVelocity(body, row[7:10], row[10:], self.client)

    def force(self) -> float:
        """Magnitude of the sum of the forces on the half-spaces, friction included, in the last step [N]."""
        import pybullet as bullet

        total = np.zeros(3)
        for plane in self.planes:
            for contact in bullet.getContactPoints(bodyA=plane, physicsClientId=self.client):
                push, *tangential = contact[9:14]
                total += np.array([push, *tangential[::2]]) @ np.array([contact[7], *tangential[1::2]])
        return float(np.linalg.norm(total))

    def _tune(self) -> None:
        import pybullet as bullet

        bullet.setGravity(*in_space(self.scene.gravity), physicsClientId=self.client)
        bullet.setPhysicsEngineParameter(
            **RECIPES[self.settings.contact][1],
            restitutionVelocityThreshold=self.settings.restitution_threshold,
            contactSlop=self.settings.contact_slop,
            warmStartingFactor=self.settings.warm_starting,
            deterministicOverlappingPairs=1,
            physicsClientId=self.client,
        )

    def _half_spaces(self) -> list[int]:
        planes, size = self.scene.planes, reach(self.scene)
        if planes is None:
            return []
        index = self._shape(Box((2.0 * size,) * len(self.scene.gravity)))
        middle, made = self.bodies.positions.mean(axis=0), []
        for normal, offset in zip(planes.normals, planes.offsets, strict=True):
            centre = middle - (normal @ middle - offset + size) * normal
            made += self._add(index, 0.0, [centre], upright(normal))
            self._change(made[-1], collisionMargin=0.0)
        return made

    def _make(self) -> list[int]:
        """All bodies, those of equal shape that follow each other at once."""
        bodies, made = self.bodies, list[int]()
        kinds = zip(bodies.shapes, bodies.free.tolist(), strict=True)
        for (shape, is_free), run in itertools.groupby(kinds):
            count, index = len(list(run)), self._shape(shape)
            # each in its place: in one place every two would be a pair
            made += self._add(index, float(is_free), bodies.positions[len(made) : len(made) + count])
            if isinstance(shape, Box):
                self._change(made[-1], collisionMargin=0.0)  # of the shape, which they share
        masses, inertias = bodies.masses.tolist(), bodies.inertias.tolist()
        for i in np.flatnonzero(bodies.free):
            self._change(made[i], **self._moving(masses[i], inertias[i]))
            if not self.is_maximal:
                # together with the inertia it would drop the inertia
                self._change(made[i], maxJointVelocity=self.settings.max_joint_velocity)
        return made

    def _moving(self, mass: float, inertia: list[float]) -> dict[str, Any]:
        """What a body that moves is told. The mass goes with the inertia, or it becomes 0."""
        damping, blocked = self.settings.damping, 0.0 if self.is_maximal else HEAVY
        what = {"mass": mass, "linearDamping": damping, "angularDamping": damping}
        if self.is_planar:
            return {**what, "localInertiaDiagonal": [blocked, blocked, *inertia], "anisotropicFriction": [1, 1, 0]}
        return {**what, "localInertiaDiagonal": inertia}

    def _shape(self, shape: Box | Ball) -> int:
        import pybullet as bullet

        if isinstance(shape, Box):
            half = [0.5 * edge + SKIN for edge in (*shape.size, max(shape.size))[:3]]
            return int(bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half, physicsClientId=self.client))
        kind = bullet.GEOM_CAPSULE if self.is_planar else bullet.GEOM_SPHERE
        size = {"radius": shape.radius + SKIN, "height": shape.radius}
        return int(bullet.createCollisionShape(kind, **size, physicsClientId=self.client))

    def _add(self, shape: int, mass: float, places: Any, turn: Any = (0.0, 0.0, 0.0, 1.0)) -> list[int]:
        """Bodies of one shape and orientation, with the scene's surface."""
        import pybullet as bullet

        made = bullet.createMultiBody(
            baseMass=mass,
            baseCollisionShapeIndex=shape,
            baseOrientation=turn,
            batchPositions=[in_space(place) for place in places],
            useMaximalCoordinates=int(self.is_maximal),
            physicsClientId=self.client,
        )
        surface = {"lateralFriction": self.scene.friction**0.5, "restitution": self.scene.restitution**0.5}
        for body in made:
            self._change(body, **surface, **RECIPES[self.settings.contact][0])
        return list(made)

    def _change(self, body: int, **what: Any) -> None:
        import pybullet as bullet

        bullet.changeDynamics(body, -1, **what, physicsClientId=self.client)

    def _settle_inertia(self) -> None:
        """One step without contact: inertia in world axes is used from the step after the one that it is set before."""
        import pybullet as bullet

        self.write(self.start)
        group, mask = DEFAULT_FILTER
        for passing in (0, mask):
            for i in np.flatnonzero(self.bodies.free):
                bullet.setCollisionFilterGroupMask(self._ids[i], -1, group, passing, self.client)
            if not passing:
                bullet.stepSimulation(self.client)


def in_space(vector: np.ndarray) -> list[float]:
    """A vector of the plane or of space, in space."""
    return [*map(float, vector), 0.0][:3]


def embedded(bodies: Bodies) -> np.ndarray:
    """(n, 13) state of the bodies in space: position, quaternion (x, y, z, w), velocity, spin; the fixed at rest."""
    n, d = bodies.positions.shape
    state = np.zeros((n, 13))
    state[:, :d], state[:, 7 : 7 + d] = bodies.positions, bodies.velocities
    if d == 3:
        state[:, 3:7], state[:, 10:] = np.roll(bodies.orientations, -1, axis=1), bodies.spins
    else:
        state[:, 5], state[:, 6] = np.sin(0.5 * bodies.orientations), np.cos(0.5 * bodies.orientations)
        state[:, 12] = bodies.spins
    state[~bodies.free, 7:] = 0.0
    return state


def upright(normal: np.ndarray) -> list[float]:
    """Quaternion (x, y, z, w) that turns an axis of a box onto the normal: y in the plane, z in space."""
    if len(normal) == 2:
        angle = np.arctan2(-normal[0], normal[1])
        return [0.0, 0.0, float(np.sin(0.5 * angle)), float(np.cos(0.5 * angle))]
    x, y, z = normal
    turn = np.array([1.0, 0.0, 0.0, 0.0] if z < 0.0 and x == y == 0.0 else [-y, x, 0.0, 1.0 + z])
    return [float(q) for q in turn / np.linalg.norm(turn)]


def reach(scene: Scene) -> float:
    """Farther from the middle of the bodies than any gets within the scene, by gravity and its own motion [m]."""
    bodies, time = scene.bodies, scene.duration
    assert bodies is not None
    spread = np.linalg.norm(bodies.positions - bodies.positions.mean(axis=0), axis=1).max()
    size = max(radius(shape) for shape in bodies.shapes)
    speed = np.linalg.norm(bodies.velocities, axis=1).max() + size * np.abs(bodies.spins).max()
    return float(2.0 * (spread + size + (speed + np.linalg.norm(scene.gravity) * time) * time))


def radius(shape: Box | Ball) -> float:
    """Of the smallest ball about the centre that holds the shape [m]."""
    return shape.radius if isinstance(shape, Ball) else 0.5 * float(np.linalg.norm(shape.size))
