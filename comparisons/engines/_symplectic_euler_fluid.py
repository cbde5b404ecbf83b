"""Fluids under Newtonian symplectic Euler: weakly compressible SPH, see `_symplectic_euler_fluid_kernel`.

The speed of sound is not water's but ``sound_speed`` times the scene's speed. It bounds the compression - at 20 a third
of a per cent at the bottom of water at rest, 1 % at most in a dam break - and sets the step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.engines._checks import check_scene
from comparisons.engines.pbf import SUPPORT
from comparisons.scene import Scene
from comparisons.trajectory import Trajectory


def unsupported(scene: Scene, settings: Any) -> str:
    """Raises `InvalidInput` for numbers that describe no particles."""
    check_scene(scene)
    fluid = scene.fluid
    assert fluid is not None
    if fluid.solids:
        return "the scene has solids in a fluid"
    if scene.links:
        return "the scene has links in a fluid"
    if settings.dt is not None and settings.dt > limit(scene, settings) * (1.0 + 1e-9):
        return f"with this speed of sound dt must be at most {limit(scene, settings):.3g} s"
    return ""


def limit(scene: Scene, settings: Any) -> float:
    """Longest step [s]: ``courant`` h over the speed of sound and the scene's."""
    fluid, d = scene.fluid, len(scene.gravity)
    assert fluid is not None
    return settings.courant * SUPPORT[d] * fluid.spacing / ((settings.sound_speed + 1.0) * fluid.speed)


def step_of(scene: Scene, settings: Any) -> float:
    """dt [s]: as set, or the longest that divides the sample interval."""
    return settings.dt or scene.longest_step(limit(scene, settings))


def prepare(scene: Scene, settings: Any) -> Callable[[], Trajectory]:
    """Build the arrays; the run is one kernel call."""
    from comparisons.engines._symplectic_euler_fluid_kernel import integrate
    from comparisons.engines.symplectic_euler import Bodies
    from pbd.vector import from_store, to_store, zeros

    masses, d = scene.masses, len(scene.gravity)
    dt, n = step_of(scene, settings), len(masses.masses)
    every, offset = scene.steps_per_sample(dt), 0.5 * dt if settings.half_kick else 0.0
    gravity = tuple(float(g) for g in scene.gravity)
    water = new_water(scene, settings)

    def run() -> Trajectory:
        bodies = Bodies(to_store(masses.positions), to_store(masses.velocities), zeros(n, d), 1.0 / masses.masses)
        xs, vs = zeros((scene.samples + 1, n), d), zeros((scene.samples + 1, n), d)
        done, broken = integrate(water, bodies, gravity, (dt, offset), (every, scene.samples), (xs, vs))
        x, v, quantity = from_store(xs), from_store(vs), ("", "position", "velocity")[broken]
        count = done + 1 if not broken else done
        work = {"particle steps": done * every * n}
        return Trajectory(scene.times[:count], x[:count], v[:count], done * every, work, quantity)

    return run


def new_water(scene: Scene, settings: Any) -> Any:
    """The fluid at rest density, in the walls of the scene."""
    from comparisons.engines._symplectic_euler_fluid_kernel import SOFTENING, Water
    from pbd.fluid.cells import new_cells, sorted_array
    from pbd.fluid.kernels import lattice_sum, new_kernel
    from pbd.fluid.wall_input import read_walls
    from pbd.fluid.walls import new_walls

    fluid, d, n = scene.fluid, len(scene.gravity), len(scene.masses.masses)
    assert fluid is not None
    h, sound = SUPPORT[d] * fluid.spacing, settings.sound_speed * fluid.speed
    kernel: Any = new_kernel("wendland", h, d)
    volume = fluid.spacing**d / lattice_sum(kernel, fluid.spacing, d)
    planes = scene.planes
    normal, offset = (None, 0.0) if planes is None else (planes.normals, planes.offsets)
    unity = 1.0 / (volume * lattice_moment(kernel, fluid.spacing, d))
    return Water(
        kernel,
        new_cells(np.arange(n), d, h, d + 1),
        new_walls(read_walls(normal, offset, fluid.obstacles, h, d), kernel, fluid.spacing, d, n),
        unity,
        unity * volume * kernel.slope,
        sound**2 / 7.0,
        settings.viscosity * sound * h,
        SOFTENING * h**2,
        tuple(sorted_array(n) for _ in range(d)),
        tuple(sorted_array(n) for _ in range(d)),
        sorted_array(n),
        tuple(np.zeros(n) for _ in range(d)),
        np.ones(n),
    )


def lattice_moment(kernel: Any, spacing: float, dimension: int) -> float:
    """Sum of -x dW/dx over a square or cubic lattice [1/m^d]: about one over the volume of a particle in it."""
    from pbd.fluid.kernels import lattice_distances, profile

    r = lattice_distances(kernel, spacing, dimension)
    return float((r * profile(kernel, r)[1]).sum() / dimension)
