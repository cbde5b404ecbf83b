"""What a user would write in a file of his own: constraints, a field and a second state group for `pbd`.

Nothing here is known to the package. The classes are NamedTuples, their methods the stages they take part in.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pbd.vector import dot, load, subtract


class Area(NamedTuple):
    """Signed area of triangles in the plane: C = (p2 - p1) x (p3 - p1) / 2 - rest."""

    corners: np.ndarray
    rest: np.ndarray
    law: Any

    def size(self):
        return self.corners.shape[0]

    def evaluate(self, c, x):
        i, j, k = self.corners[c, 0], self.corners[c, 1], self.corners[c, 2]
        a, b = subtract(load(x, j), load(x, i)), subtract(load(x, k), load(x, i))
        gj, gk = (0.5 * b[1], -0.5 * b[0]), (-0.5 * a[1], 0.5 * a[0])
        gi = (-gj[0] - gk[0], -gj[1] - gk[1])
        value = 0.5 * (a[0] * b[1] - a[1] * b[0]) - self.rest[c]
        return (i, j, k), value, (gi, gj, gk), (dot(gi, gi), dot(gj, gj), dot(gk, gk))


class OnLine(NamedTuple):
    """Particle i kept on the line n . x = offset: C = n . p - offset, of one particle."""

    i: np.ndarray
    normal: tuple[float, float]
    offset: float
    law: Any

    def size(self):
        return self.i.shape[0]

    def evaluate(self, c, x):
        i = self.i[c]
        return (i,), dot(self.normal, load(x, i)) - self.offset, (self.normal,), (1.0,)


class Poison(NamedTuple):
    """Writes ``value`` into the first velocity before (``late``: after) the solve, from step ``at`` on."""

    at: int
    value: float
    late: bool
    steps: np.ndarray

    def accelerate(self, state, h):
        self.steps[0] += 1
        if self.steps[0] >= self.at and not self.late:
            state.particles.v[0][0] = self.value

    def end(self, state, h):
        self.steps[0] += 1
        if self.steps[0] >= self.at and self.late:
            state.particles.v[0][0] = self.value


class DrumRecording(NamedTuple):
    """Angles and spins (samples, n)."""

    angle: np.ndarray
    spin: np.ndarray


class Drums(NamedTuple):
    """A second state group: drums with angle q [rad], prediction p, spin s [rad/s], inverse inertia w [1/(kg m^2)]."""

    q: np.ndarray
    p: np.ndarray
    s: np.ndarray
    w: np.ndarray

    def new_recording(self, samples):
        return DrumRecording(np.zeros((samples, self.q.shape[0])), np.zeros((samples, self.q.shape[0])))

    def predict(self, h):
        for i in range(self.q.shape[0]):
            self.p[i] = self.q[i] + h * self.s[i]

    def update(self, h):
        for i in range(self.q.shape[0]):
            self.s[i] = (self.p[i] - self.q[i]) / h
            self.q[i] = self.p[i]

    def record(self, recording, k):
        for i in range(self.q.shape[0]):
            recording.angle[k, i] = self.q[i]
            recording.spin[k, i] = self.s[i]

    def not_finite(self):
        for i in range(self.q.shape[0]):
            if not math.isfinite(self.q[i]):
                return 1
            if not math.isfinite(self.s[i]):
                return 2
        return 0


class Cable(NamedTuple):
    """Particle i hangs by a cable from drum b of radius r: C = y_i + r q_b - rest = 0 couples both groups."""

    particle: np.ndarray
    drum: np.ndarray
    radius: np.ndarray
    rest: np.ndarray

    def size(self):
        return self.particle.shape[0]

    def project(self, state, h):
        points, drums = state.particles, state.bodies
        for c in range(self.particle.shape[0]):
            i, b, r = self.particle[c], self.drum[c], self.radius[c]
            value = points.p[1][i] + r * drums.p[b] - self.rest[c]
            change = -value / (points.w[i] + r * r * drums.w[b])
            points.p[1][i] += points.w[i] * change
            drums.p[b] += drums.w[b] * r * change
        state.work[0] += self.particle.shape[0]
