"""Newtonian dynamics as the lecture has it: forces, accelerations, then v, then x (symplectic Euler).

A rigid link is a stiff spring with a damper, whose stiffness sets an error floor; a compliant link is
its spring. With ``half_kick`` velocities live at half steps (leapfrog), which makes it second order.

Rigid bodies touch by penalty: springs and dampers, as in `_symplectic_euler_contacts`. ``contact_stiffness`` sets how
deep they rest and how long an impact takes: g/(2 k) for a box in the plane, about pi/sqrt(2 k). A fluid is weakly
compressible SPH, see `_symplectic_euler_fluid`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from typing import Any, NamedTuple

import numpy as np

from comparisons.engines import _symplectic_euler_fluid
from comparisons.engines._body_checks import check_bodies
from comparisons.engines._checks import beyond_rods_and_springs
from comparisons.scene import Rods, Scene, Springs
from comparisons.trajectory import Trajectory
from pbd import fields

TITLE = "symplectic Euler"
FOREIGN = False


@dataclass(frozen=True)
class Settings:
    """What applies where.

    rigid links : ``stiffness`` and ``damping_ratio``; rigid bodies : ``contact_stiffness``
    fluids : ``sound_speed``, ``courant`` and ``viscosity``; they alone take a ``dt`` of none
    """

    dt: float | None = fields.real(1e-4, "s", 1e-12, 1e3, "time step; none: of fluids, by courant", optional=True)
    stiffness: float = fields.real(1e6, "N/m", 0.0, 1e15, "spring that stands for a rigid link", above=True)
    damping_ratio: float = fields.real(0.0, "1", 0.0, 10.0, "link damping, as a fraction of critical")
    half_kick: bool = fields.flag(False, "start half a step earlier: leapfrog, second order")
    contact_stiffness: float = fields.real(
        1e6, "N/m/kg", 0.0, 1e15, "spring at a contact point, for each kg of the lighter body", above=True
    )
    sound_speed: float = fields.real(20.0, "1", 1.0, 1e6, "of fluids, over the scene's speed")
    courant: float = fields.real(0.4, "1", 0.0, 1.0, "of fluids: way of sound in a step, over the support", above=True)
    viscosity: float = fields.real(0.05, "1", 0.0, 10.0, "of fluids: alpha, artificial")

    def __post_init__(self) -> None:
        fields.check(self, "settings")


PRESETS: dict[str, dict[str, Any]] = {"default": {}, "matched": {"half_kick": True}}
SWEEP: list[dict[str, Any]] = [{"stiffness": 10.0**exponent} for exponent in (4, 5, 6, 7, 8, 10)] + [
    {"stiffness": stiffness, "damping_ratio": 0.1} for stiffness in (1e6, 1e8)
]
FLUID_SWEEP: list[dict[str, Any]] = [{"sound_speed": speed} for speed in (10.0, 20.0, 40.0)]
CONTACT_SWEEP: list[dict[str, Any]] = [{"contact_stiffness": 10.0**exponent} for exponent in (4, 5, 6, 7, 8, 10)]


class Links(NamedTuple):
    """Springs with dampers: indices, rest lengths [m], stiffnesses [N/m], dampings [N s/m], all (m,)."""

    i: np.ndarray
    j: np.ndarray
    rest: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray


class Bodies(NamedTuple):
    """Positions, velocities and accelerations as stores; inverse masses (n,), 0 for the pinned."""

    x: tuple[np.ndarray, ...]
    v: tuple[np.ndarray, ...]
    a: tuple[np.ndarray, ...]
    w: np.ndarray


def missing() -> str:
    return ""


def version() -> str:
    return metadata.version("pbdbench")


def unsupported(scene: Scene, settings: Settings) -> str:
    """Raises `InvalidInput` for numbers that describe no bodies."""
    if scene.fluid is not None:
        return _symplectic_euler_fluid.unsupported(scene, settings)
    if settings.dt is None and (scene.bodies is not None or len(scene.masses.masses) > 0):
        return "dt must be set for a scene without a fluid"
    if scene.bodies is None:
        return beyond_rods_and_springs(scene)
    check_bodies(scene)
    return "the scene has links between rigid bodies" if scene.links else ""


def sweep(scene: Scene) -> list[dict[str, Any]]:
    """What stands for rigid links, for impenetrable bodies, for an incompressible fluid; else nothing to try."""
    if scene.fluid is not None:
        return FLUID_SWEEP
    if scene.bodies is not None and (scene.planes is not None or len(scene.bodies.masses) > 1):
        return CONTACT_SWEEP
    return SWEEP if scene.of(Rods) else [{}]


def prepare(scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """Build the arrays; the run is one kernel call."""
    if scene.bodies is not None:
        from comparisons.engines._symplectic_euler_bodies import prepare as prepare_bodies

        assert settings.dt is not None
        return prepare_bodies(scene, settings.contact_stiffness, settings.dt, settings.half_kick)
    if scene.fluid is not None:
        return _symplectic_euler_fluid.prepare(scene, settings)
    from comparisons.engines._symplectic_euler_kernel import integrate
    from pbd.vector import from_store, to_store, zeros

    masses, dimension = scene.masses, len(scene.gravity)
    w = np.where(masses.free, 1.0 / masses.masses, 0.0)
    dt = settings.dt or scene.duration / scene.samples
    links, every = _links(scene, w, settings), scene.steps_per_sample(dt)
    gravity = tuple(float(g) for g in scene.gravity)
    shape = (scene.samples + 1, len(w))
    offset = 0.5 * dt if settings.half_kick else 0.0

    def run() -> Trajectory:
        bodies = Bodies(to_store(masses.positions), to_store(masses.velocities), zeros(len(w), dimension), w)
        xs, vs = zeros(shape, dimension), zeros(shape, dimension)
        done, broken = integrate(bodies, links, gravity, (dt, offset), (every, scene.samples), (xs, vs))
        work = {"spring forces": done * every * len(links.rest)}
        x, v, quantity = from_store(xs), from_store(vs), ("", "position", "velocity")[broken]
        count = done + 1 if not broken else done
        return Trajectory(scene.times[:count], x[:count], v[:count], done * every, work, quantity)

    return run


def _links(scene: Scene, w: np.ndarray, settings: Settings) -> Links:
    """All links as springs; critical damping is 2 sqrt(k m) with the reduced mass m of the two ends."""
    pairs, rest, stiffness, ratio = [np.zeros((0, 2), dtype=np.int64)], [], [], []
    for link in scene.links:
        count = len(link.lengths)
        pairs.append(link.pairs)
        rest.append(link.lengths)
        stiffness.append(1.0 / link.compliances if isinstance(link, Springs) else np.full(count, settings.stiffness))
        ratio.append(np.full(count, 0.0 if isinstance(link, Springs) else settings.damping_ratio))
    index = np.concatenate(pairs).astype(np.int64)
    lengths, k, zeta = (np.concatenate([np.zeros(0), *parts]) for parts in (rest, stiffness, ratio))
    weight = w[index].sum(axis=1) if len(index) else np.zeros(0)
    damping = 2.0 * zeta * np.sqrt(k / np.where(weight > 0.0, weight, math.inf))
    return Links(index[:, 0].copy(), index[:, 1].copy(), lengths, k, damping)
