"""The two formulations of a serial planar chain in PyBullet, and free point masses.

Angles are those of `comparisons.reference`: from straight down, so that a link points along
u = (sin, -cos), and its far end turns along t = (cos, sin).
"""

from __future__ import annotations

from functools import partial
from typing import Any, Protocol

import numpy as np

from comparisons.scene import Rods, Scene

AXIS = (0.0, 0.0, 1.0)
UNROTATED = (0.0, 0.0, 0.0, 1.0)


class World(Protocol):
    """A chain in a client: its state is (2, q), coordinates and their rates."""

    client: int

    def read(self) -> np.ndarray:
        """The state, in double precision."""

    def write(self, coordinates: np.ndarray, rates: np.ndarray) -> None:
        """Set the state."""

    def ends(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions [m] and velocities [m/s] of the particles, both (s, n, 2), from states (s, 2, q)."""


class Chain:
    """What both formulations share: link lengths [m], the start's angles [rad] and rates [rad/s], the anchor [m]."""

    def __init__(self, client: int, scene: Scene, settings: Any) -> None:
        masses = scene.masses
        steps, rates = np.diff(masses.positions, axis=0), np.diff(masses.velocities, axis=0)
        self.client, self.settings, self.masses = client, settings, masses.masses[1:]
        self.lengths = np.concatenate([np.zeros(0), *(rods.lengths for rods in scene.of(Rods))])
        self.anchor = masses.positions[:1]
        self.angles = np.arctan2(steps[:, 0], -steps[:, 1])
        self.rates = np.sum(rates * directions(self.angles)[1], axis=1) / self.lengths

    def damp(self, change: Any, link: int) -> None:
        change(link, linearDamping=self.settings.damping, angularDamping=self.settings.damping)


def directions(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """u and t, both (..., 2)."""
    s, c = np.sin(angles), np.cos(angles)
    return np.stack([s, -c], axis=-1), np.stack([c, s], axis=-1)


class Articulated(Chain):
    """One multi-body: hinges about z, each mass at the far end of its link, whose own inertia is 0."""

    def __init__(self, client: int, scene: Scene, settings: Any) -> None:
        import pybullet as bullet

        super().__init__(client, scene, settings)
        n, down = len(self.lengths), np.column_stack([0.0 * self.lengths, -self.lengths, 0.0 * self.lengths])
        self.body = bullet.createMultiBody(
            baseMass=0.0,
            basePosition=[*self.anchor[0], 0.0],
            linkMasses=self.masses.tolist(),
            linkCollisionShapeIndices=[-1] * n,
            linkVisualShapeIndices=[-1] * n,
            linkPositions=[[0.0, 0.0, 0.0], *down[:-1].tolist()],
            linkOrientations=[UNROTATED] * n,
            linkInertialFramePositions=down.tolist(),
            linkInertialFrameOrientations=[UNROTATED] * n,
            linkParentIndices=list(range(n)),
            linkJointTypes=[bullet.JOINT_REVOLUTE] * n,
            linkJointAxis=[AXIS] * n,
            physicsClientId=client,
        )
        self.joints = list(range(n))
        change = partial(bullet.changeDynamics, self.body, physicsClientId=client)
        for joint in [-1, *self.joints]:
            self.damp(change, joint)
        change(-1, maxJointVelocity=settings.max_joint_velocity)
        # a hinge has a motor that holds it still, unless its force is 0
        bullet.setJointMotorControlArray(
            self.body, self.joints, bullet.VELOCITY_CONTROL, forces=[0.0] * n, physicsClientId=client
        )
        self.write(np.diff(self.angles, prepend=0.0), np.diff(self.rates, prepend=0.0))
        self._states = partial(bullet.getJointStates, self.body, self.joints, client)

    def read(self) -> np.ndarray:
        return np.array([state[:2] for state in self._states()]).T

    def write(self, coordinates: np.ndarray, rates: np.ndarray) -> None:
        import pybullet as bullet

        for joint, q, rate in zip(self.joints, coordinates, rates):
            bullet.resetJointState(self.body, joint, float(q), float(rate), self.client)

    def ends(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angles, rates = np.cumsum(states, axis=2).swapaxes(0, 1)
        u, t = directions(angles)
        x, v = self.lengths[:, None] * u, (self.lengths * rates)[..., None] * t
        start = np.zeros((len(states), 1, 2))
        x = np.concatenate([start + self.anchor, self.anchor + np.cumsum(x, axis=1)], axis=1)
        return x, np.concatenate([start, np.cumsum(v, axis=1)], axis=1)


class PointToPoint(Chain):
    """Free dumbbell rods in maximal coordinates, with ball joints; coordinates (x, y, angle) of each centre of mass."""

    def __init__(self, client: int, scene: Scene, settings: Any) -> None:
        import pybullet as bullet

        super().__init__(client, scene, settings)
        share = 0.5 * self.masses
        far = np.where(np.arange(len(share)) == len(share) - 1, self.masses, share)
        # the first rod's near mass sits on the anchor and never moves: any number will do
        near = np.concatenate([share[:1], share[:-1]])
        mass = near + far
        self.near = far * self.lengths / mass
        self.far = self.lengths - self.near
        inertia = near * self.near**2 + far * self.far**2
        self._bodies = [self._rod(m, i) for m, i in zip(mass, inertia)]
        self._join()
        # the inertia set above is used from the second step on; until then nothing turns
        bullet.stepSimulation(client)
        u, t = directions(self.angles)
        x, v = scene.masses.positions, scene.masses.velocities
        centres = x[:-1] + self.near[:, None] * u
        rates = v[:-1] + (self.near * self.rates)[:, None] * t
        self.write(np.column_stack([centres, self.angles]).ravel(), np.column_stack([rates, self.rates]).ravel())

    def _rod(self, mass: float, inertia: float) -> int:
        """A body whose origin is its centre of mass, and which hangs straight down when unrotated."""
        import pybullet as bullet

        body = bullet.createMultiBody(
            baseMass=float(mass), baseCollisionShapeIndex=-1, useMaximalCoordinates=1, physicsClientId=self.client
        )
        change = partial(bullet.changeDynamics, body, physicsClientId=self.client)
        # the mass goes with the inertia, or it becomes 0
        change(-1, mass=float(mass), localInertiaDiagonal=[float(inertia)] * 3)
        self.damp(change, -1)
        return body

    def _join(self) -> None:
        import pybullet as bullet

        if not self._bodies:
            return
        anchor = bullet.createMultiBody(
            baseMass=0.0, basePosition=[*self.anchor[0], 0.0], useMaximalCoordinates=1, physicsClientId=self.client
        )
        parents = [anchor, *self._bodies[:-1]]
        pivots = [0.0, *(-self.far[:-1])]
        for parent, body, above, below in zip(parents, self._bodies, pivots, self.near):
            # the moving body comes first: with the world as its child the constraint is not made;
            # its erp is the engine's, and its force unlimited, as changeConstraint does nothing to such bodies
            bullet.createConstraint(
                body,
                -1,
                parent,
                -1,
                bullet.JOINT_POINT2POINT,
                [0.0, 0.0, 0.0],
                [0.0, float(below), 0.0],
                [0.0, float(above), 0.0],
                physicsClientId=self.client,
            )

    def read(self) -> np.ndarray:
        import pybullet as bullet

        rows = np.empty((2, len(self._bodies), 3))
        for i, body in enumerate(self._bodies):
            (x, y, _), (_, _, z, w) = bullet.getBasePositionAndOrientation(body, self.client)
            (vx, vy, _), (_, _, rate) = bullet.getBaseVelocity(body, self.client)
            rows[0, i] = x, y, 2.0 * np.arctan2(z, w)
            rows[1, i] = vx, vy, rate
        return rows.reshape(2, -1)

    def write(self, coordinates: np.ndarray, rates: np.ndarray) -> None:
        import pybullet as bullet

        for body, (x, y, angle), (vx, vy, rate) in zip(self._bodies, coordinates.reshape(-1, 3), rates.reshape(-1, 3)):
            turn = (0.0, 0.0, float(np.sin(0.5 * angle)), float(np.cos(0.5 * angle)))
            bullet.resetBasePositionAndOrientation(body, (float(x), float(y), 0.0), turn, self.client)
            bullet.resetBaseVelocity(body, (float(vx), float(vy), 0.0), (0.0, 0.0, float(rate)), self.client)

    def ends(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        count = len(states)
        centres, rates = states.reshape(count, 2, len(self._bodies), 3).swapaxes(0, 1)
        u, t = directions(centres[..., 2])
        x = centres[..., :2] + self.far[:, None] * u
        v = rates[..., :2] + (self.far * rates[..., 2])[..., None] * t
        pinned = np.zeros((count, len(self.anchor), 2))
        return np.concatenate([pinned + self.anchor, x], axis=1), np.concatenate([pinned, v], axis=1)


class FreeMasses:
    """Point masses without links; coordinates (x, y) of each. Reduced coordinates are the engine's default."""

    def __init__(self, client: int, scene: Scene, settings: Any) -> None:
        import pybullet as bullet

        self.client, self._shape = client, scene.masses.positions.shape
        mass = np.where(scene.masses.free, scene.masses.masses, 0.0)
        is_maximal = settings.formulation == "point_to_point"
        self._bodies = [
            bullet.createMultiBody(
                baseMass=float(m),
                baseCollisionShapeIndex=-1,
                useMaximalCoordinates=int(is_maximal),
                physicsClientId=client,
            )
            for m in mass
        ]
        for body, m in zip(self._bodies, mass):
            change = {"mass": float(m), "linearDamping": settings.damping, "angularDamping": settings.damping}
            bullet.changeDynamics(body, -1, **change, physicsClientId=client)
        self.write(scene.masses.positions.ravel(), scene.masses.velocities.ravel())

    def read(self) -> np.ndarray:
        import pybullet as bullet

        places = [bullet.getBasePositionAndOrientation(body, self.client)[0][:2] for body in self._bodies]
        rates = [bullet.getBaseVelocity(body, self.client)[0][:2] for body in self._bodies]
        return np.array([places, rates]).reshape(2, -1)

    def write(self, coordinates: np.ndarray, rates: np.ndarray) -> None:
        import pybullet as bullet

        for body, x, v in zip(self._bodies, coordinates.reshape(-1, 2), rates.reshape(-1, 2)):
            bullet.resetBasePositionAndOrientation(body, [*map(float, x), 0.0], UNROTATED, self.client)
            bullet.resetBaseVelocity(body, [*map(float, v), 0.0], [0.0, 0.0, 0.0], self.client)

    def ends(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, v = states.reshape(len(states), 2, *self._shape).swapaxes(0, 1)
        return x.copy(), v.copy()
