"""Studies of the solver's sweeps, on tiny sizes: what they measure, say, leave out and refuse.

Times are never asserted: only that there are some, and what is made of times that are given.
"""

from __future__ import annotations

import dataclasses
import math

import msgspec
import numpy as np
import pytest

from comparisons import engine
from comparisons.isolation import Workers
from comparisons.metrics import Refused, Subject, link_rms, projection_distance
from comparisons.record import Record, Seconds, Status, Value
from comparisons.run import build_scene
from comparisons.studies import _equal_residual, _sweeping, scaling, small_steps, solvers, throughput
from comparisons.study import from_json
from comparisons.trajectory import Trajectory
from pbd.errors import InvalidInput

CHAIN, CLOTH = "pendulum_chain", "hanging_cloth"
HAS_PEER = not engine.load("pypbd").missing()


@pytest.fixture(scope="module")
def pool():
    with Workers() as found:
        yield found


def labels(study, panel):
    return [series.label for series in study.series if series.panel == panel]


def series_of(study, panel, label):
    (found,) = [one for one in study.series if (one.panel, one.label) == (panel, label)]
    return dict(zip(found.x, found.y, strict=True))


# ------------------------------------------------------------------ throughput


@pytest.fixture(scope="module")
def chain_throughput(pool):
    return throughput.run(
        CHAIN, scene={"links": 20}, particles=[10, 50], sweeps=[200], rounds=1, brief=True, workers=pool, quiet=True
    )


def test_throughput_has_a_time_for_every_order_and_size(chain_throughput):
    by_order, to_residual = chain_throughput.tables
    ours = ["natural order", "wavefront", "coloured", "coloured (float32)"]
    peer = ["pyPBD"] if HAS_PEER else []
    shown = [row[1] for row in by_order.rows if row[0] == "PBD (k = 1)"]
    assert [label for label in shown if label != "pyPBD"] == ours
    assert {row[0] for row in by_order.rows} == {"PBD (k = 1)", "XPBD (rigid)"}
    assert by_order.columns[2:4] == ["11 particles", "51 particles"]
    assert [row[1] for row in to_residual.rows if row[3] != "-"] == ours + peer
    assert all(record.seconds is not None for record in chain_throughput.records if record.status.code == "ok")


def test_equal_residual_is_reached_with_the_sweeps_that_it_takes(chain_throughput):
    sweeps = {row[1]: int(row[2]) for row in chain_throughput.tables[1].rows if row[2].isdigit()}
    assert sweeps["natural order"] == sweeps["wavefront"] == 200, "a wavefront is natural order to the last bit"
    assert sweeps["coloured"] > 200, "red-black sweeps leave sqrt(2) of the rms"
    assert "natural sweeps" in chain_throughput.sentences[-1]


def test_what_the_study_found_survives_json_and_is_drawn(chain_throughput, tmp_path):
    chain_throughput.to_json(tmp_path / "study.json")
    assert from_json(tmp_path / "study.json") == chain_throughput
    chain_throughput.plot(tmp_path / "study.svg")
    assert "time of a projection [ns]" in (tmp_path / "study.svg").read_text()


def test_an_order_that_cannot_take_a_scene_is_left_out_with_the_reason(pool):
    study = scaling.run(CLOTH, particles=[16], engines=["pbd"], rounds=1, workers=pool, quiet=True)
    assert "wavefront" not in labels(study, "particles")
    reasons = [omission.reason for omission in study.omissions if omission.engine == "pbd"]
    assert len(reasons) == 1
    assert "wavefront" in reasons[0]
    assert {"pymunk", "shake"} <= {omission.engine for omission in study.omissions}


def test_times_are_differences_of_runs():
    plain = dict.fromkeys(("key", "scene", "engine", "version", "method", "preset"), "")
    record = Record(**plain, parameters={}, settings={}, dt=None, steps=1, seed=0)
    less, more = (
        msgspec.structs.replace(record, seconds=Seconds(min=s, repeats=1, overhead=0.0)) for s in (1e-3, 3e-3)
    )
    size = _sweeping.sized(CHAIN, {}, 9)
    assert _sweeping.step_time([less, more], size, 100) == pytest.approx(2e6 / (2 * 100 * 10))
    assert math.isnan(_sweeping.difference(record, more))
    point = throughput.Point(_sweeping.contenders("pbd")[0], size, [less, less, more])
    steps = throughput._steps(size)
    assert point.projection == pytest.approx(2e6 / (10 * steps * 9))


# ------------------------------------------------------------------ the search for equal residual


@pytest.mark.parametrize("needed", [1, 2, 5, 99, 100, 101, 160, 1000, 6399])
def test_the_search_ends_within_a_hundredth_of_what_is_needed(needed):
    ladder, found = _equal_residual.search(lambda n: n, 100, 1.0), []
    while (n := ladder(found)) is not None:
        assert len(found) < 30
        found.append(residual_record(n, 2.0 if n < needed else 0.5))
    best = _equal_residual.cheapest(found, 1.0).settings["iterations"]
    assert needed <= best <= max(needed + 1, 1.02 * needed)


def test_the_search_gives_up_on_what_never_arrives():
    ladder, found = _equal_residual.search(lambda n: n, 10, 1.0), []
    while (n := ladder(found)) is not None:
        found.append(residual_record(n, 2.0))
    assert found[-1].settings["iterations"] == 10 * _equal_residual.MOST
    assert _equal_residual.cheapest(found, 1.0) is None
    failed = msgspec.structs.replace(found[0], status=Status(code="unsupported"))
    assert ladder([failed]) is None


def residual_record(n, residual):
    plain = dict.fromkeys(("key", "scene", "engine", "version", "method", "preset"), "")
    metrics = {"link_rms": Value(residual, "1")}
    return Record(**plain, parameters={}, settings={"iterations": n}, dt=None, steps=1, seed=0, metrics=metrics)


# ------------------------------------------------------------------ scaling


def test_scaling_names_what_a_step_works_on():
    chain, cloth = (_sweeping.sized(name, {}, 100) for name in (CHAIN, CLOTH))
    natural, _, coloured = _sweeping.contenders("pbd", precisions=("float64",))[:3]
    assert scaling.working_set(natural, chain) == scaling.working_set(coloured, chain) == 8 * (101 * 7 + 100 * 2)
    more = scaling.working_set(natural, cloth) - scaling.working_set(coloured, cloth)
    assert more == cloth.links * 16, "natural order of a cloth also reads its indices"
    assert scaling.working_set(_sweeping.Contender("pyPBD", "pypbd"), chain) == 0


def test_caches_are_read_where_there_are_some(tmp_path):
    for index, (level, kind, size) in enumerate([(1, "Data", "48K"), (1, "Instruction", "32K"), (2, "Unified", "2M")]):
        folder = tmp_path / f"index{index}"
        folder.mkdir()
        for name, value in (("level", level), ("type", kind), ("size", size)):
            (folder / name).write_text(f"{value}\n")
    (tmp_path / "index9").mkdir()
    assert scaling.cache_sizes(tmp_path) == {"L1": 48 * 2**10, "L2": 2 * 2**20}
    assert scaling.cache_sizes(tmp_path / "absent") == {}


def test_the_limit_is_named():
    sizes = [_sweeping.sized(CHAIN, {}, count) for count in (1000, 3000, 10_000)]
    natural = _sweeping.contenders("pbd", precisions=("float64",))[0]
    curve = scaling.Curve(natural, list(zip(sizes, [10.0, 12.0, 30.0], strict=True)))
    said = scaling._sentence(curve, {"L1": 2**15, "L2": 2**19, "L3": 2**25})
    assert "10 to 12 ns a particle's step from 1001 to 3001 particles" in said
    assert "30 ns at 10001" in said
    assert "beyond the L2 cache of 512 kB" in said
    flat = scaling.Curve(natural, list(zip(sizes, [10.0, 9.0, 11.0], strict=True)))
    assert scaling._sentence(flat, {}).endswith("from 1001 to 10001 particles, within x1.5.")


# ------------------------------------------------------------------ small steps


@pytest.fixture(scope="module")
def steps(pool):
    return small_steps.run(CHAIN, counts=[1, 2, 5, 10, 20], rounds=1, workers=pool, quiet=True)


def test_sub_steps_are_of_order_two_and_as_their_closed_form(steps):
    """The table of the published experiment E1, as this scheme must give it."""
    sub_steps, exact = (series_of(steps, "light", label) for label in ("PBD, n sub-steps", small_steps.AT_REST))
    squares = np.array([error * n**2 for n, error in sub_steps.items()])
    assert np.ptp(squares) < 0.05 * squares.max()
    assert sub_steps[20.0] == pytest.approx(exact[20.0], rel=0.05)
    assert exact[1.0] == pytest.approx(171 * 9.81 / 3600), "19 links: 18 + 17 + ... + 1"
    assert steps.fit("pbd", panel="light", method="substeps").order == pytest.approx(2.0, abs=0.05)
    assert "n sub-steps of order 2.0" in steps.sentences[0]


def test_sub_steps_win_by_nearly_n(steps):
    iterations, sub_steps = (series_of(steps, "light", f"PBD, n {way}") for way in ("iterations", "sub-steps"))
    assert iterations[1.0] == sub_steps[1.0]
    for n in (2.0, 5.0, 10.0):
        assert iterations[n] / sub_steps[n] >= 0.7 * n
    assert list(iterations.values()) == pytest.approx([0.457, 0.233, 0.0921, 0.0454, 0.0220], rel=5e-3)


def test_a_heavy_end_is_told_to_be_still_moving(steps):
    iterations, sub_steps = (series_of(steps, "heavy", f"PBD, n {way}") for way in ("iterations", "sub-steps"))
    assert iterations[20.0] / sub_steps[20.0] > 20.0
    assert any("still moving" in sentence for sentence in steps.sentences)


# ------------------------------------------------------------------ solvers


def test_solvers_are_ranked_by_work(pool):
    study = solvers.run(CHAIN, scene={"links": 30}, sweeps=[1, 10, 100], rounds=1, workers=pool, quiet=True)
    natural = series_of(study, "work", "Gauss-Seidel, natural order")
    assert list(natural) == [1.0, 10.0, 100.0], "a sweep is a projection of every link"
    assert sorted(natural.values(), reverse=True) == list(natural.values())
    (direct,) = series_of(study, "work", "direct").values()
    assert direct < 1e-12
    assert min(series_of(study, "work", "multilevel").values()) < min(natural.values())
    assert study.sentences[1].startswith("To a residual of 1e-06: direct")
    assert "Not reached, best residual" in study.sentences[1]
    assert set(labels(study, "work")) == set(labels(study, "time"))
    assert len(study.tables[0].columns) == 5, "a chain has fewer links than freedoms"


def test_a_cloth_is_also_measured_by_its_distance_from_the_exact_projection(pool):
    study = solvers.run(CLOTH, scene={"size": 6}, sweeps=[1, 100], rounds=1, workers=pool, quiet=True)
    table = study.tables[0]
    assert table.columns[-1] == "over Gauss-Seidel's"
    last = {row[0]: row[-1] for row in table.rows}
    assert last["Gauss-Seidel, natural order"] == "1"
    assert "direct" not in last
    (reason,) = [omission.reason for omission in study.omissions if omission.engine == "pbd"]
    assert "direct" in reason


# ------------------------------------------------------------------ metrics


def end_of(scene, positions):
    x = np.array([scene.masses.positions, positions])
    return Subject(Trajectory(scene.times, x, 0.0 * x, steps=1), scene)


def test_link_rms_is_the_mean_square_of_relative_errors():
    scene = build_scene(CHAIN, {"links": 2, "lengths": [1.0, 2.0], "angles": 0.0, "samples": 1})
    end = np.array([[0.0, 0.0], [0.0, -1.3], [0.0, -3.1]])
    assert link_rms.measure(end_of(scene, end)) == pytest.approx(math.sqrt((0.3**2 + 0.1**2) / 2.0))
    with pytest.raises(Refused, match="without links"):
        link_rms.measure(end_of(build_scene("free_fall", {"samples": 1}), np.zeros((1, 2))))


def test_projection_distance_is_zero_at_the_exact_projection_and_counts_by_mass():
    scene = build_scene("free_pair", {"samples": 1, "mass": 1.0, "other_mass": 3.0})
    stretched = scene.masses.positions * np.array([1.2, 1.0])
    moved = dataclasses.replace(scene, masses=dataclasses.replace(scene.masses, positions=stretched))
    assert projection_distance.measure(end_of(moved, scene.masses.positions)) < 1e-8, (
        "the lighter moves three times as far"
    )
    aside = scene.masses.positions + np.array([[0.0, 0.1], [0.0, 0.0]])
    assert projection_distance.measure(end_of(moved, aside)) == pytest.approx(0.1 * math.sqrt(1.0 / 4.0), rel=1e-6)


def test_a_scene_that_cannot_be_projected_is_refused():
    scene = build_scene(CLOTH, {"size": 3, "stretch": 1.1, "samples": 1})
    lengths = scene.links[0].lengths.copy()
    lengths[0] *= 10.0
    torn = dataclasses.replace(scene, links=(dataclasses.replace(scene.links[0], lengths=lengths),))
    with pytest.raises(Refused, match="exact projection"):
        projection_distance.measure(end_of(torn, torn.masses.positions))


# ------------------------------------------------------------------ refusals


@pytest.mark.parametrize("study", [throughput, scaling, small_steps, solvers])
@pytest.mark.parametrize(
    "asked",
    [
        {"engines": ["pymunk"]},
        {"engines": ["pdb"]},
        {"settings": {"pbd": {"k": 0.5}}},
        {"scene": {"link": 3}},
        {"rounds": 0},
    ],
    ids=str,
)
def test_bad_input_ends_before_anything_runs(study, asked, monkeypatch):
    monkeypatch.setattr("comparisons.isolation._start", lambda: pytest.fail("an engine was reached"))
    with pytest.raises(InvalidInput):
        study.run(CHAIN, **asked, quiet=True)


@pytest.mark.parametrize(
    ("study", "asked"),
    [
        (throughput, {"particles": [10**9]}),
        (throughput, {"sweeps": [0]}),
        (throughput, {"sweeps": []}),
        (scaling, {"particles": []}),
        (small_steps, {"counts": [0]}),
        (small_steps, {"counts": []}),
        (small_steps, {"dt": math.nan}),
        (solvers, {"sweeps": [-1]}),
        (solvers, {"sweeps": []}),
    ],
    ids=str,
)
def test_numbers_out_of_range_are_refused(study, asked, monkeypatch):
    monkeypatch.setattr("comparisons.isolation._start", lambda: pytest.fail("an engine was reached"))
    with pytest.raises(InvalidInput):
        study.run(CHAIN, **asked, quiet=True)


def test_a_scene_without_a_size_is_refused():
    for study in (throughput, scaling, solvers):
        with pytest.raises(InvalidInput, match="links or size"):
            study.run("free_fall", quiet=True)
