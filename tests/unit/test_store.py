"""Finished work is kept through kills, damage, second writers and places where nothing can be written."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import subprocess
import sys

import msgspec
import numpy as np
import pytest

from comparisons import engine, reference, store
from comparisons.record import Record, RunSpec, Seconds, Status, Value
from comparisons.run import build_scene

SPEC = RunSpec(scene="pendulum_chain", engine="dop853", settings={"rtol": 1e-6})


def record_of(spec=SPEC, **changes):
    usual = {"version": "1", "method": spec.engine, "dt": None, "steps": 10, "seed": 0, "wall": 0.5}
    usual |= {"key": spec.key(), "scene": spec.scene, "parameters": spec.parameters, "engine": spec.engine}
    usual |= {"preset": spec.preset, "settings": spec.settings, "metrics": {"position_error": Value(0.125, "m")}}
    return Record(**{**usual, **changes})


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    """An empty memory and no file, before and after."""
    monkeypatch.setattr(store, "_memory", {})
    store.close_file()
    yield
    store.close_file()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "folder" / "runs.sqlite"


def forget():
    """As a new process has it: the file alone remembers."""
    store._memory.clear()


def numbered(k):
    return msgspec.structs.replace(SPEC, seed=k)


# ------------------------------------------------------------------ what is kept


def test_a_record_comes_back_as_it_was(path):
    store.open_file(path)
    assert store._file[0].execute("PRAGMA journal_mode").fetchone() == ("wal",), "the mode that a kill cannot hurt"
    assert store.load_record(SPEC) is None
    record = record_of(work={"projections": 2**60}, status=Status(code="drifting", step=3, quantity="energy"))
    store.save_record(SPEC, record)
    assert store.load_record(SPEC) == record
    forget()
    store.open_file(path)
    assert store.load_record(SPEC) == record


def test_without_a_file_the_memory_keeps(path):
    store.save_record(SPEC, record_of())
    assert store.load_record(SPEC) == record_of()
    forget()
    assert store.load_record(SPEC) is None


@pytest.mark.parametrize(
    "change",
    [{"seed": 1}, {"settings": {"rtol": 1e-7}}, {"parameters": {"links": 2}}, {"preset": "x"}, {"engine": "pbd"},
     {"metrics": ("energy_drift",)}],
)  # fmt: skip
def test_any_other_spec_is_another_entry(change, path):
    store.open_file(path)
    store.save_record(SPEC, record_of())
    assert store.load_record(msgspec.structs.replace(SPEC, **change)) is None


def test_the_order_of_settings_is_no_difference():
    settings = {"dt": 0.1, "k": 0.5}
    specs = [RunSpec(scene="s", engine="e", settings=dict(sorted(settings.items(), reverse=r))) for r in (False, True)]
    assert list(specs[0].settings) != list(specs[1].settings)
    assert specs[0].key() == specs[1].key()


def test_times_are_never_kept(path):
    store.open_file(path)
    store.save_record(SPEC, record_of(seconds=Seconds(min=1.0, repeats=3, overhead=0.1)))
    assert store.load_record(SPEC).seconds is None
    forget()
    assert store.load_record(SPEC) == record_of(seconds=None)
    assert b'"seconds":null' in sqlite3.connect(path).execute("SELECT value FROM entries").fetchone()[0]


@pytest.mark.parametrize("code", ["crashed", "timeout", "unsupported"])
def test_what_may_end_otherwise_is_tried_anew(code, path):
    store.open_file(path)
    store.save_record(SPEC, record_of(status=Status(code=code), metrics={}))
    assert store.load_record(SPEC) is None


def test_another_version_or_source_is_a_miss(path, monkeypatch):
    store.open_file(path)
    store.save_record(SPEC, record_of())
    usual = store.version
    monkeypatch.setattr(store, "version", lambda name: usual(name) + ("+1" if name == "numpy" else ""))
    store.environment.cache_clear()
    try:
        assert store.load_record(SPEC) is None
    finally:
        monkeypatch.undo()
        store.environment.cache_clear()
    store.open_file(path)
    assert store.load_record(SPEC) == record_of(), "and back again it is found"


@pytest.mark.parametrize("package", ["comparisons", "pbd"])
def test_the_environment_is_every_source(package, tmp_path, monkeypatch):
    for name in ("comparisons", "pbd"):
        (tmp_path / name / "deep").mkdir(parents=True)
        (tmp_path / name / "deep" / "module.py").write_text("x = 1\n")
    monkeypatch.setattr(store, "__file__", str(tmp_path / "comparisons" / "store.py"))
    digests = []
    for text in ("x = 1\n", "x = 2\n", "x = 1\n"):
        (tmp_path / package / "deep" / "module.py").write_text(text)
        store.environment.cache_clear()
        digests.append(store.environment())
    store.environment.cache_clear()
    assert digests[0] == digests[2] != digests[1]


def test_another_version_of_the_engine_is_a_miss(path, monkeypatch):
    """pymunk 7.1 may move otherwise than pymunk 7.0."""
    store.open_file(path)
    store.save_record(SPEC, record_of())
    monkeypatch.setattr(engine.load("dop853"), "version", lambda: "another")
    store._engine_version.cache_clear()
    try:
        assert store.load_record(SPEC) is None
    finally:
        store._engine_version.cache_clear()


# ------------------------------------------------------------------ damage


def filled(path, count=5):
    store.open_file(path)
    for k in range(count):
        store.save_record(numbered(k), record_of(numbered(k), steps=k))
    store.close_file()
    forget()


@pytest.mark.parametrize("damage", ["text", "head", "truncated"])
def test_a_damaged_file_is_set_aside_and_work_goes_on(damage, path, capsys):
    filled(path, 200)
    content = path.read_bytes()
    assert len(content) > 2**13
    spoilt = {"text": b"no database\n" * 100, "head": b"\xff" * 100 + content[100:], "truncated": content[:5000]}[
        damage
    ]
    path.write_bytes(spoilt)
    store.open_file(path)
    store.save_record(SPEC, record_of())
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert str(path) in said
    assert "set aside as runs.sqlite.damaged" in said
    assert path.with_name("runs.sqlite.damaged").read_bytes() == spoilt, "set aside, not deleted"
    forget()
    store.open_file(path)
    assert store.load_record(SPEC) == record_of()


@pytest.mark.parametrize("seed", range(4))
def test_pages_damaged_behind_a_sound_head_are_never_reported(seed, path):
    filled(path, 200)
    content = bytearray(path.read_bytes())
    rng = np.random.default_rng(seed)
    for place in rng.integers(4096, len(content), 300):
        content[place] ^= 1 << rng.integers(8)
    path.write_bytes(content)
    store.open_file(path)
    found = [store.load_record(numbered(k)) for k in range(200)]
    assert None in found, "the damage hit something"
    assert all(record is None or record.steps == k for k, record in enumerate(found))
    store.save_record(SPEC, record_of())
    assert store.load_record(SPEC) == record_of(), "work goes on, if need be in memory"


@pytest.mark.parametrize("bit", [0, 800, -1])
def test_a_flipped_bit_is_a_miss(bit, path):
    filled(path)
    with sqlite3.connect(path) as connection:
        key, value = connection.execute("SELECT key, value FROM entries LIMIT 1").fetchone()
        spoilt = bytearray(value)
        spoilt[bit // 8] ^= 1 << (bit % 8)
        connection.execute("UPDATE entries SET value = ? WHERE key = ?", (bytes(spoilt), key))
    connection.close()
    store.open_file(path)
    found = [store.load_record(numbered(k)) for k in range(5)]
    assert found.count(None) == 1
    assert [r.steps for r in found if r] == [k for k, r in enumerate(found) if r]


# ------------------------------------------------------------------ places


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs a directory that not even root may write to")
def test_a_read_only_directory_leaves_the_memory(capsys):
    from pathlib import Path

    store.open_file(Path("/proc/self/runs.sqlite"))
    store.save_record(SPEC, record_of())
    assert store.load_record(SPEC) == record_of()
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "not kept on disk" in said
    assert "set aside" not in said


def test_a_file_in_the_place_of_the_directory_leaves_the_memory(tmp_path, capsys):
    (tmp_path / "taken").write_text("precious")
    store.open_file(tmp_path / "taken" / "runs.sqlite")
    store.save_record(SPEC, record_of())
    assert store.load_record(SPEC) == record_of()
    assert (tmp_path / "taken").read_text() == "precious"
    assert "not kept on disk" in capsys.readouterr().err


def test_a_directory_in_the_place_of_the_file_stays_where_it_is(tmp_path, capsys):
    (tmp_path / "runs.sqlite").mkdir()
    (tmp_path / "runs.sqlite" / "precious").write_text("x")
    store.open_file(tmp_path / "runs.sqlite")
    store.save_record(SPEC, record_of())
    assert store.load_record(SPEC) == record_of()
    assert (tmp_path / "runs.sqlite" / "precious").read_text() == "x"
    assert "not kept on disk" in capsys.readouterr().err


def test_a_disk_that_fills_up_loses_nothing_that_was_kept(path, capsys):
    store.open_file(path)
    store.save_record(SPEC, record_of())
    store._file[0].execute("PRAGMA max_page_count = 4")
    many = [numbered(k) for k in range(1, 100)]
    for spec in many:
        store.save_record(spec, record_of(spec))
    assert capsys.readouterr().err.count("results are not kept on disk") == 1
    assert all(store.load_record(spec) == record_of(spec) for spec in many)
    forget()
    store.open_file(path)
    assert store.load_record(SPEC) == record_of()


# ------------------------------------------------------------------ other processes

WRITER = """
import sys
from pathlib import Path
from comparisons import store
from comparisons.record import Record, RunSpec
store.environment = lambda: sys.argv[4]  # not what an edit in the meantime makes of it
store.open_file(Path(sys.argv[1]))
first, count = int(sys.argv[2]), int(sys.argv[3])
for k in range(first, first + count):
    spec = RunSpec(scene="pendulum_chain", engine="dop853", settings={"rtol": 1e-6}, seed=k)
    known = dict(key=spec.key(), scene=spec.scene, parameters={}, engine=spec.engine, version="1", method="dop853")
    record = Record(**known, preset="default", settings=spec.settings, dt=None, steps=k, seed=k)
    store.save_record(spec, record)
    print(k, flush=True)
"""


def writer(path, first, count):
    command = [sys.executable, "-c", WRITER, str(path), str(first), str(count), store.environment()]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_two_processes_may_write_at_once(path):
    processes = [writer(path, first, 300) for first in (0, 1000)]
    for process in processes:
        _, error = process.communicate(timeout=60)
        assert process.returncode == 0
        assert error == "", "no entry was given up"
    store.open_file(path)
    for k in [*range(300), *range(1000, 1300)]:
        found = store.load_record(numbered(k))
        assert found is not None, k
        assert found.steps == k


def test_a_kill_keeps_all_that_was_finished(path):
    """What the writer announced was finished; it is there after SIGKILL, whole, in a file that still takes entries."""
    process = writer(path, 0, 10**6)
    for line in process.stdout:
        if int(line) == 150:
            break
    process.send_signal(signal.SIGKILL)
    announced = 151 + len(process.stdout.read().split())
    process.wait()
    process.stderr.close()
    for backup in (False, True):  # as it lies there, and after somebody copied all its files
        if backup:
            store.close_file()
            shutil.copytree(path.parent, path.parent.with_name("copy"))
            path = path.parent.with_name("copy") / path.name
        forget()
        store.open_file(path)
        assert [store.load_record(numbered(k)).steps for k in range(announced)] == list(range(announced))
        store.save_record(numbered(10**7), record_of(numbered(10**7)))


# ------------------------------------------------------------------ references


@pytest.mark.parametrize("compliance", [0.0, 1e-3])
def test_a_reference_is_computed_once_and_comes_back_bit_for_bit(compliance, path, monkeypatch):
    scene = build_scene("pendulum_chain", {"links": 2, "compliance": compliance, "duration": 0.3, "samples": 7})
    expected = reference.solve(scene).positions
    store.open_file(path)
    first, horizon = store.reference(scene)
    np.testing.assert_array_equal(first, expected)
    assert horizon == np.inf
    monkeypatch.setattr(reference, "solve", None)
    for _ in range(2):
        again, limit = store.reference(scene)
        np.testing.assert_array_equal(again, expected)
        assert (again.shape, again.dtype, limit) == ((8, 3, 2), np.float64, np.inf)
        forget()


@pytest.mark.parametrize(
    "change", [{"masses": 2.0}, {"angles": 80.0}, {"lengths": 0.4}, {"samples": 4}, {"duration": 0.2}, {"gravity": 9.8},
               {"compliance": 1e-3}, {"stretch": 1.01, "compliance": 2e-3}],
)  # fmt: skip
def test_a_reference_belongs_to_one_scene(change):
    base = {"links": 2, "compliance": 2e-3, "duration": 0.1, "samples": 5}
    assert store._digest(build_scene("pendulum_chain", base)) == store._digest(build_scene("pendulum_chain", base))
    other = build_scene("pendulum_chain", {**base, **change})
    assert store._digest(build_scene("pendulum_chain", base)) != store._digest(other)


def test_compliances_tell_scenes_apart():
    rigid, elastic = (build_scene("pendulum_chain", {"compliance": c}) for c in (0.0, 1e-3))
    assert store._digest(rigid) != store._digest(elastic)
