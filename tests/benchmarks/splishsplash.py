"""What a step of a fluid costs here and in SPlisHSPlasH's position based fluids, side by side.

Run as ``python tests/benchmarks/splishsplash.py``, where ``pip install pysplishsplash`` has been run and the system has
libGL, which the package needs to be loaded, without a display.

Each runs the same time by itself, until the column is in collapse; from then on they take turns, a process for each
number of threads, and the minimum of the repeats counts. What was matched and what could not be is printed too. The
start of a run counts here; a step there is called from Python, which costs it microseconds.

One thread, version 2.19, other programs running: 12 to 15 times as long there in 2D, 6.5 times in 3D. Two threads that
are free have not been measured.

Kernels differ: Wendland's here, a cubic spline there, the fastest of those tried. With Wendland's, steps there take 1.2
to 1.4 times as long, and the fluid expands: 21 neighbours in the 3D collapse instead of 26.
"""

from __future__ import annotations

import argparse
import ctypes
import dataclasses
import importlib.util
import itertools
import json
import math
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from fluid import CASES, ITERATIONS, G, in_disorder, neighbours

import pbd

SUPPORT, STEPS, STEPS_THERE = 2.0, 20, 2
"""h/spacing; steps at a time, which take about as long here and there."""

PBF, PARTICLES, FIRST_ORDER = 2, 0, 0
"""SPlisHSPlasH's numbers of the method, of walls made of particles and of how velocities follow."""

CUBIC = {2: 0, 3: 4}
"""Dimensions -> its number of the cubic spline; in 3D from a table."""

MATCHED = """\
matched: column, tank, gravity, time step, mass of a particle, 4 iterations always, support of 2 spacings
  (SPlisHSPlasH has no other), precision, threads, first-order velocities, no viscosity, no vorticity, no surface
  tension, no drag"""

DIFFERENT = """\
not matched: Wendland's kernel here and a cubic spline there, the fastest tried; neighbours, to 5 %, so a
  ratio for one is given; walls are planes here and particles there; particles are sorted in memory in each step here
  and every 500 there; neighbours are collected once a step there and picked from candidates in each pass here"""

QUADS = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
"""Faces of a cube whose corners are sorted by x, then y, then z."""


def load():
    """The package, whose own copies of parts of OpenGL crash unless the system's libGL is there first."""
    if sys.platform == "linux":
        ctypes.CDLL("libGL.so.1", ctypes.RTLD_GLOBAL)
    import pysplishsplash

    return pysplishsplash


def loads():
    return load() is not None


def missing():
    """Why there is nothing to compare with, or None."""
    if importlib.util.find_spec("pysplishsplash") is None:
        return "pysplishsplash is not installed: pip install pysplishsplash (it needs libGL)"
    try:
        apart(loads)
    except (ImportError, OSError) as error:
        return f"pysplishsplash cannot be loaded ({error}): install libGL and libX11, on Debian libgl1 and libx11-6"
    except BrokenProcessPool:
        return "pysplishsplash crashes when it is loaded: install libGL and libX11, on Debian libgl1 and libx11-6"
    return None


def apart(function, *arguments):
    """The function's result from a process of its own: there is one simulation and one number of threads in each."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


def cube():
    """A unit cube around the origin, as an OBJ file."""
    corners = [f"v {x} {y} {z}" for x, y, z in itertools.product((-0.5, 0.5), repeat=3)]
    faces = [f"f {a} {b} {c}\nf {a} {c} {d}" for a, b, c, d in QUADS]
    return "\n".join(corners + faces) + "\n"


def description(counts, dt):
    """`fluid.scene` in SPlisHSPlasH's words; in 2D its block has some depth, and z = 0."""
    s, d = 1.0 / counts[0], len(counts)
    block = [count * s for count in counts] + [1.0] * (3 - d)
    tank = [4.0, *block[1 : d - 1], 1.2 * block[d - 1], *[1.0] * (3 - d)]
    # Walls are centres of particles, half a spacing behind what they stand for.
    size = [length + s for length in tank[:d]] + tank[d:]
    middle = [length / 2.0 for length in tank[:d]] + [0.0] * (3 - d)
    start = [0.0] * d + [-1.0] * (3 - d)
    configuration = {
        "sim2D": d == 2,
        "particleRadius": s / 2.0,
        "simulationMethod": PBF,
        "gravitation": [0.0 if axis != d - 1 else -G for axis in range(3)],
        "cflMethod": 0,
        "timeStepSize": dt,
        "boundaryHandlingMethod": PARTICLES,
    }
    material = {"id": "Fluid", "density0": 1000.0, "viscosityMethod": 0, "vorticityMethod": 0}
    wall = {"geometryFile": "cube.obj", "translation": middle, "scale": size, "isDynamic": False, "isWall": True}
    # The first particle is set one spacing from the start, the last one spacing or more before the end.
    end = [length + s for length in block[:d]] + block[d:]
    fluid = {"denseMode": 0, "start": start, "end": end, "translation": [-s / 2.0] * d + [0.0] * (3 - d)}
    return {
        "Configuration": configuration,
        "Materials": [material],
        "RigidBodies": [wall],
        "FluidBlocks": [{**fluid, "scale": [1.0, 1.0, 1.0]}],
    }


def theirs(counts, dt, until, folder):
    """SPlisHSPlasH's simulation at that time, and its package."""
    sph = load()
    (folder / "cube.obj").write_text(cube())
    (folder / "scene.json").write_text(json.dumps(description(counts, dt)))
    base = sph.Exec.SimulatorBase()
    base.init(
        sceneFile=str(folder / "scene.json"),
        useCache=False,
        outputDir=str(folder / "out"),
        initialPause=False,
        useGui=False,
        stopAt=until,
    )
    base.initSimulation()
    choose(sph.Simulation.getCurrent())
    base.runSimulation()
    return sph, base


def choose(simulation):
    """What is read from the method's own part of a scene, or set by it."""
    step = simulation.getTimeStep()
    step.setValueUInt(step.MIN_ITERATIONS, ITERATIONS)
    step.setValueUInt(step.MAX_ITERATIONS, ITERATIONS)
    number = CUBIC[2 if simulation.is2DSimulation() else 3]
    simulation.setKernel(number)
    simulation.setGradKernel(number)


def check(sph, counts, dt):
    """That it does what was asked for."""
    simulation = sph.Simulation.getCurrent()
    step, model, s = simulation.getTimeStep(), simulation.getFluidModel(0), 1.0 / counts[0]
    first = np.asarray(model.getFieldBuffer("position0"))[: math.prod(counts)]
    pairs = {
        "method": (isinstance(step, sph.TimeStepPBF), True),
        "particles": (model.numActiveParticles(), math.prod(counts)),
        "column": (first.max() + first[:, 0].min(), max(counts) * s),
        "support": (simulation.getSupportRadius(), SUPPORT * s),
        "volume": (model.getVolume(0), s ** len(counts)),
        "time step": (sph.TimeManager.getCurrent().getTimeStepSize(), dt),
        "iterations": (step.getNumIterations(), ITERATIONS),
        "velocities": (step.getValueInt(step.VELOCITY_UPDATE_METHOD), FIRST_ORDER),
        "kernel": (simulation.getKernel(), CUBIC[len(counts)]),
        "gradient": (simulation.getGradKernel(), CUBIC[len(counts)]),
        "viscosity": (model.getViscosityMethod(), 0),
        "vorticity": (model.getVorticityMethod(), 0),
        "surface tension": (model.getSurfaceTensionMethod(), 0),
        "drag": (model.getDragMethod(), 0),
    }
    wrong = [
        name for name, (is_, asked) in pairs.items() if is_ != asked and not math.isclose(is_, asked, rel_tol=1e-5)
    ]
    if wrong:
        raise RuntimeError(f"SPlisHSPlasH does not do as asked: {', '.join(wrong)}")


def compare(name, threads, repeats):
    """Seconds a step and positions of both, ours first, and the precision."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    counts = CASES[name][0]
    particles, fluid, settings, gravity = in_disorder(counts, SUPPORT)
    until = (round(0.5 * math.sqrt(1.0 / G) / settings.dt) - 0.5) * settings.dt
    with tempfile.TemporaryDirectory() as folder:
        sph, base = theirs(counts, settings.dt, until, Path(folder))
        check(sph, counts, settings.dt)
        simulation = sph.Simulation.getCurrent()
        x = np.asarray(simulation.getFluidModel(0).getFieldBuffer("position"))[: math.prod(counts)]
        settings = dataclasses.replace(settings, precision=str(x.dtype), threads=threads)
        states = [np.column_stack(particles.x), x.copy()]
        ours = pbd.Simulation(particles, [fluid], gravity=gravity, settings=settings)
        ours.run(1, [1])
        best = take_turns(ours, simulation.getTimeStep(), repeats)
        base.cleanup()
    return best, states, settings.precision


def take_turns(ours, theirs, repeats):
    """The least seconds a step of each, where the other's threads have gone to sleep."""
    best = [math.inf, math.inf]
    for _ in range(repeats):
        time.sleep(0.05)
        start = time.perf_counter()
        ours.run(STEPS, [STEPS])
        best[0] = min(best[0], (time.perf_counter() - start) / STEPS)
        time.sleep(0.05)
        start = time.perf_counter()
        for _ in range(STEPS_THERE):
            theirs.step()
        best[1] = min(best[1], (time.perf_counter() - start) / STEPS_THERE)
    return best


def show(name, threads, best, states, precision):
    n, h = len(states[0]), SUPPORT / CASES[name][0][0]
    near = [neighbours(x, h) for x in states]
    print(f"{name}, {n} particles, threads: {threads}, {precision}")
    for label, seconds, x, count in zip(("pbd", "SPlisHSPlasH"), best, states, near):
        cost = f"{seconds / n * 1e9:7.1f} ns a particle and step"
        print(f"  {label:14s} {cost}, {count:.1f} neighbours, 99 % of it within {np.quantile(x[:, 0], 0.99):.2f} m")
    ratio = best[1] / best[0]
    print(f"  {'ratio':14s} {ratio:7.1f}, for a neighbour {ratio * near[0] / near[1]:.1f}", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    arguments = parser.parse_args()
    why = missing()
    if why:
        print(why)
        return
    for name, threads in itertools.product(arguments.cases, arguments.threads):
        os.environ["OMP_NUM_THREADS"] = str(threads)
        show(name, threads, *apart(compare, name, threads, arguments.repeats))
    print(MATCHED, DIFFERENT, sep="\n")


if __name__ == "__main__":
    main()
