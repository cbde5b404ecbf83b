"""What springs do exactly: a step of implicit Euler as the minimum that it is, and the static state.

Implicit Euler over h from (x, v): x* = argmin 1/(2 h^2) |x - x_hat|_M^2 + sum C^2 / (2 alpha) with
x_hat = x + h v + h^2 g, and v* = (x* - x) / h (e.g. Gast et al. 2015, "Optimization integrator for large time
steps"). It is what XPBD approaches, but does not reach, with more iterations.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from comparisons.network import Network
from comparisons.newton import Energy, Minimum, minimise
from comparisons.reference import NoReference
from comparisons.scene import PointMasses, Scene, Springs
from comparisons.trajectory import Trajectory

DISTURBANCE = 1e-2
"""Of the shortest rest length: so far off starts the search for a static state, lest it end in a saddle."""

SAME = 1e-9
"""Of the extent: static states that differ by more are two."""


def implicit_euler_step(
    masses: PointMasses, springs: Springs, gravity: np.ndarray, h: float, start: np.ndarray | None = None
) -> Minimum:
    """The state of ``masses`` after one step of ``h`` seconds under gravity (d,) [m/s^2].

    start : (n, d) [m], where the search begins; default where the masses are. A step that is not small against
    the stiffness has several minima, and the start chooses.

    Raises `NoReference` where no strict minimum is found.
    """
    return _step(_energy(masses, springs, 1.0 / h**2), masses, gravity, h, start)


def implicit_euler(scene: Scene, dt: float) -> Trajectory:
    """The scene's motion by such steps of ``dt`` seconds, each search begun where the last one ended.

    Raises `NoReference` for rigid links, `InvalidInput` for a dt off the sample grid.
    """
    every, times, masses = scene.steps_per_sample(dt), scene.times, scene.masses
    h = scene.duration / (scene.samples * every)
    energy = _energy(masses, springs_of(scene), 1.0 / h**2)
    positions = np.repeat(masses.positions[None], len(times), axis=0)
    velocities = np.repeat(np.where(masses.free[:, None], masses.velocities, 0.0)[None], len(times), axis=0)
    solves = 0
    for k in range(1, len(times)):
        for _ in range(every):
            found = _step(energy, masses, scene.gravity, h)
            v = (found.positions - masses.positions) / h
            masses = dataclasses.replace(masses, positions=found.positions, velocities=v)
            solves += found.iterations
        positions[k], velocities[k] = masses.positions, masses.velocities
    return Trajectory(times, positions, velocities, every * scene.samples, {"linear solves": solves})


def static_state(scene: Scene) -> Minimum:
    """The state of least energy, in which springs and gravity balance.

    It is searched for from two starts, the scene's disturbed in opposite directions. Raises `NoReference` for rigid
    links, for a scene that nothing holds, and where there is no one state: the searches end in different ones, in no
    strict minimum, or outside the vertical plane of what is pinned, as when a cloth buckles. Its mirror image is then
    a state of the same energy.
    """
    masses, springs = scene.masses, springs_of(scene)
    if not masses.pinned:
        raise NoReference("a scene without a pinned particle has no static state")
    energy = dataclasses.replace(_energy(masses, springs, 0.0), acceleration=scene.gravity)
    extent = float(np.ptp(masses.positions, axis=0).max())
    shift = float(np.linalg.norm(scene.gravity)) / extent  # so that the first step is about as long as the scene
    off = DISTURBANCE * float(springs.lengths.min()) * np.random.default_rng(0).standard_normal(masses.positions.shape)
    off[~masses.free] = 0.0
    one = minimise(energy, masses.positions + off, shift)
    aside = _aside(one.positions, masses.positions[list(masses.pinned)], scene.gravity)
    if aside > SAME * extent:
        raise NoReference(f"the static state is not unique: it buckles by {aside:.1e} m to either side")
    other = minimise(energy, masses.positions - off, shift)
    apart = float(np.abs(one.positions - other.positions).max())
    if apart > SAME * extent:
        raise NoReference(f"the static state is not unique: two searches end {apart:.1e} m apart")
    return one


def springs_of(scene: Scene) -> Springs:
    """All springs of a scene as one; raises `NoReference` where a link is none, or there is none."""
    springs: list[Springs] = scene.of(Springs)
    if not springs or len(springs) < len(scene.links):
        raise NoReference("the minimum of an energy needs springs only")
    parts = [(each.pairs, each.lengths, each.compliances) for each in springs]
    return Springs(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _aside(x: np.ndarray, pinned: np.ndarray, gravity: np.ndarray) -> float:
    """How far [m] the particles (n, d) are from the plane, or line, through what is pinned and along gravity.

    A reflection in it changes neither lengths nor heights.
    """
    size = float(np.linalg.norm(gravity)) or 1.0
    _, sizes, axes = np.linalg.svd(np.vstack([pinned - pinned[0], gravity / size]), full_matrices=False)
    within = axes[sizes > SAME * sizes[0]]
    relative = x - pinned[0]
    return float(np.abs(relative - relative @ within.T @ within).max())


def _energy(masses: PointMasses, springs: Springs, s: float) -> Energy:
    net = Network(masses, springs.pairs)
    still = np.zeros(masses.positions.shape[1])
    return Energy(net, 1.0 / springs.compliances[net.kept], springs.lengths[net.kept], masses.positions, s, still)


def _step(
    energy: Energy, masses: PointMasses, gravity: np.ndarray, h: float, start: np.ndarray | None = None
) -> Minimum:
    moved = masses.positions + h * masses.velocities + h**2 * gravity
    predicted = np.where(masses.free[:, None], moved, masses.positions)
    return minimise(dataclasses.replace(energy, target=predicted), masses.positions if start is None else start)
