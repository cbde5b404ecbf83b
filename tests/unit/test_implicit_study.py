"""The study of implicit Euler's minimiser and its metric, on a tiny cloth."""

from __future__ import annotations

import pytest

from comparisons.record import RunSpec
from comparisons.run import execute
from comparisons.studies import implicit_euler
from pbd.errors import InvalidInput

pytestmark = pytest.mark.slow

CLOTH = {"size": 5, "density": 25.0}


def record(**settings):
    parameters = {**CLOTH, "compliance": 1e-4, "duration": 0.05, "samples": 3}
    return execute(
        RunSpec(
            scene="hanging_cloth",
            engine="pbd",
            parameters=parameters,
            settings={"dt": 0.05 / 3, "method": "xpbd", **settings},
            metrics=("minimiser_distance",),
        )
    )


def test_newton_is_at_the_minimiser_and_plain_sweeps_stall():
    newton = record(solver="implicit")
    assert newton.metric("minimiser_distance") < 1e-8
    assert newton.work["Newton solves"] == 3
    few, many = (record(iterations=n).metric("minimiser_distance") for n in (1000, 4000))
    assert many > 1e-5
    assert many == pytest.approx(few, rel=1e-3), "no number of sweeps gets there"


def test_the_metric_wants_one_step_a_sample_and_springs():
    assert record(dt=0.05 / 6, solver="implicit").status.code == "refused"
    spec = RunSpec(
        scene="hanging_cloth",
        engine="pbd",
        parameters={**CLOTH, "duration": 0.05, "samples": 3},
        settings={"dt": 0.05 / 3},
        metrics=("minimiser_distance",),
    )
    assert execute(spec).status.code == "refused"


def test_the_study_measures_all_methods_in_all_cases():
    study = implicit_euler.run("hanging_cloth", scene=CLOTH, stiffness=[1e4], steps=2, rounds=1, quiet=True)
    (table,) = study.tables
    assert len(table.rows) == 2 * (len(implicit_euler.SWEEPS) + 2)
    assert {record.status.code for record in study.records} == {"ok"}
    assert [series.label for series in study.series] == [
        "sweeps, 10000 N/m, 1/60 s",
        "sweeps, 10000 N/m, 1/600 s",
        "re-synchronised, worst case",
        "Newton-CG, worst case",
    ]
    assert any("stays" in sentence for sentence in study.sentences)
    assert all(record.seconds is not None for record in study.records)


def test_bad_input_is_refused():
    for changes in ({"steps": 0}, {"engines": ["pymunk"]}, {"settings": {"pbd": {"dt": 0.1}}}):
        with pytest.raises(InvalidInput):
            implicit_euler.run("hanging_cloth", **changes)
