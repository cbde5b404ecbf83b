"""What Chipmunk does that no chain shows: how deep things rest, and what too full a correction costs."""

from __future__ import annotations

import math

from comparisons.record import Finding

G, STEP = 9.81, 1.0 / 60.0
DROP = 0.05
SECONDS = 10
LINKS, LENGTH = 10, 0.1


def find() -> list[Finding]:
    """Each in a space of its own."""
    return [_rest(), _pump(50), _pump(10)]


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
