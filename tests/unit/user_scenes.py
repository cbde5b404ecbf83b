"""Scenes made of `user_constraint`; run as a program it prints their final states, e.g. with NUMBA_DISABLE_JIT=1."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np

import pbd

G = 9.81


def load_by_path(name):
    """A user's file, imported from where it lies and entered where Python looks for modules."""
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


user = load_by_path("user_constraint")


def triangle(law=None, *, target=1.2, iterations=10, steps=200):
    """A spinning triangle that is driven to another area, one of its corners on the line x + y = 0."""
    x = np.array([[0.0, 0.0], [1.0, 0.1], [0.2, 1.0]])
    particles = pbd.particles(x, masses=[1.0, 2.0, 3.0], velocities=[[0.3, -0.3], [0.0, 1.0], [-1.0, 0.0]])
    area = user.Area(np.array([[0, 1, 2]]), np.array([target]), law or pbd.Stiffness())
    line = user.OnLine(np.array([0]), (0.5**0.5, 0.5**0.5), 0.0, pbd.Stiffness())
    settings = pbd.Settings(dt=0.005, iterations=iterations)
    return pbd.Simulation(particles, [area, line], gravity=(0.0, 0.0), settings=settings).run(steps)


def drums(steps=100):
    """Two masses hang from two drums of 0.1 and 0.5 m; a third falls freely."""
    particles = pbd.particles([[0.0, 0.0], [1.0, -1.0], [2.0, 0.0]], masses=[2.0, 1.0, 1.0])
    n = 2
    bodies = user.Drums(np.zeros(n), np.zeros(n), np.zeros(n), np.array([1 / 0.03, 1 / 0.5]))
    cable = user.Cable(np.array([0, 1]), np.array([0, 1]), np.array([0.1, 0.5]), np.array([0.0, -1.0]))
    settings = pbd.Settings(dt=0.01)
    return pbd.Simulation(particles, [cable], bodies=bodies, gravity=(0.0, -G), settings=settings).run(steps)


def package_scene():
    """What the package alone offers, together: links of two laws, planes with friction, damping, a force field."""
    particles = pbd.particles(
        np.column_stack([0.3 * np.arange(6), 0.5 + 0.1 * np.arange(6) ** 2 / 5]), masses=1.0 + np.arange(6), pinned=[0]
    )
    batches = [
        pbd.distance(particles, [(0, 1), (1, 2), (2, 3)], law=pbd.Stiffness(np.array([1.0, 0.5, 0.3]))),
        pbd.distance(particles, [(3, 4), (4, 5)], law=pbd.Compliance(1e-3, 10.0, relation="at_most")),
    ]
    batches.append(pbd.plane_contact(particles, normal=(0.1, 1.0), friction=0.3, restitution=0.5))
    settings = pbd.Settings(dt=0.005, iterations=3, substeps=2, damping=pbd.Damping(0.01))
    force = pbd.point_forces(particles, np.linspace(0.0, 1.0, 12).reshape(6, 2))
    simulation = pbd.Simulation(particles, batches, gravity=(0.0, -G), external=[force], settings=settings)
    return simulation.run(100)


def summary():
    """Final states of all scenes as plain numbers."""
    found = {}
    for make in (triangle, drums, package_scene):
        outcome = make()
        found[make.__name__] = {
            "x": outcome.positions[-1].tolist(),
            "v": outcome.velocities[-1].tolist(),
            "work": outcome.projections,
        }
    found["drums"]["angle"] = drums().recordings[1].angle[-1].tolist()
    return found


if __name__ == "__main__":
    print(json.dumps(summary()))
