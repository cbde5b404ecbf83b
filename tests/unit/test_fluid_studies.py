"""Studies of fluids, on tiny sizes: what they measure, say, leave out and refuse; times are never asserted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from PIL import Image

from comparisons.engines import pbf
from comparisons.isolation import Workers
from comparisons.record import Record, Status
from comparisons.run import build_scene
from comparisons.studies import (
    _fluids,
    blow_up,
    dam_break,
    density_stiffness,
    fluid_convergence,
    fluid_throughput,
    front_reference,
)
from comparisons.study import from_json
from pbd.errors import InvalidInput


@pytest.fixture(scope="module")
def pool():
    with Workers() as found:
        yield found


@pytest.fixture(scope="module")
def broken(pool):
    return dam_break.run(engines=["pbf"], across=[5, 10], shown=10, rounds=1, workers=pool, quiet=True)


def labels(study, panel):
    return [series.label for series in study.series if series.panel == panel]


def test_a_dam_break_has_curves_over_experiments(broken):
    ours = ["PBF", "PBF from rest, fast", "XPBD fluid", "PBF from rest, accurate"]
    assert [label for label in labels(broken, "front") if "PBF" in label or "XPBD" in label] == ours
    assert {"Martin and Moyce, table 2", "Koshizuka and Oka", "numerical reference"} <= set(labels(broken, "front"))
    assert "Martin and Moyce, table 6" in labels(broken, "height")
    curve = next(s for s in broken.series if s.panel == "front" and s.label == "PBF")
    assert curve.y[0] == pytest.approx(1.0)
    assert curve.x[-1] == pytest.approx(3.0)


def test_a_dam_breaks_tables_tell_raw_distances_before_shifts(broken):
    accuracy, experiments = broken.tables
    assert len(accuracy.rows) == 1 + 4 * 2
    assert experiments.columns[2:] == ["rms as it is", "ahead by", "rms after that shift"]
    assert experiments.rows[0][0] == "numerical reference"
    for row in experiments.rows:
        assert float(row[2]) >= float(row[4]) - 1e-3, "a shift leaves no more than there was"


def test_a_dam_break_is_filmed(broken, tmp_path):
    (film,) = broken.films
    assert film.label == "PBF from rest, fast"
    assert [film.times[k] for k in film.moments] == pytest.approx([0.0, 1.0, 2.0, 3.0])
    broken.plot(tmp_path / "film.gif")
    broken.plot_moments(tmp_path / "moments.png")
    broken.plot(tmp_path / "curves.png")
    with Image.open(tmp_path / "film.gif") as drawn:
        assert drawn.n_frames == len(film.times)
    with Image.open(tmp_path / "moments.png") as sheet:
        assert sheet.height > sheet.width / 8
    broken.to_json(tmp_path / "study.json")
    assert from_json(tmp_path / "study.json") == broken


def test_the_blow_up_map_tells_what_holds(pool):
    study = blow_up.run(courant=[0.16, 1.28], omega=[0.25, 2.0], iterations=[1], workers=pool, quiet=True)
    points = {(s.kind, x, y) for s in study.series for x, y in zip(s.x, s.y, strict=True)}
    assert ("held", 0.16, 0.25) in points
    assert ("failed", 1.28, 2.0) in points
    assert len(points) == 4
    assert study.sentences == ["1 iteration: every step tried holds up to omega = 0.25; 2 of 4 points blow up."]


def test_stiffness_of_a_fluid_has_every_law(pool, monkeypatch):
    monkeypatch.setattr(
        density_stiffness, "CALM", {"omega": 0.5}
    )  # without viscosity, which would compile more kernels
    study = density_stiffness.run(across=6, iterations=[1, 4], k=[0.5], compliance=[1e-3], workers=pool, quiet=True)
    assert labels(study, "density_error") == [
        "k = 1", "k' = 0.5", "k = 0.5", "alpha = 0 /J (XPBD)", "alpha = 0.001 /J (XPBD)", "alpha m g H/2",
    ]  # fmt: skip
    found = {s.label: s.y for s in study.series if s.panel == "density_error"}
    assert found["k = 0.5"][1] < 0.5 * found["k = 0.5"][0], "raw k stiffens with iterations"
    assert found["k' = 0.5"][1] > 0.6 * found["k' = 0.5"][0], "k' hardly does"
    assert math.isclose(found["alpha = 0 /J (XPBD)"][0], found["k = 1"][0], rel_tol=1e-6), "one sweep of both is one"


def test_convergence_is_towards_each_lines_own_finest(pool):
    study = fluid_convergence.run(
        engines=["pbf"], across=[4, 8], courant=[0.32, 0.16], substeps=[1, 2], iterations=[2, 4], resolution=5,
        workers=pool, quiet=True,
    )  # fmt: skip
    assert set(labels(study, "across")) <= {"PBF", "PBF from rest", "XPBD fluid"}
    assert {panel.name for panel in study.panels} >= {"across", "courant", "compression, substeps"}
    line = next(s for s in study.series if s.panel == "across" and s.label == "PBF")
    assert line.x == [0.25], "the finest point is the limit, and not drawn"
    squeezed = next(s for s in study.series if s.panel == "compression, substeps" and s.label == "PBF")
    assert squeezed.y[1] < squeezed.y[0]


def test_throughput_counts_neighbours_and_threads(pool):
    study = fluid_throughput.run(
        engines=["pbf"], across=[10, 12], solids=None, threads=1, rounds=1, workers=pool, quiet=True
    )
    assert set(labels(study, "2D")) == {"PBF", "PBF from rest, fast", "PBF from rest, fast, 1 threads"}
    (table,) = study.tables
    assert all(15.0 < float(row[3]) < 21.0 for row in table.rows)
    assert all(float(row[2]) > 0.0 for row in table.rows)


def test_threads_reach_the_solver():
    bound = pbf._simulation(build_scene("dam_break", {"across": 10}), pbf.Settings(threads=2), 1e-3)
    assert bound.settings.threads == 2


def test_limits_are_extrapolated_from_straight_lines():
    spacings = np.array([0.1, 0.05, 0.025])
    fronts = 2.0 - 3.0 * spacings[:, None] + np.zeros((1, 4))
    one = front_reference.Limit(_fluids.PBF, spacings, fronts)
    other = front_reference.Limit(_fluids.WCSPH, spacings, fronts + 0.02)
    assert one.values == pytest.approx(2.0)
    assert one.scatter == pytest.approx(0.0, abs=1e-12)
    rows = front_reference.table_of([one, other])
    assert rows[:, 1] == pytest.approx(2.01)
    assert rows[:, 2] == pytest.approx(0.02)


def test_engines_without_results_are_named():
    status = Status(code="crashed", quantity="ended with signal SIGSEGV", remedy="update it")
    record = Record(
        key="", scene="dam_break", parameters={}, engine="pymunk", version="", method="", preset="default", settings={},
        dt=None, steps=0, seed=0, status=status,
    )  # fmt: skip
    assert [(o.engine, o.reason) for o in _fluids.lost([record])] == [("pymunk", status.quantity)]


@pytest.mark.parametrize(
    ("study", "wrong"),
    [
        (dam_break, {"engines": ["rattle"]}),
        (dam_break, {"settings": {"pbf": {"k": 0.5}}}),
        (dam_break, {"across": []}),
        (blow_up, {"engines": ["pymunk"]}),
        (blow_up, {"omega": [3.0]}),
        (density_stiffness, {"iterations": [0]}),
        (fluid_convergence, {"across": [2.5]}),
        (fluid_throughput, {"threads": 0}),
        (front_reference, {"across": [10]}),
    ],
)
def test_bad_input_is_refused_before_anything_runs(study, wrong):
    with pytest.raises(InvalidInput):
        study.run(quiet=True, **wrong)
