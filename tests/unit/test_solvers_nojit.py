"""Jacobi and the multilevel solver as plain Python, and with bounds checked: the same numbers."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

pytestmark = pytest.mark.slow

RUN = """
import json, sys, numpy as np, pbd
out = []
for solver in (pbd.Multilevel(), pbd.Multilevel(lengths="path", unilateral=True), pbd.Jacobi(1.2)):
    particles = pbd.particles([[1.1 * i, 0.2 * i * i] for i in range(6)], pinned=[0])
    batches = [pbd.distance(particles, [(i, i + 1) for i in range(5)], rest_length=1.0)]
    batches.append(pbd.plane_contact(particles, normal=(0.0, 1.0), friction=0.3))
    settings = pbd.Settings(dt=0.05, iterations=2, solver=solver)
    end = pbd.Simulation(particles, batches, gravity=(0.0, -9.81), settings=settings).run(20, [20])
    out.append([end.projections, end.positions.ravel().tolist()])
print(json.dumps(out))
"""


@pytest.mark.parametrize("flag", ["NUMBA_DISABLE_JIT", "NUMBA_BOUNDSCHECK"])
def test_plain_python_and_checked_bounds_give_the_same(flag, tmp_path):
    """The scene is a file of its own, as the kernel cache wants one."""
    script = tmp_path / "small_scene.py"
    script.write_text(RUN)
    plain = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
    outputs = []
    for environment in (plain, {**plain, flag: "1"}):
        done = subprocess.run(
            [sys.executable, str(script)], env=environment, capture_output=True, text=True, timeout=200
        )
        assert done.returncode == 0, done.stderr
        outputs.append(json.loads(done.stdout))
    for (count, end), (same_count, same_end) in zip(*outputs, strict=True):
        assert count == same_count
        np.testing.assert_allclose(end, same_end, rtol=1e-9, atol=1e-9)
