"""Euler's top in closed form: spins by Jacobi's elliptic functions, the attitude by one integral of theirs.

After Whittaker, Analytical Dynamics, section 69: the angular momentum L is fixed in space, so two of Euler's angles
about it follow from the spin; the third, the precession about L, is the integral of a periodic function of time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import ellipj, ellipk

from comparisons.bodies import rotations

MODES = 1024
"""Samples of the periodic integrand over its period; it is analytic, so their error falls as exp(-c MODES)."""


@dataclass(frozen=True)
class Top:
    """Moments of inertia A < B < C [kg m^2] along x, y, z; spin at time 0 of (0, ``middle``, ``last``) > 0 [rad/s].

    Then L^2 - 2 T B = C (C - B) last^2 > 0: L circles about the z axis of the body, and never is along it.
    """

    inertias: tuple[float, float, float]
    middle: float
    last: float

    @property
    def _terms(self) -> tuple[float, float]:
        """B (B - A) middle^2 and C (C - A) last^2; their sum is L^2 - 2 T A."""
        a, b, c = self.inertias
        return b * (b - a) * self.middle**2, c * (c - a) * self.last**2

    @property
    def modulus(self) -> float:
        """m = k^2 of the elliptic functions."""
        by_middle, by_last = self._terms
        return by_middle / (by_middle + by_last)

    @property
    def rate(self) -> float:
        """p, by which time is multiplied in their argument [1/s]; it flips once in 2 K(m) / p."""
        a, b, c = self.inertias
        return float(np.sqrt((c - b) * sum(self._terms) / (a * b * c)))

    def body_spins(self, times: np.ndarray) -> np.ndarray:
        """(s, 3) along the body axes [rad/s]: with u = p t, (-w sn/dn, middle cn/dn, last/dn)."""
        a, b, c = self.inertias
        sn, cn, dn, _ = ellipj(self.rate * times, self.modulus)
        first = (c - b) / (a * self.rate) * self.middle * self.last
        return np.column_stack([-first * sn / dn, self.middle * cn / dn, self.last / dn])

    @property
    def half_period(self) -> float:
        """2 K(m) / p, after which x and y have changed sign [s]."""
        return float(2.0 * ellipk(self.modulus) / self.rate)

    @cached_property
    def _series(self) -> tuple[float, np.ndarray]:
        """Mean of the rate of precession [rad/s], and (MODES / 2,) coefficients of its integral's sines [rad]."""
        rates = self._precession_rate(np.arange(MODES) / MODES * self.half_period)
        cosines = np.fft.rfft(rates).real / MODES  # even about 0, so there are no sines
        orders = np.arange(1, MODES // 2)
        return float(cosines[0]), 2.0 * cosines[1:-1] * self.half_period / (2.0 * np.pi * orders)

    def _precession_rate(self, times: np.ndarray) -> np.ndarray:
        """L (A w1^2 + B w2^2) / (A^2 w1^2 + B^2 w2^2), of period 2 K(m) / p."""
        momenta, spins = self.body_spins(times) * self.inertias, self.body_spins(times)
        across = np.sum(momenta[:, :2] * spins[:, :2], axis=1) / np.sum(momenta[:, :2] ** 2, axis=1)
        return np.linalg.norm(momenta[0]) * across

    def precession(self, times: np.ndarray) -> np.ndarray:
        """(s,) angles about L [rad] since time 0."""
        mean, sines = self._series
        phases = 2.0 * np.pi * times[:, None] / self.half_period * np.arange(1, MODES // 2)
        return mean * times + np.sin(phases) @ sines

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Orientations (s, 4) and spins in the world (s, 3); the body is in line with the world at time 0."""
        spins = self.body_spins(times)
        start, angles = self._about_momentum(np.zeros(1))[0], self._about_momentum(times)
        orientations = multiply(start * [1.0, -1.0, -1.0, -1.0], angles)
        return orientations, np.einsum("sij,sj->si", rotations(orientations, 3), spins)

    def _about_momentum(self, times: np.ndarray) -> np.ndarray:
        """(s, 4) from the body to a frame with z along L: Rz(precession) Rx(nutation) Rz(proper rotation)."""
        x, y, z = (self.body_spins(times) * self.inertias).T
        nutation, proper = np.arctan2(np.hypot(x, y), z), np.arctan2(x, y)
        turn = multiply(about(2, self.precession(times)), about(0, nutation))
        return multiply(turn, about(2, proper))


def about(axis: int, angles: np.ndarray) -> np.ndarray:
    """(s, 4) quaternions of turns about an axis by angles [rad]."""
    turns = np.zeros((len(angles), 4))
    turns[:, 0], turns[:, 1 + axis] = np.cos(angles / 2.0), np.sin(angles / 2.0)
    return turns


def multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(s, 4) products of quaternions (w, x, y, z)."""
    a, u, b, v = p[..., :1], p[..., 1:], q[..., :1], q[..., 1:]
    return np.concatenate([a * b - np.sum(u * v, axis=-1, keepdims=True), a * v + b * u + np.cross(u, v)], axis=-1)
