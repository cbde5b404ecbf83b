"""What Chipmunk does that surprises: how deep things rest, what a pair's friction is, what full corrections cost."""

from __future__ import annotations

import math
from typing import Any

from comparisons.record import Finding

G, STEP = 9.81, 1.0 / 60.0
DROP = 0.05
SECONDS = 10
LINKS, LENGTH = 10, 0.1


def find() -> list[Finding]:
    """Each in a space of its own."""
    return [_rest(), _touch(0.0), _touch(1e-6), _friction(), _bounce(), _pump(50), _pump(10)]


def _rest() -> Finding:
    """A box of 1 m is dropped on level ground."""
    import pymunk

    space = pymunk.Space()
    space.gravity = (0.0, -G)
    space.add(pymunk.Segment(space.static_body, (-5.0, 0.0), (5.0, 0.0), 0.0))
    body = pymunk.Body(1.0, 1.0 / 6.0)
    body.position = (0.0, 0.5 + DROP)
    space.add(body, pymunk.Poly.create_box(body, (1.0, 1.0)))
    for _ in range(round(SECONDS / STEP)):
        space.step(STEP)
    depth = 0.5 - float(body.position.y)
    return Finding(
        what="depth of a 1 m box that rests on level ground, dt 1/60 s",
        expected=0.0,
        found=depth,
        unit="m",
        verdict=f"trap: collision_slop is {space.collision_slop:.3g} scene units by default; set 1e-5"
        if depth > 1e-3
        else "rests at the surface",
    )


def _ground(space: Any) -> Any:
    """A large static box with its upper face at y = 0."""
    import pymunk

    ground = pymunk.Poly(space.static_body, [(-50.0, -10.0), (50.0, -10.0), (50.0, 0.0), (-50.0, 0.0)])
    space.gravity = (0.0, -G)
    space.add(ground)
    return ground


def _touch(radius: float) -> Finding:
    """Boxes are put on a slope, exactly in touch but for round-off, with little slop and much friction."""
    import pymunk

    space, angle = pymunk.Space(), 0.3
    space.collision_slop, space.iterations = 1e-5, 50
    _ground(space).friction = 1.0
    space.gravity = (-G * math.sin(angle), -G * math.cos(angle))
    bodies = []
    for i in range(1, 11):
        size = 0.1 * i
        body = pymunk.Body(1.0, size**2 / 6.0)
        body.position = (2.0 * i, 0.5 * size)
        box = pymunk.Poly.create_box(body, (size, size), radius)
        box.friction = 1.0
        space.add(body, box)
        bodies.append((body, body.position))
    for _ in range(round(1.0 / STEP)):
        space.step(STEP)
    way = max((body.position - start).length for body, start in bodies)
    return Finding(
        what=f"largest shift of 10 boxes put on a slope that holds them, dt 1/60 s, edge radius {radius:g} m",
        expected=0.0,
        found=way,
        unit="m",
        verdict="trap: shapes that just touch are in no contact; give their edges a radius below the slop"
        if way > 1e-4
        else "rest where they are put",
    )


def _friction() -> Finding:
    """A box slides on the ground, both with friction 0.5: its deceleration in the first second."""
    import pymunk

    space = pymunk.Space()
    _ground(space).friction = 0.5
    body = pymunk.Body(1.0, 1.0 / 6.0)
    body.position, body.velocity = (0.0, 0.5), (10.0, 0.0)
    box = pymunk.Poly.create_box(body, (1.0, 1.0))
    box.friction = 0.5
    space.add(body, box)
    steps = 1000
    for _ in range(steps):
        space.step(1.0 / steps)
    found = (10.0 - float(body.velocity.x)) / G
    return Finding(
        what="friction of a box of 0.5 on a ground of 0.5",
        expected=0.5,
        found=found,
        unit="1",
        verdict="trap: coefficients of a pair multiply; so do elasticities" if found < 0.45 else "as set",
    )


def _bounce() -> Finding:
    """A ball of elasticity 1 falls from 1 m on a ground of 1, with little slop: what it gains within 10 s."""
    import pymunk

    space = pymunk.Space()
    space.collision_slop = 1e-5
    _ground(space).elasticity = 1.0
    body = pymunk.Body(1.0, 1.0)
    body.position = (0.0, 1.1)
    ball = pymunk.Circle(body, 0.1)
    ball.elasticity = 1.0
    space.add(body, ball)
    energy, last = 0.0, round(1.0 / STEP)
    for k in range(round(SECONDS / STEP)):
        space.step(STEP)
        if k >= round(SECONDS / STEP) - last:
            # velocities are half a kick ahead of positions, as moves come first
            speed = float(body.velocity.y) + 0.5 * G * STEP
            energy += (0.5 * speed**2 + G * (float(body.position.y) - 0.1)) / last
    gain = energy / G - 1.0
    return Finding(
        what="energy gain of an elastic ball that bounces for 10 s, dt 1/60 s, slop 1e-5",
        expected=0.0,
        found=gain,
        unit="1",
        verdict="trap: pushing overlaps out lifts what bounces; collision_bias 1 leaves them"
        if gain > 1e-3
        else "kept",
    )


def _pump(iterations: int) -> Finding:
    """A chain of 10 rods released from horizontal, error_bias 0: largest rise of its energy within 1 s."""
    import pymunk

    step, space = 5e-4, pymunk.Space()
    space.gravity, space.iterations = (0.0, -G), iterations
    bodies = [pymunk.Body(1.0, math.inf) for _ in range(LINKS)]
    above = space.static_body
    for i, body in enumerate(bodies):
        body.position = (LENGTH * (i + 1), 0.0)
        rod = pymunk.PinJoint(above, body)
        rod.error_bias = 0.0
        space.add(body, rod)
        above = body
    rise = 0.0
    for _ in range(round(1.0 / step)):
        space.step(step)
        energy = sum(0.5 * body.velocity.length**2 + G * body.position.y for body in bodies)
        rise = max(rise, energy / (LINKS * G))
    verdict = (
        "kept" if rise < 1e-2 else "trap: a full correction needs about links^2 / 2 iterations, else it pumps energy"
    )
    return Finding(
        what=f"largest energy gain of {LINKS} rods, error_bias 0, {iterations} iterations, dt {step:g} s",
        expected=0.0,
        found=rise,
        unit="m g L",
        verdict=verdict,
    )
