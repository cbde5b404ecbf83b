"""A body that falls on a plane without turning, and rebounds with Newton's restitution: parabola after parabola."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons.bodies import Ball, Box
from comparisons.scene import Scene
from comparisons.scenes import _rigid

APEXES = 5
"""So many are known to metrics; each next one is less of a motion and more of an engine's threshold."""


EVENTS = ("impact_time", "rebound", "apexes", "stop_time")

UP = np.array([0.0, 1.0])


@dataclass(frozen=True)
class Bounces:
    """Fall from ``height`` [m] under ``gravity`` [m/s^2], then rebounds with ``restitution`` until rest."""

    height: float
    gravity: float
    restitution: float

    @property
    def impact_time(self) -> float:
        """Of the first impact [s]: t1 = sqrt(2 h / g)."""
        return float(np.sqrt(2.0 * self.height / self.gravity))

    @property
    def stop_time(self) -> float:
        """When the last of infinitely many rebounds ends [s]: t1 (1 + e) / (1 - e)."""
        e = self.restitution
        return self.impact_time * (1.0 + e) / (1.0 - e) if e < 1.0 else np.inf

    def impact(self, n: np.ndarray) -> np.ndarray:
        """Times of the impacts [s], counted from 0: t1 (1 + 2 e (1 - e^n) / (1 - e))."""
        e = self.restitution
        if e in (0.0, 1.0):
            return self.impact_time * (1.0 + 2.0 * e * n)
        return self.impact_time * (1.0 - 2.0 * e * np.expm1(n * np.log1p(e - 1.0)) / (1.0 - e))

    def apexes(self) -> np.ndarray:
        """(APEXES, 3) of the first rebounds: time [s], height [m], half the flight [s]."""
        n, e = np.arange(APEXES), self.restitution
        half = self.impact_time * e ** (n + 1)
        return np.column_stack([self.impact(n) + half, self.height * e ** (2 * (n + 1)), half])

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Height of the lowest point [m] and velocity upwards [m/s], (s,) each; after an impact at its time."""
        g, falls, rests = self.gravity, times < self.impact_time, times >= self.stop_time
        n = self._flight(np.where(falls | rests, self.impact_time, times))
        since = times - self.impact(n)
        upward = np.sqrt(2.0 * g * self.height) * self.restitution ** (n + 1)
        height = np.where(falls, self.height - 0.5 * g * times**2, upward * since - 0.5 * g * since**2)
        velocity = np.where(falls, -g * times, upward - g * since)
        return np.where(rests, 0.0, height), np.where(rests, 0.0, velocity)

    def _flight(self, times: np.ndarray) -> np.ndarray:
        """How many impacts before the last one at or before the times."""
        e, since = self.restitution, times / self.impact_time - 1.0
        if e == 0.0:
            return np.zeros(len(times))
        if e == 1.0:
            return np.floor(since / 2.0)
        return np.floor(np.log1p(-since * (1.0 - e) / (2.0 * e)) / np.log1p(e - 1.0))


def scene(parameters: Any, shape: Box | Ball, metrics: tuple[str, ...], **described: Any) -> Scene:
    """One upright body of that shape over the plane y = 0.

    Of the metrics those of `EVENTS` are left out whose event does not happen during the run.
    """
    bounces = Bounces(parameters.height, parameters.gravity, parameters.restitution)

    def motion(times: np.ndarray) -> Any:
        return _rigid.planar(
            parameters.dimension, times, *_rigid.along(_rigid.half(shape) * UP, UP, *bounces.at(times))
        )

    known = _known(bounces, parameters)
    return _rigid.moving(
        parameters,
        [shape],
        [parameters.mass],
        motion,
        planes=_rigid.floor(parameters.dimension),
        known=known,
        metrics=tuple(name for name in metrics if name in known or name not in EVENTS),
        **described,
    )


def _known(bounces: Bounces, parameters: Any) -> dict[str, Any]:
    """What happens during the run, at times of the scene; an apex only where a sample is sure to be in its flight."""
    apexes = bounces.apexes() - [parameters.lead, 0.0, 0.0]
    seen = (apexes[:, 0] >= 0.0) & (apexes[:, 0] <= parameters.duration)
    seen &= apexes[:, 2] > parameters.duration / parameters.samples
    events = {"impact_time": bounces.impact_time - parameters.lead, "stop_time": bounces.stop_time - parameters.lead}
    known: dict[str, Any] = {name: time for name, time in events.items() if 0.0 < time < parameters.duration}
    if bounces.restitution == 0.0:
        known.pop("stop_time", None)
    if seen[0]:
        known["rebound"] = apexes[:1, :2]
    if seen.any():
        known["apexes"] = apexes[seen, :2]
    return known
