"""What a study gives back: round trip, orders, table, figures, and who wins - on records made by hand."""

from __future__ import annotations

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

import comparisons
from comparisons.fit import Fit
from comparisons.record import Record, RunSpec, Seconds, Status, Value
from comparisons.studies import work_precision
from comparisons.studies.work_precision import front, sentence, time_to_error, winner
from comparisons.study import Head, Omission, Panel, Series, Study, Winner, duration, from_json
from pbd.errors import InvalidInput

PNG = b"\x89PNG\r\n\x1a\n"
SETTINGS = {
    "pbd": {"method": "pbd", "dt": 0.01, "iterations": 1, "substeps": 1, "k": None, "raw": False, "damping": 0.0},
    "symplectic_euler": {"dt": 0.01, "stiffness": 1e6, "damping_ratio": 0.0, "half_kick": False},
    "pymunk": {"dt": 0.01, "iterations": 10, "error_bias": 0.5, "half_kick": False},
    "shake": {"order": "2", "dt": 0.01, "solver": "direct", "iterations": 1, "velocity": "impulses"},
    "dop853": {"rtol": 1e-8},
}


def record(engine="pbd", error=1e-3, seconds=1e-4, code="ok", **settings):
    chosen = {**SETTINGS[engine], **settings}
    spec = RunSpec(scene="pendulum_chain", engine=engine, settings=chosen)
    return Record(
        key=spec.key(),
        scene=spec.scene,
        parameters={"masses": [1.0, 2.0]},
        engine=engine,
        version="1",
        method=engine,
        preset="default",
        settings=chosen,
        dt=chosen.get("dt"),
        steps=100,
        seed=0,
        metrics={} if error is None else {"position_error": Value(error, "m")},
        seconds=None if seconds is None else Seconds(min=seconds, repeats=3, overhead=0.1 * seconds),
        work={"projections": 7},
        status=Status(code=code),
    )


def study_of(records, **changes):
    fit = Fit(order=1.02, low=0.98, high=1.06, xs=[0.01, 0.005, 0.0025, 0.00125], floor=1e-9)
    xs, ys = [0.01, 0.005, 0.0025, 0.00125], [1e-2, 5e-3, 2.5e-3, 1.25e-3]
    series = [
        Series(panel="dt", label="PBD 2006", engine="pbd", x=xs, y=ys, method="pbd", preset="default", fit=fit),
        Series(panel="dt", label="XPBD", engine="pbd", x=xs, y=ys, method="xpbd", preset="default", fit=Fit()),
        Series(panel="dt", label="exact", engine="", x=xs, y=ys, kind="closed form"),
    ]
    usual = Study(
        kind="convergence",
        title="Convergence: a chain of 2 µ-links",
        subject="2 links",
        scene="pendulum_chain",
        parameters={"links": 2, "masses": [1.0, 2.0]},
        head=Head(commit="abc", dirty=True, machine="m", python="3.11", packages={"numpy": "2"}),
        panels=[Panel(name="dt", title="error against dt", x="time step [s]", y="position error [m]")],
        series=series,
        records=records,
        omissions=[Omission("pymunk", "is not installed", "pip install pymunk")],
        sentences=["PBD: order 1."],
        winners=[Winner(target=1e-2, engine="pbd", setting="PBD 2006", seconds={"pbd": 1e-4})],
    )
    return msgspec.structs.replace(usual, **changes)


# ------------------------------------------------------------------ round trip


def test_a_study_is_equal_after_its_round_trip(tmp_path):
    study = study_of([record(), record("dop853", error=None, seconds=None, code="diverged")])
    study.to_json(tmp_path / "deep" / "study.json")
    assert from_json(tmp_path / "deep" / "study.json") == study
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["study.json"], "no partial file is left"


def test_writing_replaces_what_was_there(tmp_path):
    path = tmp_path / "study.json"
    path.write_text("x" * 10**6)
    study_of([]).to_json(str(path))
    assert from_json(str(path)) == study_of([])


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"null", b"[]", b"\xff\xfe", b"{}", b"[" * 100_000, b'{"kind": 3}', b"--- !!python/object"],
    ids=range(9),
)
def test_anything_else_is_refused_in_one_line(content, tmp_path):
    (tmp_path / "study.json").write_bytes(content)
    with pytest.raises(InvalidInput) as refused:
        from_json(tmp_path / "study.json")
    assert "study.json" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_missing_files_and_directories_are_refused(tmp_path):
    for path in (tmp_path / "absent.json", tmp_path):
        with pytest.raises(InvalidInput, match="a study written by to_json"):
            from_json(path)


def test_a_newer_schema_is_refused(tmp_path):
    study = study_of([])
    msgspec.structs.replace(study, head=Head(schema=99)).to_json(tmp_path / "study.json")
    with pytest.raises(InvalidInput, match="schema = 99: must be 1"):
        from_json(tmp_path / "study.json")


# ------------------------------------------------------------------ orders and tables


def test_order_by_engine_panel_and_method():
    study = study_of([])
    assert study.order("pbd") == study.order("pbd", panel="dt", method="pbd", preset="default") == 1.02
    assert math.isnan(study.order("pbd", method="xpbd")), "too few levels"
    assert study.fit("pbd").floor == 1e-9


def test_an_order_that_was_not_measured_is_refused():
    study = study_of([])
    with pytest.raises(InvalidInput, match=r"engine = 'pdb': must be one of pbd; did you mean 'pbd'\?"):
        study.order("pdb")
    with pytest.raises(InvalidInput, match="one that this study measured"):
        study.order("pbd", panel="iterations")


def test_the_table_has_a_line_for_each_record():
    lines = study_of([record(), record("dop853", error=None, seconds=None, code="timeout")]).table().split("\n")
    assert lines[0].split() == ["engine", "variant", "dt", "[s]", "steps", "status", "position_error", "time", "[s]"]
    assert [part in lines[1] for part in ("pbd", "PBD 2006", "0.01", "100", "ok", "1.000e-03", "1.000e-04")] == [
        True
    ] * 7
    assert lines[2].split()[:1] == ["dop853"]
    assert "timeout" in lines[2]
    assert lines[2].split()[-2:] == ["-", "-"]
    starts = {line.index(word) for line, word in zip(lines, ("status", "ok", "timeout"), strict=True)}
    assert len(starts) == 1, "columns are aligned"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(90.0, "90 s"), (1.0, "1 s"), (0.0123, "12.3 ms"), (1e-3, "1 ms"), (4.56e-5, "45.6 µs"), (7e-9, "7 ns")],
)
def test_times_in_their_natural_unit(seconds, text):
    assert duration(seconds) == text


# ------------------------------------------------------------------ figures


@pytest.mark.parametrize("ending", ["png", "svg"])
def test_figures_are_written(ending, tmp_path):
    path = tmp_path / "new" / f"figure.{ending}"
    study_of([]).plot(path)
    content = path.read_bytes()
    assert len(content) > 5000
    if ending == "png":
        assert content.startswith(PNG)
        assert content.rstrip(b"\0")[-8:-4] == b"IEND"
    else:
        text = content.decode()
        assert text.lstrip().startswith("<?xml")
        assert "</svg>" in text
        assert "<dc:date>" not in text, "a figure drawn again is the same file"
        for words in (
            "Convergence: a chain of 2 µ-links",
            "time step [s]",
            "position error [m]",
            "PBD 2006",
            "order 1",
        ):
            assert words in text


def test_a_figure_drawn_again_is_the_same_file(tmp_path):
    for name in ("one.svg", "two.svg"):
        study_of([]).plot(tmp_path / name)
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()


@pytest.mark.parametrize("name", ["figure.pdf", "figure", "figure.png.exe", ".png"])
def test_other_endings_are_refused(name, tmp_path):
    with pytest.raises(InvalidInput, match=r"ends in \.png or \.svg"):
        study_of([]).plot(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


# ------------------------------------------------------------------ who wins

points = st.lists(st.tuples(st.floats(1e-12, 1.0), st.floats(1e-6, 1.0)), max_size=30)


@given(points)
def test_no_point_of_a_front_is_beaten(found):
    kept = front(found)
    assert set(kept) <= set(found)
    for one in kept:
        assert not [p for p in found if p != one and p[0] <= one[0] and p[1] <= one[1]]


@given(points)
def test_every_point_off_the_front_is_beaten_by_one_on_it(found):
    kept = front(found)
    for error, seconds in found:
        assert any(e <= error and s <= seconds for e, s in kept)


@given(points, st.randoms(use_true_random=False))
def test_a_front_is_ordered_and_independent_of_the_order_given(found, random):
    kept = front(found)
    assert [e for e, _ in kept] == sorted({e for e, _ in kept}, reverse=True)
    assert [s for _, s in kept] == sorted({s for _, s in kept})
    shuffled = list(found)
    random.shuffle(shuffled)
    assert front(shuffled) == kept
    assert front(kept) == kept


def test_the_winner_is_the_fastest_that_is_good_enough():
    records = [
        record("pbd", error=9e-3, seconds=3e-5),
        record("pbd", error=5e-3, seconds=2e-5, iterations=10),
        record("pymunk", error=1e-4, seconds=4e-5),
        record("pymunk", error=2e-2, seconds=1e-6),
    ]
    won = winner(records, 1e-2)
    assert (won.engine, won.setting) == ("pbd", "PBD 2006, 10 iterations")
    assert won.seconds == {"pbd": 2e-5, "pymunk": 4e-5}
    assert sentence(won) == ("To 0.01 m: PBD (PBD 2006, 10 iterations) wins with 20 µs, 2.0 times faster than pymunk.")


def test_equal_to_the_target_is_good_enough():
    assert winner([record(error=1e-2)], 1e-2).engine == "pbd"


def test_nothing_is_extrapolated():
    """Two points from which a line would reach 1e-4 are no proof that the engine does."""
    records = [record(error=1e-2, seconds=1e-5), record(error=1e-3, seconds=1e-4, iterations=2)]
    won = winner(records, 1e-4)
    assert (won.engine, won.setting, won.seconds) == ("", "", {})
    assert sentence(won) == "To 0.0001 m: no engine gets there within the budget."


def test_the_analyst_is_timed_but_does_not_compete():
    records = [record("dop853", error=1e-9, seconds=1e-6), record("pbd", error=1e-3, seconds=5e-4)]
    won = winner(records, 1e-2)
    assert won.engine == "pbd"
    assert sentence(won) == "To 0.01 m: PBD (PBD 2006) wins with 500 µs, alone; DOP853 takes 1 µs."
    alone = winner(records, 1e-6)
    assert alone.engine == ""
    assert sentence(alone) == "To 1e-06 m: no engine gets there within the budget; DOP853 takes 1 µs."


def test_our_own_losses_are_told():
    fast, slow = record("pymunk", error=1e-5, seconds=1e-5), record("symplectic_euler", error=1e-5, seconds=2e-5)
    lost = sentence(winner([fast, slow, record("pbd", error=1e-5, seconds=3e-4)], 1e-4))
    assert "pymunk" in lost
    assert "2.0 times faster than symplectic Euler; PBD needs 30 times as long" in lost
    assert "PBD does not get there in the budget" in sentence(winner([fast, slow], 1e-4))


def test_the_projects_best_and_pbd_itself_have_their_place():
    """SHAKE is this project's too, but not PBD."""
    shake, pbd = record("shake", error=1e-5, seconds=2e-5), record("pbd", error=1e-5, seconds=3e-4)
    fast, slow = record("pymunk", error=1e-5, seconds=1e-5), record("symplectic_euler", error=1e-5, seconds=4e-5)
    assert sentence(winner([shake, slow, pbd], 1e-4)) == (
        "To 0.0001 m: SHAKE (SHAKE) wins with 20 µs, 2.0 times faster than symplectic Euler; "
        "PBD needs 15 times as long."
    )
    assert sentence(winner([shake, slow], 1e-4)).endswith("symplectic Euler; PBD does not get there in the budget.")
    later = msgspec.structs.replace(shake, seconds=Seconds(min=6e-5, repeats=3, overhead=0.0))
    lost = sentence(winner([fast, slow, later, pbd], 1e-4))
    assert "this project's best, SHAKE, needs 6 times as long; PBD needs 30 times as long" in lost
    assert sentence(winner([fast, shake], 1e-4)).endswith(
        "2.0 times faster than SHAKE; PBD does not get there in the budget."
    )


def test_runs_without_a_time_or_an_error_do_not_count():
    useless = [
        record(error=1e-5, seconds=None),
        record(error=None, seconds=1e-5),
        record(error=math.nan, seconds=1e-5, iterations=2),
    ]
    assert time_to_error(useless, 1.0) == {}


def test_settings_of_one_engine_become_lines():
    records = [
        record(error=1e-2, seconds=1e-5),
        record(error=1e-3, seconds=1e-4, dt=0.001),
        record(error=1e-3, seconds=3e-4, iterations=10),
        record("pymunk", error=1e-3, seconds=1e-4),
    ]
    lines = {s.label: (s.x, s.y) for s in work_precision.by_setting(study_of(records), "pbd").series}
    assert lines == {
        "PBD 2006": ([1e-2, 1e-3], [1e-5, 1e-4]),
        "PBD 2006, 10 iterations": ([1e-3], [3e-4]),
    }


# ------------------------------------------------------------------ from Python


def test_unknown_names_have_the_usual_error():
    with pytest.raises(AttributeError, match="no attribute 'convergance'"):
        _ = comparisons.convergance
    assert comparisons.Study is Study
    assert set(comparisons.__all__) <= set(dir(comparisons)) | {*comparisons._HOME}


def test_a_real_study_round_trips_and_says_what_it_found(tmp_path):
    study = comparisons.work_precision(
        "pendulum_chain", scene={"duration": 0.2, "samples": 20}, engines=["dop853"], rounds=1, quiet=True
    )
    assert {r.status.code for r in study.records} == {"ok"}
    assert all(r.seconds.min >= r.seconds.net > 0.0 for r in study.records)
    assert len(study.winners) == len(work_precision.TARGETS) == len(study.sentences)
    assert {won.engine for won in study.winners} == {""}
    study.to_json(tmp_path / "study.json")
    assert from_json(tmp_path / "study.json") == study
    study.plot(tmp_path / "study.svg")
    assert "DOP853" in (tmp_path / "study.svg").read_text()


def test_numbers_of_numpy_are_welcome(tmp_path):
    numpy = pytest.importorskip("numpy")
    study = comparisons.convergence(
        "pendulum_chain",
        scene={"links": numpy.int64(2), "masses": numpy.array([1.0, 2.0]), "duration": 0.1, "samples": 10},
        engines=["symplectic_euler"],
        settings={"symplectic_euler": {"stiffness": numpy.float64(1e3)}},
        dt=0.01 / 2.0 ** numpy.arange(2),
        quiet=True,
    )
    assert [r.status.code for r in study.records] == ["ok"] * 4
    study.to_json(tmp_path / "study.json")
    assert from_json(tmp_path / "study.json").records == study.records
