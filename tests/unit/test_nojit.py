"""Kernels are plain Python too: with NUMBA_DISABLE_JIT=1 the same command gives the same numbers."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

CASES = {
    "pbd": ["--engine", "pbd", "--set", "dt=0.01", "--set", "damping=0.01"],
    "pbd with k": ["--engine", "pbd", "--set", "dt=0.01", "--set", "iterations=3", "--set", "k=0.9"],
    "xpbd": ["--engine", "pbd", "--set", "dt=0.01", "--set", "method=xpbd", "--set", "iterations=3"],
    "small steps": ["--engine", "pbd", "--preset", "accurate", "--set", "dt=0.01"],
    "symplectic Euler": ["--engine", "symplectic_euler", "--set", "dt=0.001"],
}
SCENE = ["--set", "scene.links=3", "--set", "scene.duration=0.2", "--set", "scene.samples=20"]
ELASTIC = ["--set", "scene.compliance=0.001"]

RUN = """
import json, sys, numba, pbd.jit
from comparisons.cli import main
assert bool(numba.config.DISABLE_JIT) == (sys.argv[1] == "plain")
for arguments in json.load(sys.stdin):
    code = main(arguments)
    if code:
        sys.exit(code)
    print("===")
"""


def records(kind, cases):
    """All cases in one process, because a process without compiled kernels starts slowly."""
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_DISABLE_JIT"}
    if kind == "plain":
        environment["NUMBA_DISABLE_JIT"] = "1"
    text = json.dumps([["run", "pendulum_chain", *case, *SCENE, *extra] for case in cases for extra in ([], ELASTIC)])
    command = [sys.executable, "-c", RUN, kind]
    done = subprocess.run(command, env=environment, input=text, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    if kind == "plain":
        assert "compiling" not in done.stderr
    return [json.loads(part) for part in done.stdout.split("===")[:-1]]


@pytest.fixture(scope="module")
def both():
    return list(zip(*(records(kind, CASES.values()) for kind in ("plain", "compiled")), strict=True))


@pytest.mark.parametrize("index", range(2 * len(CASES)))
def test_plain_python_gives_the_numbers_of_the_kernel(index, both):
    plain, compiled = both[index]
    assert plain["status"]["code"] == compiled["status"]["code"] == "ok"
    assert plain["steps"] == compiled["steps"]
    assert plain["work"] == compiled["work"]
    assert "position_error" in plain["metrics"]
    for name, value in plain["metrics"].items():
        assert value["value"] == pytest.approx(compiled["metrics"][name]["value"], rel=1e-12, abs=1e-12)


def test_the_command_itself_runs_without_compiling():
    command = [sys.executable, "-m", "comparisons", "run", "pendulum_chain", *CASES["pbd"]]
    done = subprocess.run(
        command, env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["status"]["code"] == "ok"
