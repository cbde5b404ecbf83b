"""When a gap closes within a sub-step, and how fast."""

from __future__ import annotations

import math

from pbd.jit import device

CLOSED = 1e-10
"""[m] A gap up to this touches."""

OPEN = 1e30
"""[m/s] Bias of a contact point that does not touch: no velocity closes it."""


@device
def closing(gap, before, mean, h, rest):
    """(when a gap closes faster than ``rest``, or inf; its speed then, < 0, or 0).

    The gap moves as gap + before t + (mean - before) t^2/h: from the speed ``before`` at the start and the mean speed
    over h that is foreseen. The root is exact for a body in free flight, and of the order of h^3 else.
    """
    if gap <= CLOSED and before >= -rest:
        return math.inf, 0.0
    if gap + mean * h > CLOSED:
        return math.inf, 0.0
    half = (mean - before) / h
    root = math.sqrt(max(before * before - 4.0 * half * gap, 0.0))
    when = 2.0 * gap / (root - before) if gap > CLOSED and root > before else 0.0
    speed = before + 2.0 * half * min(when, h)
    return (when, speed) if speed < -rest else (math.inf, 0.0)


@device
def after(gap, pushed, impact, restitution):
    """Bias of a contact in a velocity pass [m/s]: it rebounds, or does not close, or takes no part while it is open.

    ``pushed``: the impulse of the position pass; ``restitution`` below 0: the impact is not in this pass.
    """
    if (gap > CLOSED and pushed == 0.0) or (impact != 0.0 and restitution < 0.0):
        return OPEN
    return restitution * impact


@device
def opening(gap, bend, inverse, rate, most_push):
    """Bias of a contact in a position pass [m/s]: its speed may not be less than minus this.

    A gap may close within the sub-step, 1/inverse; an overlap is undone at its ``rate``, and at ``most_push`` at most.
    """
    return max(gap * (inverse if gap > 0.0 else rate) + bend * inverse, -most_push)
