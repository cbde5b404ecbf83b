"""The rocking block in closed form: arcs of an inverted pendulum, each after an impact that keeps a part of the spin.

With beta the angle of the line from the edge to the centre from vertical, beta'' = p^2 sin(beta), p^2 = 3 g / 4 R. The
solution at rest at time 0 is sin(beta / 2) = sin(beta0 / 2) / dn(p t | m), m = cos^2(beta0 / 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import ellipj, ellipkinc

REST = 1e-15
"""An arc that is shorter than this part of the first is none: the block is at rest."""


@dataclass(frozen=True)
class Rocking:
    """A block of half edges [m], released from rest at ``tilt`` times its angle of toppling, counter-clockwise."""

    half_width: float
    half_height: float
    tilt: float
    gravity: float

    @property
    def alpha(self) -> float:
        """Tilt at which it topples [rad]."""
        return float(np.arctan2(self.half_width, self.half_height))

    @property
    def radius(self) -> float:
        """R, from an edge to the centre [m]."""
        return float(np.hypot(self.half_width, self.half_height))

    @property
    def rate(self) -> float:
        """p of the inverted pendulum [1/s]; the same in 2D and 3D."""
        return float(np.sqrt(0.75 * self.gravity / self.radius))

    @property
    def kept(self) -> float:
        """Spin after an impact over that before: 1 - 1.5 sin^2 alpha, by momentum about the new edge."""
        return float(1.0 - 1.5 * np.sin(self.alpha) ** 2)

    @cached_property
    def arcs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of all arcs: beta at their highest [rad], half their duration [s], and when they are highest [s]."""
        ratio, first = self.kept, (1.0 - self.tilt) * self.alpha
        count = int(np.ceil(np.log(REST) / np.log(ratio))) if 0.0 < ratio < 1.0 else 1
        # cos beta_n - cos alpha falls by kept^2 an impact
        share = ratio ** (2.0 * np.arange(count))
        lift = np.sin((self.alpha + first) / 2.0) * np.sin((self.alpha - first) / 2.0) * share
        low = np.sqrt(np.sin(self.alpha / 2.0) ** 2 - lift)  # sin(beta / 2)
        modulus = 1.0 - low**2
        phase = np.arcsin(np.minimum(np.sqrt(lift / modulus) / np.sin(self.alpha / 2.0), 1.0))
        halves = ellipkinc(phase, modulus) / self.rate
        ends = np.cumsum(2.0 * halves) - halves[0]
        return 2.0 * np.arcsin(low), halves, ends - halves

    def impacts(self) -> np.ndarray:
        """Times of the impacts [s]; the last is when the block is at rest."""
        _, halves, highest = self.arcs
        return highest + halves

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Centres and velocities (s, 2), angles and spins (s,); after an impact at its time."""
        beta0, _, highest = self.arcs
        arc = np.searchsorted(self.impacts(), times, side="right")
        rests, arc = arc == len(beta0), np.minimum(arc, len(beta0) - 1)
        low, side = np.sin(beta0[arc] / 2.0), np.where(arc % 2 == 0, 1.0, -1.0)
        sn, cn, dn, _ = ellipj(self.rate * (times - highest[arc]), 1.0 - low**2)
        beta = np.where(rests, self.alpha, 2.0 * np.arcsin(np.minimum(low / dn, 1.0)))
        change = 2.0 * self.rate * low * (1.0 - low**2) * sn * cn / (dn**2 * np.cos(beta / 2.0))
        change = np.where(rests, 0.0, change)
        r, s, c = self.radius, np.sin(beta), np.cos(beta)
        centres = np.column_stack([side * (r * s - self.half_width), r * c])
        velocities = np.column_stack([side * r * c, -r * s]) * change[:, None]
        return centres, velocities, side * (self.alpha - beta), -side * change

    @property
    def friction(self) -> float:
        """The least coefficient with which no edge slips, for blocks no wider than high: 3 b h / (4 h^2 + b^2).

        In an arc the force on the edge is the flattest where beta = alpha and the spin is 0; at an impact, the same.
        """
        slope = self.half_width / self.half_height
        return 0.75 * slope / (1.0 + 0.25 * slope**2)
