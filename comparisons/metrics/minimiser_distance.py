"""How far the last step ends from the implicit-Euler minimiser of that step, which compliant XPBD approaches."""

from __future__ import annotations

import dataclasses

import numpy as np

from comparisons.metrics import Refused, Subject
from comparisons.minimiser import implicit_euler_step, springs_of
from comparisons.reference import NoReference

UNIT = "1"
TITLE = "distance from the minimiser"


def measure(subject: Subject) -> float:
    """|x - x*|_M / |x* - x_hat|_M, with x_hat = x_before + h v + h^2 g and h the sample interval.

    For runs whose step is the sample interval. The search for x* begins at x: of several minima it finds the one
    that the run is near. `Refused` for rigid links, or where no strict minimum is found.
    """
    scene, run = subject.scene, subject.trajectory
    h = scene.duration / scene.samples
    if run.steps != scene.samples:
        raise Refused("distance from the minimiser of a run with other steps than samples", f"set dt to {h:g}")
    masses = dataclasses.replace(scene.masses, positions=run.positions[-2], velocities=run.velocities[-2])
    try:
        found = implicit_euler_step(masses, springs_of(scene), scene.gravity, h, start=run.positions[-1])
    except NoReference as reason:
        raise Refused(f"distance from the minimiser without one: {reason}", "ask for other metrics") from None
    free, m = masses.free, masses.masses
    free_motion = masses.positions + h * masses.velocities + h**2 * scene.gravity
    off, moved = (_norm(found.positions - x, m * free) for x in (run.positions[-1], free_motion))
    return off / moved if moved > 0.0 else 0.0


def _norm(difference: np.ndarray, m: np.ndarray) -> float:
    return float(np.sqrt(m @ np.sum(difference**2, axis=1)))
