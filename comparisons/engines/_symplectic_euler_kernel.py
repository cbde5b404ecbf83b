"""The kernel of Newtonian symplectic Euler: v <- v + h a(x), x <- x + h v."""

from __future__ import annotations

import math

from pbd.jit import device, kernel
from pbd.vector import accumulate, dot, load, scale, subtract


@kernel
def integrate(bodies, links, gravity, times, counts, samples):
    """Run counts = (steps a sample, samples); record at the start and after each sample interval.

    times = (h, offset): velocities are kept ``offset`` seconds behind the positions, 0 for the lecture's
    scheme and h/2 for leapfrog, and recorded at the time of the positions.
    Returns (samples done, 0 or the index of what is not finite: 1 position, 2 velocity).
    """
    h, offset = times
    accelerate(bodies, links, gravity)
    kick(bodies, -offset)
    sample(bodies, offset, samples, 0)
    for n in range(1, counts[1] + 1):
        for _ in range(counts[0]):
            kick(bodies, h)
            drift(bodies, h)
            accelerate(bodies, links, gravity)
        sample(bodies, offset, samples, n)
        broken = not_finite(bodies)
        if broken > 0:
            return n, broken
    return counts[1], 0


@device
def accelerate(bodies, links, gravity):
    """a = g - w (k C + c C') n summed over the links, C = |x_i - x_j| - rest, n its direction."""
    for k in range(len(gravity)):
        for i in range(bodies.w.shape[0]):
            bodies.a[k][i] = gravity[k] if bodies.w[i] > 0.0 else 0.0
    for c in range(links.rest.shape[0]):
        i, j = links.i[c], links.j[c]
        difference = subtract(load(bodies.x, i), load(bodies.x, j))
        length = math.sqrt(dot(difference, difference))
        normal = scale(1.0 / length, difference)
        rate = dot(subtract(load(bodies.v, i), load(bodies.v, j)), normal)
        tension = links.stiffness[c] * (length - links.rest[c]) + links.damping[c] * rate
        accumulate(bodies.a, i, -bodies.w[i] * tension, normal)
        accumulate(bodies.a, j, bodies.w[j] * tension, normal)


@device
def kick(bodies, h):
    for k in range(len(bodies.v)):
        for i in range(bodies.w.shape[0]):
            bodies.v[k][i] += h * bodies.a[k][i]


@device
def drift(bodies, h):
    for k in range(len(bodies.x)):
        for i in range(bodies.w.shape[0]):
            bodies.x[k][i] += h * bodies.v[k][i]


@device
def sample(bodies, offset, samples, n):
    for k in range(len(bodies.x)):
        for i in range(bodies.w.shape[0]):
            samples[0][k][n, i] = bodies.x[k][i]
            samples[1][k][n, i] = bodies.v[k][i] + offset * bodies.a[k][i]


@device
def not_finite(bodies):
    x = v = 0.0
    for k in range(len(bodies.x)):
        for i in range(bodies.w.shape[0]):
            x += bodies.x[k][i] - bodies.x[k][i]
            v += bodies.v[k][i] - bodies.v[k][i]
    if x != 0.0:
        return 1
    return 2 if v != 0.0 else 0
