"""What PyBullet does with rigid bodies and contacts that no setting shows, each in a client of its own."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from comparisons.record import Finding

G, STEP = 9.81, 1.0 / 240.0
EDGE, HEIGHT = 1.0, 1.0
SECONDS = 20
SPIN = 500.0
SPEED, ASKEW = 4.0, 0.3
SLOPE, COEFFICIENT = 0.5, 0.3
BIG = 100.0
"""Edge of a box that serves as the ground [m]."""


def contacts(bullet: Any) -> list[Finding]:
    """All of them."""
    return [
        _own_plane(bullet),
        _elastic(bullet, "ball"),
        _elastic(bullet, "box"),
        _sideways(bullet),
        _turn(bullet),
        _other_client(bullet),
        _without_mass(bullet),
    ]


class _World:
    """A client with gravity along -y, whose bodies keep their energy and have maximal coordinates or reduced ones."""

    def __init__(self, bullet: Any, client: int, *, is_maximal: bool) -> None:
        self.bullet, self.client, self.is_maximal = bullet, client, is_maximal
        bullet.setGravity(0.0, -G, 0.0, physicsClientId=client)
        bullet.setTimeStep(STEP, client)

    def ground(self, **changes: Any) -> int:
        """A box whose upper side is y = 0."""
        return self.add(self.box([0.5 * BIG] * 3), 0.0, [0.0, -0.5 * BIG, 0.0], **changes)

    def box(self, half: list[float]) -> int:
        shape: int = self.bullet.createCollisionShape(
            self.bullet.GEOM_BOX, halfExtents=half, physicsClientId=self.client
        )
        return shape

    def add(self, shape: int, mass: float, place: list[float], **changes: Any) -> int:
        body: int = self.bullet.createMultiBody(
            mass, shape, -1, place, useMaximalCoordinates=int(self.is_maximal), physicsClientId=self.client
        )
        self.bullet.changeDynamics(
            body, -1, linearDamping=0.0, angularDamping=0.0, **changes, physicsClientId=self.client
        )
        return body

    def step(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP)):
            self.bullet.stepSimulation(self.client)

    def place(self, body: int) -> tuple[float, float, float]:
        found: tuple[float, float, float] = self.bullet.getBasePositionAndOrientation(body, self.client)[0]
        return found

    def energy(self, body: int) -> float:
        """Of a body of 1 kg, over g, that turns little [m]; 0 for one that lies on the ground."""
        velocity = self.bullet.getBaseVelocity(body, self.client)[0]
        return 0.5 * sum(v * v for v in velocity) / G + self.place(body)[1] - 0.5 * EDGE


@contextmanager
def _world(bullet: Any, *, is_maximal: bool) -> Iterator[_World]:
    client = bullet.connect(bullet.DIRECT)
    try:
        yield _World(bullet, client, is_maximal=is_maximal)
    finally:
        bullet.disconnect(client)


def _own_plane(bullet: Any) -> Finding:
    """A box falls flat, with what makes it rebound rightly on a box."""
    heights = {}
    with_own = {"contactProcessingThreshold": 0.0}
    for ground in ("box", "plane"):
        with _world(bullet, is_maximal=True) as world:
            bullet.setPhysicsEngineParameter(splitImpulsePenetrationThreshold=0.0, physicsClientId=world.client)
            if ground == "box":
                world.ground(restitution=1.0, **with_own)
            else:
                plane = bullet.createCollisionShape(
                    bullet.GEOM_PLANE, planeNormal=[0.0, 1.0, 0.0], physicsClientId=world.client
                )
                world.add(plane, 0.0, [0.0, 0.0, 0.0], restitution=1.0, **with_own)
            body = world.add(
                world.box([0.5 * EDGE] * 3), 1.0, [0.0, 0.5 * EDGE + HEIGHT, 0.0], restitution=0.5, **with_own
            )
            world.step(1.1 * math.sqrt(2.0 * HEIGHT / G))
            heights[ground] = world.energy(body)
    return Finding(
        what=f"rebound of a box dropped flat from {HEIGHT:g} m, restitution 1/2, on GEOM_PLANE",
        expected=0.25 * HEIGHT,
        found=heights["plane"],
        unit="m",
        verdict=f"trap: on a big box it is {heights['box']:.3f} m; make the ground of one"
        if abs(heights["plane"] - 0.25 * HEIGHT) > 0.1 * HEIGHT
        else "as it should be",
    )


def _elastic(bullet: Any, kind: str) -> Finding:
    """Dropped on a box, all as it comes but for damping."""
    with _world(bullet, is_maximal=False) as world:
        world.ground(restitution=1.0)
        shape = world.box([0.5 * EDGE] * 3)
        if kind == "ball":
            shape = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=0.5 * EDGE, physicsClientId=world.client)
        body = world.add(shape, 1.0, [0.0, 0.5 * EDGE + HEIGHT, 0.0], restitution=1.0, lateralFriction=0.0)
        world.step(SECONDS)
        found = world.energy(body) / HEIGHT
    verdict = "kept" if abs(found - 1.0) < 0.05 else "trap: contact acts before they touch and takes the speed away"
    if found > 1.05:
        verdict = (
            "trap: the speed that corrects overlap stays; take maximal coordinates, splitImpulsePenetrationThreshold 0"
        )
    return Finding(
        what=f"energy of an undamped {kind} of restitution 1, {SECONDS} s after it was dropped, over what it had",
        expected=1.0,
        found=found,
        unit="1",
        verdict=verdict,
    )


def _sideways(bullet: Any) -> Finding:
    """An oblong box slides to rest askew: friction acts against the motion, so it keeps its direction."""
    found = {}
    for is_maximal in (False, True):
        with _world(bullet, is_maximal=is_maximal) as world:
            world.ground(lateralFriction=1.0)
            body = world.add(world.box([0.5, 0.1, 0.4]), 1.0, [0.0, 0.1, 0.0], lateralFriction=0.5)
            start = [SPEED * math.cos(ASKEW), 0.0, SPEED * math.sin(ASKEW)]
            bullet.resetBaseVelocity(body, start, physicsClientId=world.client)
            world.step(2.0)
            x, _, z = world.place(body)
            found[is_maximal] = math.atan2(z, x) - ASKEW
    return Finding(
        what=f"turn of the path of an oblong box that slides to rest at {ASKEW:g} rad to its edges, as it comes",
        expected=0.0,
        found=found[False],
        unit="rad",
        verdict=f"trap: friction is not against the motion; in maximal coordinates it is {found[True]:.0e} rad"
        if abs(found[False]) > 1e-2
        else "keeps its direction",
    )


def _turn(bullet: Any) -> Finding:
    with _world(bullet, is_maximal=True) as world:
        body = world.add(world.box([0.5 * EDGE] * 3), 1.0, [0.0, 0.0, 0.0])
        bullet.resetBaseVelocity(body, [0.0] * 3, [0.0, 0.0, SPIN], physicsClientId=world.client)
        world.step(STEP)
        z, w = bullet.getBasePositionAndOrientation(body, world.client)[1][2:]
    found = 2.0 * math.atan2(z, w)
    return Finding(
        what=f"turn within 1/240 s of a body that spins at {SPIN:g} rad/s, maximal coordinates",
        expected=SPIN * STEP,
        found=found,
        unit="rad",
        verdict="as asked" if abs(found - SPIN * STEP) < 1e-6 else "trap: wrong beyond pi/4 in a step, without a word",
    )


def _other_client(bullet: Any) -> Finding:
    """A box slides down an incline, and another client asks for its own contactBreakingThreshold, or does not."""
    ways = []
    for asked in (None, 0.1):
        with _world(bullet, is_maximal=True) as world:
            bullet.setPhysicsEngineParameter(contactBreakingThreshold=0.02, physicsClientId=world.client)
            bullet.setTimeStep(1.0 / 60.0, world.client)
            bullet.setGravity(G * math.sin(SLOPE), -G * math.cos(SLOPE), 0.0, physicsClientId=world.client)
            world.ground(lateralFriction=1.0)
            body = world.add(world.box([0.5, 0.1, 0.5]), 1.0, [0.0, 0.1, 0.0], lateralFriction=COEFFICIENT)
            if asked is not None:
                with _world(bullet, is_maximal=True) as other:
                    bullet.setPhysicsEngineParameter(contactBreakingThreshold=asked, physicsClientId=other.client)
            world.step(0.5)
            ways.append(world.place(body)[0])
    with _world(bullet, is_maximal=True) as world:
        bullet.setPhysicsEngineParameter(contactBreakingThreshold=0.02, physicsClientId=world.client)
    return Finding(
        what="change of a body's way when another client sets its contactBreakingThreshold",
        expected=0.0,
        found=ways[1] - ways[0],
        unit="m",
        verdict="none" if ways[1] == ways[0] else "trap: all clients of a process share it; set it before each run",
    )


def _without_mass(bullet: Any) -> Finding:
    """A body of 1 kg is given its inertia alone, and falls for a second."""
    with _world(bullet, is_maximal=True) as world:
        body = world.add(world.box([0.5 * EDGE] * 3), 1.0, [0.0] * 3, localInertiaDiagonal=[1.0, 1.0, 1.0])
        found: float = bullet.getDynamicsInfo(body, -1, world.client)[0]
    return Finding(
        what="mass of a body of 1 kg that was then given its inertia, maximal coordinates",
        expected=1.0,
        found=found,
        unit="kg",
        verdict="kept" if found == 1.0 else "trap: give mass and inertia in one call",
    )
