"""Every scene in every engine: each pair runs or says why not. A new one is one new file."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from comparisons import catalog, engine, isolation, reference
from comparisons.record import STATUSES, RunSpec
from comparisons.run import build_scene, execute
from comparisons.studies import work_precision
from pbd import fields

ROOT = Path(__file__).resolve().parents[2]
SMALL = {"links": 2, "density": 16.0, "duration": 0.1, "samples": 10}
"""Parameters that make a scene small, and its masses about 1 kg, where it has them."""

FEW = {"hanging_cloth": {"size": 4}, "stack": {"count": 3}, "pile": {"count": 4}, "dominoes": {"count": 3}}
FEW["falling_boxes"] = {"count": 4}
FEW["dam_break"] = {"across": 4, "duration": 1.0, "samples": 4, "gravity": 12.5}
FEW |= {name: {"across": 5} for name in ("hydrostatic_column", "falling_blob", "two_blobs")}
FEW["floating_box"] = {"across": 8, "box": 2}
"""The same of single scenes."""

NEAR = 0.05
"""No pair that runs is farther from the motion of its scene [m], or its rigid links from their length [1]."""

KINDS = {"rigid": {}, "compliant": {"compliance": 1e-4}}
ENGINES = catalog.names("engines")
PAIRS = [(scene, name) for scene in catalog.names("scenes") for name in ENGINES]
PRESETS = [(scene, name, preset) for scene, name in PAIRS for preset in engine.load(name).PRESETS]


def kinds_of(scene):
    """All kinds of a scene that has compliance, else the first."""
    return list(KINDS) if "compliance" in fields.rules(catalog.load("scenes", scene).Parameters) else ["rigid"]


RUNS = [(scene, name, preset, kind) for scene, name, preset in PRESETS for kind in kinds_of(scene)]


@pytest.fixture(scope="module")
def pool():
    with isolation.Workers() as found:
        yield found


def small(scene, kind="rigid"):
    """The parameters of SMALL and the kind that the scene has."""
    known = fields.rules(catalog.load("scenes", scene).Parameters)
    return {k: v for k, v in {**SMALL, **FEW.get(scene, {}), **KINDS[kind]}.items() if k in known}


def spec_of(scene, name, kind="rigid", **changes):
    return RunSpec(scene=scene, engine=name, parameters=small(scene, kind), **changes)


def has_reference(scene):
    if scene.bodies is not None or scene.exact is not None:
        return scene.exact is not None
    try:
        reference.form(scene)
    except reference.NoReference:
        return False
    return True


def without_wall(record):
    return msgspec.structs.replace(record, wall=0.0)


@pytest.mark.parametrize(("scene", "name", "preset", "kind"), RUNS)
def test_every_pair_and_preset_runs_or_says_why_not(scene, name, preset, kind, pool):
    spec = spec_of(scene, name, kind, preset=preset)
    runner = pool[name].run if engine.load(name).FOREIGN else None
    record, again = execute(spec, runner), execute(spec, runner)
    assert record.status.code in ("ok", "unsupported"), record.status
    assert without_wall(again) == without_wall(record), "equal specs give equal records"
    assert (record.key, record.scene, record.engine, record.preset) == (spec.key(), scene, name, preset)
    if record.status.code == "ok":
        assert record.steps > 0
        judged = build_scene(scene, spec.parameters)
        assert set(record.metrics) == set(judged.metrics)
        assert {"energy_drift", "energy_rise"} & set(record.metrics)
        other = "density_error" if judged.fluid is not None else "link_violation"
        other = other if judged.bodies is None else "penetration"
        error = "position_error" if has_reference(judged) else other
        assert record.metric(error) < NEAR, "a pair that runs comes near its scene's motion, or keeps its constraints"
    else:
        assert record.status.quantity
        assert record.status.remedy
        assert record.metrics == {}


def test_which_scenes_have_a_reference():
    """What the test above asks of a pair depends on it."""
    found = {
        (scene, kind): has_reference(build_scene(scene, small(scene, kind)))
        for scene in catalog.names("scenes")
        for kind in kinds_of(scene)
    }
    without = {pair for pair, known in found.items() if not known}
    bodies, fluids = (
        ("dominoes", "falling_boxes", "pile"),
        ("dam_break", "hydrostatic_column", "two_blobs", "floating_box"),
    )
    assert without == {(scene, "rigid") for scene in ("hanging_cloth", *bodies, *fluids)}


@pytest.mark.parametrize(("scene", "name"), PAIRS)
def test_a_run_here_and_in_a_child_are_the_same(scene, name, pool):
    spec = spec_of(scene, name)
    assert without_wall(execute(spec)) == without_wall(execute(spec, pool[name].run))


@pytest.mark.parametrize("name", ENGINES)
def test_every_engine_defines_what_an_adapter_is(name):
    adapter = engine.load(name)
    assert adapter.TITLE
    assert isinstance(adapter.FOREIGN, bool)
    assert adapter.PRESETS["default"] == {}
    scenes = [catalog.load("scenes", scene) for scene in catalog.names("scenes")]
    tried = [changes for module in scenes for changes in adapter.sweep(module.build(module.Parameters()))]
    assert tried
    for changes in [*adapter.PRESETS.values(), *tried, *getattr(adapter, "VARIANTS", [])]:
        engine.make_settings(name, "default", changes)
    for key, rule in fields.rules(adapter.Settings).items():
        assert rule.doc, f"{name}.{key} says what it is"


@pytest.mark.parametrize("name", catalog.names("metrics"))
def test_every_metric_has_unit_title_and_measure(name):
    metric = catalog.load("metrics", name)
    assert metric.UNIT
    assert metric.TITLE
    assert callable(metric.measure)


@pytest.mark.parametrize("name", catalog.names("scenes"))
def test_every_scene_asks_a_question_and_names_known_metrics(name):
    module = catalog.load("scenes", name)
    assert module.QUESTION.endswith("?")
    scene = module.build(module.Parameters())
    assert scene.name == name
    assert set(scene.metrics) <= set(catalog.names("metrics"))


# ------------------------------------------------------------------ an absent engine


@pytest.fixture
def absent(monkeypatch):
    adapter = engine.load("pymunk")
    monkeypatch.setattr(adapter, "missing", lambda: "pip install pymunk")
    monkeypatch.setattr(adapter, "prepare", None)
    return "pymunk"


def test_an_absent_engine_is_unsupported_with_its_remedy(absent):
    record = execute(spec_of("pendulum_chain", absent))
    assert record.status.code == "unsupported"
    assert absent in record.status.quantity
    assert record.status.remedy == "pip install pymunk"
    assert record.version == ""


def test_a_study_goes_on_without_an_absent_engine(absent):
    study = work_precision.run(
        "pendulum_chain", scene=small("pendulum_chain"), engines=["dop853", absent], dt=[0.01], rounds=1, quiet=True
    )
    assert [(o.engine, o.remedy) for o in study.omissions] == [(absent, "pip install pymunk")]
    assert {s.engine for s in study.series} == {"dop853"}
    assert {r.status.code for r in study.records if r.engine == absent} == {"unsupported"}


# ------------------------------------------------------------------ one new file

NEW = {
    "engines/standstill.py": '''
        """Nothing moves."""
        from dataclasses import dataclass
        import numpy as np
        from comparisons.trajectory import Trajectory
        from pbd import fields

        TITLE, FOREIGN, PRESETS = "standstill", True, {"default": {}}

        @dataclass(frozen=True)
        class Settings:
            dt: float = fields.real(1e-2, "s", 1e-12, 1e3, "time step")

        def missing(): return ""
        def version(): return "1"
        def sweep(scene): return [{}]
        def unsupported(scene, settings): return ""

        def prepare(scene, settings):
            x = np.repeat(scene.masses.positions[None], len(scene.times), axis=0)
            return lambda: Trajectory(scene.times, x, 0.0 * x, steps=7)
    ''',
    "scenes/falling_mass.py": '''
        """A mass falls."""
        from dataclasses import dataclass
        import numpy as np
        from comparisons.scene import PointMasses, Scene
        from pbd import fields

        QUESTION = "Where is it?"

        @dataclass(frozen=True)
        class Parameters:
            mass: float = fields.real(1.0, "kg", 0.0, 1e3, "its mass", above=True)

        def build(p):
            x = np.zeros((1, 2))
            masses = PointMasses(x, x, np.array([p.mass]))
            return Scene("falling_mass", "a mass", masses, (), np.array([0.0, -9.81]), 0.1, 10, ("highest_point",))
    ''',
    "metrics/highest_point.py": '''
        """How high it gets."""
        UNIT, TITLE = "m", "highest point"

        def measure(subject):
            return float(subject.trajectory.positions[..., 1].max()) + 42.0
    ''',
    "studies/count.py": '''
        """Counts to one.

        More words."""
        def run(scene_name, **_): raise SystemExit(17)
    ''',
}


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """A copy of the packages with one new file of each kind, and nothing else changed."""
    place = tmp_path_factory.mktemp("extended")
    for package in ("comparisons", "pbd", "reports"):
        shutil.copytree(ROOT / package, place / package, ignore=shutil.ignore_patterns("__pycache__"))
    for name, text in NEW.items():
        lines = text.splitlines()[1:]
        (place / "comparisons" / name).write_text("\n".join(line[8:] for line in lines))
    return place


def command(place, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "comparisons", *arguments],
        cwd=place, env={**os.environ, "PYTHONPATH": str(place)}, capture_output=True, text=True, timeout=60,
    )  # fmt: skip


def test_new_files_are_listed(extended):
    done = command(extended, "list")
    assert done.returncode == 0, done.stderr
    assert {"standstill", "falling_mass", "highest_point", "count"} <= set(done.stdout.split())
    done = command(extended, "--help")
    assert "Counts to one" in done.stdout, "a new study is a new subcommand, its first line the help"


def test_new_scene_metric_and_engine_run_together(extended):
    done = command(extended, "run", "falling_mass", "--engine", "standstill", "--set", "scene.mass=2")
    assert done.returncode == 0, done.stderr
    record = json.loads(done.stdout)
    assert record["status"]["code"] == "ok"
    assert record["parameters"] == {"mass": 2.0}
    assert record["steps"] == 7
    assert record["metrics"] == {"highest_point": {"value": 42.0, "unit": "m"}}
    assert record["status"]["code"] in STATUSES


def test_a_new_scene_runs_in_the_engines_there_are(extended):
    done = command(extended, "run", "falling_mass", "--engine", "pymunk", "--set", "dt=0.01")
    record = json.loads(done.stdout)
    assert record["status"]["code"] == "ok", done.stderr
