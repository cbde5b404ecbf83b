"""A scene of point masses as a MuJoCo model, and the way back from joint coordinates to particles.

MuJoCo has no massless links and no bodies without inertia. Rods are therefore dumbbells: with each mass shared equally
among the bodies that meet at its particle (its own rod and those that hang on it), a rod with a (near) and b (far) on
length L is one body of mass a + b, centre b L / (a + b) from the near end, inertia a b L^2 / (a + b). Together they
have exactly the kinetic and potential energy of point masses on massless rods, hence the same equations of motion.

Rods form trees: a root is pinned or slides along each axis, every other particle turns about the one before it, in the
plane. Springs are spatial tendons between sites at the particles.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons.scene import Rods, Scene, Springs

AXES = np.eye(3)


@dataclass(frozen=True)
class Forest:
    """How rods hang: ``order`` of the particles, parents first; ``parent`` (n,), -1 for roots; ``level`` (n,)."""

    order: list[int]
    parent: np.ndarray
    level: np.ndarray
    loops: int


def forest(scene: Scene) -> Forest:
    """The trees that the rods form, pinned particles first; rods left over close a loop."""
    free = scene.masses.free
    neighbours: list[list[int]] = [[] for _ in free]
    rods = [pair for link in scene.of(Rods) for pair in link.pairs.tolist() if free[pair[0]] or free[pair[1]]]
    for i, j in rods:
        neighbours[i].append(j)
        neighbours[j].append(i)
    parent, level, seen = np.full(len(free), -1), np.zeros(len(free), dtype=int), ~free
    order: list[int] = []

    def grow(roots: Iterable[int]) -> None:
        queue = deque(roots)
        while queue:
            i = queue.popleft()
            order.append(i)
            for j in neighbours[i]:
                if not seen[j]:
                    seen[j], parent[j], level[j] = True, i, level[i] + 1
                    queue.append(j)

    grow(np.flatnonzero(~free).tolist())
    for root in np.flatnonzero(free).tolist():
        if not seen[root]:
            seen[root] = True
            grow([root])
    return Forest(order, parent, level, len(rods) - int(np.count_nonzero(parent >= 0)))


class Model:
    """The compiled model and its data at the start; ``ends`` turns joint coordinates into particles."""

    def __init__(self, scene: Scene, option: dict[str, Any]) -> None:
        import mujoco

        self.scene, self.forest = scene, forest(scene)
        self.arms = _arms(scene, self.forest)
        spec = mujoco.MjSpec()
        for name, value in {**option, "gravity": _padded(scene.gravity)}.items():
            setattr(spec.option, name, value)
        self._add_bodies(spec)
        self._add_springs(spec)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        # every joint has one coordinate, so a body's first joint is its address
        moving = np.flatnonzero(scene.masses.free).tolist()
        self.joint: dict[int, int] = {i: int(self.model.body(f"p{i}").jntadr[0]) for i in moving}
        self._set_velocities()

    def _add_bodies(self, spec: Any) -> None:
        masses, parent, dimension = self.scene.masses, self.forest.parent, len(self.scene.gravity)
        children = np.bincount(parent[parent >= 0], minlength=len(parent))
        share = masses.masses / (1.0 + children)
        bodies: dict[int, Any] = {}
        for i in self.forest.order:
            above = int(parent[i])
            if above >= 0:
                # a pinned near end never moves, so that any mass will do there
                near = float(share[above if masses.free[above] else i])
                bodies[i] = self._rod(bodies.get(above, spec.worldbody), i, near, float(share[i]))
            elif masses.free[i]:
                bodies[i] = _mass(spec.worldbody, f"p{i}", masses.positions[i], float(share[i]), dimension)
            if self.scene.of(Springs):
                bodies.get(i, spec.worldbody).add_site(name=f"p{i}", pos=self._offset(i))

    def _rod(self, above: Any, i: int, near: float, far: float) -> Any:
        import mujoco

        arm, mass = self.arms[i], near + far
        inertia = near * far / mass * float(arm @ arm)
        body = above.add_body(name=f"p{i}", pos=self._offset(int(self.forest.parent[i])))
        body.explicitinertial, body.mass, body.ipos, body.inertia = True, mass, far / mass * arm, [inertia] * 3
        body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=AXES[2])
        return body

    def _offset(self, i: int) -> np.ndarray:
        """Where particle i is in the frame of its body; the world's frame where it is pinned."""
        if not self.scene.masses.free[i]:
            return _padded(self.scene.masses.positions[i])
        return self.arms[i]

    def _add_springs(self, spec: Any) -> None:
        free = self.scene.masses.free
        for springs in self.scene.of(Springs):
            for (i, j), length, compliance in zip(springs.pairs.tolist(), springs.lengths, springs.compliances):
                if free[i] or free[j]:
                    tendon = spec.add_tendon()
                    tendon.wrap_site(f"p{i}")
                    tendon.wrap_site(f"p{j}")
                    tendon.stiffness, tendon.springlength = [1.0 / compliance, 0.0, 0.0], [length, length]

    def _set_velocities(self) -> None:
        """Slides take a root's velocity, hinges the rate of their rod less that of the rod before."""
        velocities, parent, dimension = self.scene.masses.velocities, self.forest.parent, len(self.scene.gravity)
        rates = np.zeros(len(parent))
        for i in self.forest.order:
            above, at = int(parent[i]), self.joint.get(i)
            if above >= 0:
                arm, v = self.arms[i], velocities[i] - velocities[above]
                rates[i] = (arm[0] * v[1] - arm[1] * v[0]) / (arm @ arm)
                self.data.qvel[at] = rates[i] - rates[above]
            elif at is not None:
                self.data.qvel[at : at + dimension] = velocities[i]

    def ends(self, q: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions [m] and velocities [m/s] of the particles, both (s, n, d), from joint samples (s, q)."""
        count, (n, dimension) = len(q), self.scene.masses.positions.shape
        q, rates = np.ascontiguousarray(q.T), np.ascontiguousarray(rates.T)
        angle, rate = np.zeros((n, count)), np.zeros((n, count))
        hanging = [i for i in self.forest.order if self.forest.parent[i] >= 0]
        for i in hanging:
            above, at = self.forest.parent[i], self.joint[i]
            angle[i], rate[i] = angle[above] + q[at], rate[above] + rates[at]
        x = np.repeat(self.scene.masses.positions[:, :, None], count, axis=2)
        v = np.zeros_like(x)
        if roots := list(self.joint.keys() - set(hanging)):
            slides = np.array([self.joint[i] for i in roots])[:, None] + np.arange(dimension)
            x[roots] += q[slides]
            v[roots] = rates[slides]
        if hanging:
            s, c, (a, b) = np.sin(angle), np.cos(angle), self.arms[:, :2, None].swapaxes(0, 1)
            turned = np.stack([c * a - s * b, s * a + c * b], axis=1)
            swing = rate[:, None] * np.stack([-turned[:, 1], turned[:, 0]], axis=1)
            for i in hanging:
                above = self.forest.parent[i]
                x[i], v[i] = x[above] + turned[i], v[above] + swing[i]
        return np.moveaxis(x, 2, 0).copy(), np.moveaxis(v, 2, 0).copy()


def _mass(world: Any, name: str, position: np.ndarray, mass: float, dimension: int) -> Any:
    """A body that slides along each axis; it never turns, so that its inertia matters to nothing."""
    import mujoco

    body = world.add_body(name=name, pos=_padded(position))
    body.explicitinertial, body.mass, body.inertia = True, mass, [mass] * 3
    for axis in AXES[:dimension]:
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    return body


def _arms(scene: Scene, trees: Forest) -> np.ndarray:
    """(n, 3) from each particle's parent to it at the start; 0 for roots."""
    x, hangs = scene.masses.positions, trees.parent >= 0
    arms = np.zeros((len(x), 3))
    arms[hangs, : x.shape[1]] = x[hangs] - x[trees.parent[hangs]]
    return arms


def _padded(vector: np.ndarray) -> np.ndarray:
    return np.concatenate([vector, np.zeros(3 - len(vector))])
