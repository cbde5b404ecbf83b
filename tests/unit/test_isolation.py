"""Faults of an engine in its child process cost that run alone, which says what happened."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from comparisons import isolation
from comparisons.record import RunSpec

ROOT = Path(__file__).resolve().parents[2]

ENGINE = (
    f"""
LIMIT = {isolation.MEMORY}
"""
    + '''
"""An engine that fails on demand."""

import os
import signal
import sys
import time
from dataclasses import dataclass

import numpy as np

from comparisons.trajectory import Trajectory
from pbd import fields

TITLE, FOREIGN, PRESETS = "faulty", True, {"default": {}}
FAULTS = (
    "none", "segv", "abrt", "kill", "hang", "deaf", "flood", "exit", "leave", "raise", "memory", "recursion",
    "garbage", "silence",
)


@dataclass(frozen=True)
class Settings:
    fault: str = fields.choice("none", FAULTS, "what goes wrong")

    def __post_init__(self):
        fields.check(self, "settings")


def missing():
    return ""


def version():
    return "1"


def unsupported(scene, settings):
    return ""


def prepare(scene, settings):
    return lambda: run(scene, settings.fault)


def run(scene, fault):
    if fault in ("segv", "abrt", "kill"):
        os.kill(os.getpid(), getattr(signal, "SIG" + fault.upper()))
    if fault == "hang":
        while True:
            pass
    if fault == "deaf":
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, signal.SIG_IGN)
        time.sleep(1000)
    if fault == "flood":
        block = b"x" * 2**20
        for _ in range(100):
            os.write(1, block)
            os.write(2, block[:1024])
        print("from Python too", flush=True)
    if fault == "exit":
        sys.exit(0)
    if fault == "leave":
        os._exit(0)
    if fault == "raise":
        raise RuntimeError("the engine's own words")
    if fault == "memory":
        np.empty(LIMIT + 2**30, dtype=np.uint8)  # address space alone, so that it succeeds where nothing limits it
    if fault == "recursion":
        run(scene, fault)
        raise AssertionError
    if fault == "garbage":  # on every stream it can find, in the place of an answer
        for number in range(3, 30):
            try:
                os.write(number, (1).to_bytes(8, "little") + bytes([0xC1]))
            except OSError:
                pass
        time.sleep(1000)
    if fault == "silence":
        for number in range(1, 30):
            try:
                os.close(number)
            except OSError:
                pass
        time.sleep(1000)
    x = np.repeat(scene.masses.positions[None], len(scene.times), axis=0)
    return Trajectory(scene.times, x, 0.0 * x, steps=7, work={"answers": 42})
'''
)


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """A copy of the packages with one more engine, which fails on demand."""
    place = tmp_path_factory.mktemp("packages")
    for package in ("comparisons", "pbd", "reports"):
        shutil.copytree(ROOT / package, place / package, ignore=shutil.ignore_patterns("__pycache__"))
    (place / "comparisons/engines/faulty.py").write_text(ENGINE)
    return place


@pytest.fixture(scope="module")
def survivor(packages):
    """A worker whose children find the faulty engine; the tests use it one after the other."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(packages)
        patch.setenv("PYTHONPATH", str(packages))
        worker = isolation.Worker()
        worker.run(spec("none"))
        yield worker
        worker.close()


def spec(fault):
    return RunSpec(
        scene="pendulum_chain",
        engine="faulty",
        parameters={"duration": 0.1, "samples": 10},
        settings={"fault": fault},
    )


def assert_works(worker):
    trajectory = worker.run(spec("none"))
    assert trajectory.steps == 7
    assert trajectory.work == {"answers": 42}
    assert trajectory.positions.shape == (11, 2, 2)
    np.testing.assert_allclose(trajectory.positions[-1], [[0.0, 0.0], [1.0, 0.0]], atol=1e-15)


FATAL = {
    "segv": ("crashed", "signal SIGSEGV"),
    "abrt": ("crashed", "signal SIGABRT"),
    "kill": ("crashed", "signal SIGKILL"),
    "exit": ("crashed", "exit code 0"),
    "leave": ("crashed", "exit code 0"),
    "hang": ("timeout", "no result within 0.5 s"),
    "deaf": ("timeout", "no result within 0.5 s"),
    "garbage": ("crashed", "no answer"),
    "silence": ("crashed", "no answer"),
}


@pytest.mark.parametrize("fault", FATAL)
def test_a_child_that_is_lost_costs_its_run_alone(fault, survivor, monkeypatch):
    code, what = FATAL[fault]
    assert_works(survivor)
    child = survivor._child
    monkeypatch.setattr(survivor, "timeout", 0.5 if code == "timeout" else 60.0)
    start = time.monotonic()
    with pytest.raises(isolation.Lost) as lost:
        survivor.run(spec(fault))
    assert time.monotonic() - start < 5.0, "a lost child is noticed"
    assert lost.value.code == code
    assert what in lost.value.what
    assert lost.value.remedy
    assert child.poll() is not None, "nothing is left running"
    monkeypatch.undo()
    assert_works(survivor)


MENDED = {"raise": "RuntimeError: the engine's own words", "memory": "MemoryError", "recursion": "RecursionError"}


@pytest.mark.parametrize("fault", MENDED)
def test_an_exception_in_the_child_is_told_and_the_child_lives_on(fault, survivor):
    assert_works(survivor)
    child = survivor._child
    with pytest.raises(isolation.Lost) as lost:
        survivor.run(spec(fault))
    assert lost.value.code == "crashed"
    assert MENDED[fault] in lost.value.what
    assert_works(survivor)
    assert survivor._child is child


def test_a_flood_of_output_disturbs_nothing(survivor, capfd):
    survivor.close()  # a new child has the streams that are watched here
    assert survivor.run(spec("flood")).steps == 7
    assert_works(survivor)
    out, err = capfd.readouterr()
    assert (out, err) == ("", ""), "what an engine writes does not reach the terminal"


def test_times_are_lost_like_runs(survivor):
    with pytest.raises(isolation.Lost, match="SIGSEGV"):
        survivor.seconds(spec("segv"))
    assert min(survivor.seconds(spec("none"))) > 0.0


def test_a_child_that_died_between_runs_is_replaced(survivor):
    assert_works(survivor)
    os.kill(survivor._child.pid, signal.SIGKILL)
    survivor._child.wait()
    assert_works(survivor)


def test_an_interrupted_parent_leaves_no_child(survivor, monkeypatch):
    assert_works(survivor)
    child = survivor._child

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(isolation, "_read", interrupted)
        with pytest.raises(KeyboardInterrupt):
            survivor.run(spec("none"))
    assert child.poll() is not None
    assert_works(survivor)


def test_children_use_one_thread_each():
    """Threads of a numerical library would spoil the times of whatever runs beside it."""
    assert {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"} <= set(isolation.THREAD_VARIABLES)
    child = isolation._start()
    try:
        environment = b""
        while not environment:  # until the child has become the new program
            environment = Path(f"/proc/{child.pid}/environ").read_bytes()
        assert {f"{name}=1".encode() for name in isolation.THREAD_VARIABLES} <= set(environment.split(b"\0"))
    finally:
        child.kill()
        child.communicate()


@pytest.mark.parametrize(("fault", "code", "what"), [("segv", "crashed", "SIGSEGV"), ("raise", "crashed", "own words")])
def test_from_the_command_line_a_lost_run_is_a_record_and_exit_code_3(fault, code, what, packages, tmp_path):
    command = [sys.executable, "-m", "comparisons", "run", "pendulum_chain", "--engine", "faulty"]
    done = subprocess.run(
        [*command, "--set", f"fault={fault}"],
        cwd=packages,
        env={**os.environ, "PYTHONPATH": str(packages)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 3, done.stderr
    record = json.loads(done.stdout)
    assert record["status"]["code"] == code
    assert what in record["status"]["quantity"]
    assert record["metrics"] == {}
    assert record["seconds"] is None
    assert done.stderr == ""
