"""Rigid bodies as plain Python, and with bounds checked: the same numbers as compiled.

A kernel with checked bounds is cached beside the other: its key has the option.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

pytestmark = pytest.mark.slow

RUN = """
import json, sys, numba, numpy as np, pbd

kind, d, count, steps = sys.argv[1], *map(int, sys.argv[2:])
assert bool(numba.config.DISABLE_JIT) == (kind == "NUMBA_DISABLE_JIT")
assert bool(numba.config.BOUNDSCHECK) == (kind == "NUMBA_BOUNDSCHECK")
x = np.random.default_rng(1).uniform(-0.5, 0.5, (count, d))
x[:, 1] = 0.3 + 0.45 * np.arange(count)
up, side = np.eye(d)[1], np.eye(d)[0]
shapes = [pbd.Ball(0.25) if k % 3 == 2 else pbd.Box((0.5,) * d) for k in range(count)]
bodies = pbd.bodies(shapes, x, spins=1.0, velocities=np.tile(-up, (count, 1)))
planes = pbd.planes([up, side, -side], [0.0, -0.9, -0.9])
contacts = pbd.contacts(bodies, planes, friction=0.5, restitution=0.3)
settings = pbd.Settings(dt=1 / 60, iterations=8, integrator=pbd.Rattle(), solver=pbd.ConjugateSweeps(4))
outcome = pbd.Simulation(None, [contacts], bodies=bodies, gravity=-9.81 * up, settings=settings).run(steps)
motion = [array.ravel().tolist() for array in outcome.bodies]
print(json.dumps([outcome.status, outcome.projections, outcome.pairs, *motion]))
"""


def run(tmp_path, kind, *arguments):
    """The scene is a file of its own, as the kernel cache wants one."""
    script = tmp_path / "small_heap.py"
    script.write_text(RUN)
    plain = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
    environment = {**plain, kind: "1"} if kind else plain
    command = [sys.executable, str(script), kind, *map(str, arguments)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def motions(tmp_path, kind, *arguments):
    """Of the compiled kernel, and of the other kind; both did as many steps and sought the same pairs."""
    one, other = run(tmp_path, "", *arguments), run(tmp_path, kind, *arguments)
    assert one[0] == other[0] == "ok"
    assert min(one[1], other[1]) > 20
    return [[np.array(array) for array in result[3:]] for result in (one, other)]


@pytest.mark.parametrize(("d", "count", "steps"), [(2, 3, 30), (3, 1, 30)])
def test_plain_python_gives_the_same(d, count, steps, tmp_path):
    """Three bodies that fall on each other in the plane; in space one box that tumbles over the floor."""
    for one, other in zip(*motions(tmp_path, "NUMBA_DISABLE_JIT", d, count, steps), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


def test_plain_python_gives_nearly_the_same_in_space(tmp_path):
    """Of bodies that slide on each other sweeps leave a part, and round-off decides how much."""
    positions, others = (motion[0] for motion in motions(tmp_path, "NUMBA_DISABLE_JIT", 3, 3, 8))
    np.testing.assert_allclose(positions, others, atol=1e-3)


@pytest.mark.parametrize(("kind", "d"), [("NUMBA_BOUNDSCHECK", 2), ("NUMBA_DISABLE_JIT", 3)])
def test_bounds_are_kept(kind, d, tmp_path):
    """A heap that falls together, between walls; an index out of bounds ends the process.

    In space plain Python's arrays check the same: that takes 12 s, and to compile a kernel with checks a minute.
    """
    positions, others = (motion[0] for motion in motions(tmp_path, kind, d, 14, 120))
    assert np.abs(others).max() < 20.0
    np.testing.assert_allclose(positions.mean(), others.mean(), atol=0.05)
