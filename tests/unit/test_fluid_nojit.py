"""A fluid in plain Python gives the numbers of the kernels, in both precisions, with all its terms."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np

RUN = """
import json, sys, numpy as np, numba, pbd
assert bool(numba.config.DISABLE_JIT) == (sys.argv[1] == "plain")
rng = np.random.default_rng(0)
found = []
for d, precision, terms in (
    (2, "float64", {}),
    (2, "float32", {"solids": [0, 1, 2, 3], "viscosity": 0.1}),
    (3, "float64", {"viscosity": 0.1, "confinement": 1.0, "repulsion": 0.01, "kernel": "poly6_spiky"}),
    (2, "float64", {"law": pbd.Compliance(1e-6, relation="at_most"), "confinement": 1.0}),
):
    x = rng.uniform(0.0, 0.1 * 40 ** (1 / d), (40, d))
    masses, solids = np.full(40, 1000 * 0.1**d), terms.get("solids", [])
    masses[solids] *= 0.5
    particles = pbd.particles(x, velocities=rng.normal(size=(40, d)), masses=masses, pinned=solids[:2])
    fluid = pbd.density(particles, spacing=0.1, normal=np.eye(d), **terms)
    settings = pbd.Settings(dt=0.004, iterations=2, precision=precision)
    out = pbd.Simulation(particles, [fluid], gravity=[0.0] * (d - 1) + [-9.81], settings=settings).run(6, [6])
    projections = out.projections + 12 * len(solids)
    found.append([out.status, projections, out.positions[-1].tolist(), out.velocities[-1].tolist()])
print(json.dumps(found))
"""


def results(kind):
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_DISABLE_JIT"}
    if kind == "plain":
        environment["NUMBA_DISABLE_JIT"] = "1"
    command = [sys.executable, "-c", RUN, kind]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=250)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_plain_python_gives_the_numbers_of_the_kernel():
    """One test for all cases: each of two processes would pay for them."""
    cases = zip(results("plain"), results("compiled"), (1e-11, 1e-3, 1e-11, 1e-11), strict=True)
    for plain, compiled, tolerance in cases:
        assert plain[:2] == compiled[:2] == ["ok", 480]
        for ours, theirs in zip(plain[2:], compiled[2:], strict=True):
            assert np.abs(np.subtract(ours, theirs)).max() <= tolerance * np.abs(theirs).max()
