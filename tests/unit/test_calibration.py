"""The calibration study: its verdicts, its tables, their way into the report, and the hook that adapters may have."""

from __future__ import annotations

import re

import msgspec
import pytest

from comparisons import catalog, cli, engine, isolation
from comparisons.record import Finding, Record, Value
from comparisons.run import build_scene
from comparisons.scenes import free_fall
from comparisons.studies import calibration
from comparisons.study import Chapter, Study, Table, from_json
from pbd.errors import InvalidInput
from reports import page


@pytest.fixture(scope="module")
def study():
    return calibration.run(engines=["symplectic_euler", "pymunk"], quiet=True)


def cell(study, name, preset, question, column):
    (row,) = [row for row in study.tables[0].rows if row[:2] == [name, preset] and question in row[2]]
    return row[study.tables[0].columns.index(column)]


def test_schemes_are_told_from_where_a_mass_falls(study):
    assert cell(study, "symplectic Euler", "default", "free fall", "found") == "4.954050"
    assert "kicks, then moves" in cell(study, "symplectic Euler", "default", "free fall", "verdict")
    assert cell(study, "pymunk", "default", "free fall", "found") == "4.855950"
    assert "moves, then kicks" in cell(study, "pymunk", "default", "free fall", "verdict")
    assert "exact" in cell(study, "pymunk", "matched", "free fall", "verdict")


def test_orders_energy_and_momentum_are_told(study):
    assert "order 1" in cell(study, "pymunk", "default", "order", "verdict")
    assert "order 2" in cell(study, "pymunk", "matched", "order", "verdict")
    assert "floor" in cell(study, "symplectic Euler", "matched", "order", "verdict")
    assert cell(study, "pymunk", "matched", "energy", "verdict") == "kept"
    assert "m g L" in cell(study, "pymunk", "default", "energy", "verdict")
    assert cell(study, "pymunk", "default", "pair", "verdict") == "kept"


def test_what_only_one_engine_shows_comes_from_its_child(study):
    rows = study.tables[1].rows
    assert {row[0] for row in rows} == {"pymunk"}
    assert any("collision_slop" in row[-1] for row in rows)


def record(metric, value, **settings):
    plain = dict.fromkeys(("key", "scene", "engine", "version", "method", "preset"), "")
    metrics = {metric: Value(value, "m")}
    return Record(**plain, parameters={}, settings=settings, dt=0.01, steps=1, seed=0, metrics=metrics)


@pytest.mark.parametrize(("fall", "words"), [(4.607, "damped"), (9.71, "too fast"), (4.905, "exact")])
def test_a_fall_that_no_scheme_explains_is_called_so(fall, words):
    assert words in calibration._fall([record("fall", fall)])[2]


def test_sub_steps_count_in_the_closed_form():
    assert "h = 0.002 s" in calibration._fall([record("fall", 4.91481, substeps=5)])[2]


def test_free_fall_is_the_parabola():
    from comparisons import reference

    parameters = free_fall.Parameters(speed=7.0, angle=60.0, gravity=3.7)
    scene = free_fall.build(parameters)
    exact = free_fall.exact(parameters, scene.times)
    assert abs(reference.solve(scene).positions[:, 0] - exact).max() < 1e-12


def test_a_free_rigid_pair_turns_as_a_stiff_one():
    import numpy as np

    from comparisons import reference

    rigid, stiff = (
        reference.solve(build_scene("free_pair", {"gravity": 9.81, **changes}), 1e-10, 1e-10).positions
        for changes in ({}, {"compliance": 1e-7})
    )
    assert np.abs(rigid - stiff).max() < 1e-5


# ------------------------------------------------------------------ an engine that is absent, a child that is lost


def test_an_absent_engine_is_left_out_with_its_remedy(monkeypatch):
    monkeypatch.setattr(engine.load("pymunk"), "missing", lambda: "pip install pymunk")
    study = calibration.run(engines=["symplectic_euler", "pymunk"], quiet=True)
    assert [(o.engine, o.remedy) for o in study.omissions] == [("pymunk", "pip install pymunk")]
    assert {row[0] for row in study.tables[0].rows} == {"symplectic Euler"}
    assert study.tables[1].rows == []


def test_a_calibration_that_kills_its_child_is_a_row(monkeypatch):
    def lost(self, name):
        raise isolation.Lost("crashed", "the engine's process ended with signal SIGABRT", "")

    monkeypatch.setattr(isolation.Worker, "findings", lost)
    study = calibration.run(engines=["symplectic_euler"], quiet=True)
    assert "SIGABRT" in study.tables[1].rows[0][-1]


def test_engines_without_the_hook_find_nothing():
    with isolation.Workers() as workers:
        assert workers["symplectic_euler"].findings("symplectic_euler") == []


@pytest.mark.parametrize("name", [n for n in catalog.names("engines") if hasattr(engine.load(n), "calibrate")])
def test_every_hook_gives_findings(name):
    if engine.load(name).missing():
        pytest.skip(engine.load(name).missing())
    with isolation.Workers() as workers:
        found = workers[name].findings(name)
    assert found
    assert all(isinstance(one, Finding) and one.what and one.verdict for one in found)


def test_bad_input_ends_before_anything_runs(monkeypatch):
    monkeypatch.setattr(isolation, "_start", lambda: pytest.fail("an engine was reached"))
    for asked in ({"engines": ["dop853"]}, {"engines": ["nothing"]}, {"settings": {"pymunk": {"iterations": 3}}}):
        with pytest.raises(InvalidInput):
            calibration.run(**asked, quiet=True)


# ------------------------------------------------------------------ tables


def test_tables_survive_json_and_are_printed(study, tmp_path):
    study.to_json(tmp_path / "study.json")
    again = from_json(tmp_path / "study.json")
    assert again.tables == study.tables
    assert study.table().startswith(study.tables[0].title)
    assert study.tables[1].title in study.table()


def test_the_report_shows_tables_without_figures(study, tmp_path):
    odd = Table(title="Odd", columns=["a", "verdict"], rows=[["|x| < 1", "trap: <b>"]])
    shown = msgspec.structs.replace(study, tables=[*study.tables, odd])
    page.write([Chapter(heading="Calibration", caption="", studies=[shown])], tmp_path)
    html, markdown = (tmp_path / "index.html").read_text(), (tmp_path / "report.md").read_text()
    for table in study.tables:
        assert f"<h3>{table.title}</h3>" in html
        assert f"### {table.title}" in markdown
    assert "trap: &lt;b&gt;" in html
    assert r"\|x\| < 1" in markdown
    assert re.search(r"\| engine \| settings \|.*\n\|---\|---\|.*\n\| ", markdown)
    assert not (tmp_path / "figures").exists()


def test_the_command_takes_no_scene(monkeypatch, capsys, study):
    asked = {}

    def run(**arguments) -> Study:
        asked.update(arguments)
        return study

    monkeypatch.setattr(calibration, "run", run)
    assert cli.main(["calibration", "--engines", "pymunk"]) == 0
    assert asked == {"engines": ["pymunk"], "settings": {}}
    assert study.tables[0].title in capsys.readouterr().out
    assert cli.main(["calibration", "--set", "scene.links=2"]) == cli.BAD_INPUT
    with pytest.raises(SystemExit):
        cli.main(["calibration", "pendulum_chain"])


def test_engines_that_step_no_particles_are_named_not_asked():
    study = calibration.run(engines=["symplectic_euler", "rattle"], quiet=True)
    assert {row[0] for row in study.tables[0].rows} == {"symplectic Euler"}
    assert [(omission.engine, omission.reason) for omission in study.omissions] == [("rattle", "it has no particles")]
