"""A scene of rigid bodies as a MuJoCo model, and the way back from joint coordinates.

In the plane a body slides along x and y and turns about z, so that nothing leaves the plane; a disc is a sphere, which
touches where the disc would. In space it has a free joint, whose turning rates are along the body's axes.

Contacts are soft: their forces minimise a convex cost, under which an overlap r goes like r'' = -b r' - k r as far as
the impedance d < 1 lets it. What rests sinks by about (1 - d) g / k, what should stick creeps, what slides hops, and
nothing rebounds by Newton's rule. Of two shapes the larger friction counts.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons.bodies import Box, rotations
from comparisons.scene import Scene
from comparisons.trajectory import Trajectory, from_samples

AXES = np.eye(3)

CONTACTS = {"stiff": (2.0, 0.99), "rigid": (4.0, 0.9999)}
"""Time constant [steps], of which MuJoCo makes any less than 2 as much, and impedance at no overlap.

Stiff contacts stop impacts soonest. Rigid ones keep what rests ten times better, and what slides hops less on them.
"""

DEEP, AT_DEEP = 1e-3, 0.9999
"""At this overlap [m] the impedance is the largest that MuJoCo takes."""

IMPRATIO = 100.0
"""How much less than overlaps slip gives way in contacts that are not soft."""

MARGIN = 1e-9
"""Of contacts that are not soft [m]: what starts in touch is found in touch, whatever the round-off."""


class BodyModel:
    """The compiled model and its data at the start; ``trajectory`` turns samples of it into the motion."""

    def __init__(self, scene: Scene, option: dict[str, Any], contacts: str) -> None:
        import mujoco

        assert scene.bodies is not None
        self.scene, self.bodies, self.hardness = scene, scene.bodies, CONTACTS.get(contacts)
        self.free, self.dimension, self.dt = np.flatnonzero(scene.bodies.free), len(scene.gravity), option["timestep"]
        self.inertias = scene.bodies.inertias
        spec = mujoco.MjSpec()
        for name, value in {**option, "gravity": _padded(scene.gravity)}.items():
            setattr(spec.option, name, value)
        if self.hardness is not None:
            spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, IMPRATIO
        self._add_planes(spec)
        for i in range(len(self.bodies.shapes)):
            self._add_body(spec, i)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.data.qvel[:] = self._rates()
        is_told = scene.planes is not None and not scene.bodies.fixed
        self.push = self.data.qfrc_constraint[: self.model.nv if is_told else 0]

    def _add_planes(self, spec: Any) -> None:
        import mujoco

        if self.scene.planes is None:
            return
        for normal, offset in zip(self.scene.planes.normals, self.scene.planes.offsets):
            turn = np.zeros(4)
            mujoco.mju_quatZ2Vec(turn, _padded(normal))
            plane = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
            plane.pos, plane.quat = _padded(offset * normal), turn
            self._touch(plane)

    def _add_body(self, spec: Any, i: int) -> None:
        import mujoco

        bodies, planar = self.bodies, self.dimension == 2
        body = spec.worldbody.add_body(pos=_padded(bodies.positions[i]))
        body.explicitinertial, body.mass, body.inertia = True, bodies.masses[i], self.inertias[i] * np.ones(3)
        body.ipos = np.zeros(3)  # or else the body's own position, once more
        geom = self._geom(body, i)
        if planar:
            # the body itself is not turned, so that its joints are along the world's axes
            geom.quat = _about_z(bodies.orientations[i])
        else:
            body.quat = bodies.orientations[i]
        if not bodies.free[i]:
            return
        if not planar:
            body.add_freejoint()
            return
        for axis in AXES[:2]:
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=AXES[2])

    def _geom(self, body: Any, i: int) -> Any:
        """The shape; in the plane all boxes are equally thick."""
        import mujoco

        shape = self.bodies.shapes[i]
        if isinstance(shape, Box):
            thick = max(max(other.size) for other in self.bodies.shapes if isinstance(other, Box))
            half = 0.5 * np.array([*shape.size, thick][:3])
            geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half)
        else:
            geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[shape.radius, 0.0, 0.0])
        self._touch(geom)
        return geom

    def _touch(self, geom: Any) -> None:
        """How the shape touches others; without friction by one force each, lest MuJoCo keep a trace of friction."""
        geom.friction[0], geom.condim = self.scene.friction, 3 if self.scene.friction > 0.0 else 1
        if self.hardness is not None:
            steps, impedance = self.hardness
            geom.solref, geom.solimp[:3], geom.margin = [steps * self.dt, 1.0], [impedance, AT_DEEP, DEEP], MARGIN

    def _rates(self) -> np.ndarray:
        """Of the joints at the start."""
        bodies, free = self.bodies, self.free
        spins = bodies.spins[free]
        if self.dimension == 3:
            spins = np.einsum("nij,ni->nj", rotations(bodies.orientations[free], 3), spins)
        return np.column_stack([bodies.velocities[free], spins]).ravel()

    def trajectory(self, q: np.ndarray, rates: np.ndarray, pushes: np.ndarray, steps: int) -> Trajectory:
        """The motion from samples (s, ...) of joint coordinates, their rates and the contacts' forces along them.

        All bodies' forces add up to those of the planes, as they cancel between bodies; not where some are fixed.
        """
        bodies, free, d, count = self.bodies, self.free, self.dimension, len(q)
        start = (bodies.positions, bodies.orientations, np.zeros_like(bodies.velocities), np.zeros_like(bodies.spins))
        x, turned, v, spins = (np.repeat(array[None], count, axis=0) for array in start)
        places, axes = (3, 3) if d == 2 else (7, 6)
        q, rates = q.reshape(count, len(free), places), rates.reshape(count, len(free), axes)
        if d == 2:
            x[:, free] += q[..., :2]
            turned[:, free] += q[..., 2]
            spins[:, free] = rates[..., 2]
        else:
            x[:, free], turned[:, free] = q[..., :3], q[..., 3:]
            spins[:, free] = np.einsum("snij,snj->sni", rotations(turned[:, free], 3), rates[..., 3:])
        v[:, free] = rates[..., :d]
        told: dict[str, Any] = {"orientations": turned, "spins": spins}
        if pushes.size:
            sums = pushes.reshape(rates.shape)[..., :d].sum(axis=1)
            told["contact_forces"] = np.linalg.norm(sums, axis=1)
        return from_samples(self.scene.times, x, v, steps, **told)


def _padded(vector: np.ndarray) -> np.ndarray:
    return np.concatenate([vector, np.zeros(3 - len(vector))])


def _about_z(angle: float) -> list[float]:
    return [float(np.cos(0.5 * angle)), 0.0, 0.0, float(np.sin(0.5 * angle))]
