"""Studies of rigid bodies, on tiny sizes: what counts of several runs, who wins, what is shown, drawn and refused.

One engine with quick runs stands for all, and times are never asserted.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from PIL import Image

from comparisons.bodies import Ball, Box, Planes, at_rest
from comparisons.film import Film, film
from comparisons.isolation import Workers
from comparisons.record import Record, RunSpec, Seconds, Status, Value
from comparisons.run import bind, build_scene, execute
from comparisons.scene import Scene, no_masses
from comparisons.studies import contacts, falling, piles, stacking, work_precision
from comparisons.studies._contest import Standing, losses, sentences
from comparisons.studies._rigid import (
    ACCURATE,
    EULER,
    FAST,
    Contender,
    by_worst,
    capped,
    least,
    phases_of,
    worst,
    worst_phase,
)
from comparisons.study import Chapter, from_json
from comparisons.trajectory import Trajectory
from pbd.errors import InvalidInput
from reports import animation, page

ENGINE = "pymunk"


@pytest.fixture(scope="module")
def pool():
    with Workers() as found:
        yield found


def record(error=math.nan, code="ok", wall=0.0, dt=0.1, **changes):
    plain = dict.fromkeys(("key", "scene", "engine", "version", "method", "preset"), "")
    values = {"metrics": {"drift": Value(error, "m")}, "wall": wall, "status": Status(code=code), **changes}
    return Record(**plain, parameters={}, settings={"dt": dt}, dt=dt, steps=1, seed=0, **values)


# ------------------------------------------------------------------ what counts of several runs


def test_the_worst_phase_and_the_best_preset_count():
    runs = [record(1e-3), record(3e-3), record(2e-3)]
    assert worst(runs, "drift") is runs[1]
    assert least(runs, "drift") is runs[0]


def test_a_run_without_a_result_is_the_worst_phase_and_never_the_best_preset():
    lost, fine = record(code="diverged"), record(1.0)
    assert worst([fine, lost], "drift") is lost
    assert least([lost, fine], "drift") is fine
    assert least([lost], "drift") is lost


def test_phases_shift_events_by_equal_parts_of_a_step():
    spec = RunSpec(scene="slide", engine=ENGINE, settings={"dt": 0.04}, parameters={"lead": 0.5})
    leads = [one.parameters["lead"] for one in phases_of(spec, 4)]
    assert leads == pytest.approx([0.5, 0.51, 0.52, 0.53])
    assert phases_of(spec, 1) == [spec]


def test_a_ladder_sees_the_worst_of_its_phases():
    seen = []

    def ladder(found):
        seen.append([r.metric("drift") for r in found])
        return RunSpec(scene="slide", engine=ENGINE, settings={"dt": 0.1 / 2 ** len(found)}) if len(found) < 2 else None

    phased, found = worst_phase(ladder, 3, "drift"), []
    errors = iter([1.0, 5.0, 2.0, 4.0, 3.0, 0.5])
    while (spec := phased(found)) is not None:
        found.append(record(next(errors), dt=spec.settings["dt"]))
    assert [r.dt for r in found] == [0.1] * 3 + [0.05] * 3
    assert seen == [[], [5.0], [5.0, 4.0]]
    assert [r.metric("drift") for r in by_worst(found, 3, "drift")] == [5.0, 4.0]


def test_runs_end_before_one_that_would_take_too_long():
    specs = [RunSpec(scene="slide", engine=ENGINE, settings={"dt": dt}) for dt in (0.1, 0.1, 0.01)]
    ladder = capped(specs, 5.0)
    assert ladder([record(wall=0.4)]) is specs[1]
    assert ladder([record(wall=0.4)] * 2) is specs[2]
    assert ladder([record(wall=0.6)] * 2) is None
    assert ladder([record(wall=0.1)] * 3) is None


def test_penalty_contacts_last_as_many_steps_at_any_rate():
    """A box's contact in the plane, two springs of k m under m, takes half a period: pi / sqrt(2 k)."""
    for dt in (1e-1, 1e-3):
        stiffness = EULER.settings(dt)["contact_stiffness"]
        assert math.pi / math.sqrt(2.0 * stiffness) == pytest.approx(10.0 * dt)
    assert FAST.settings(0.1) == {"dt": 0.1}


# ------------------------------------------------------------------ who wins


def standing(question, error, engine="rattle", contender=FAST.label, counts=True):
    return Standing(question, contender, engine, 60.0, error, counts)


def test_wins_and_losses_are_told_with_their_factor():
    both = [
        standing("slide", 1e-3),
        standing("slide", 1e-6, contender=ACCURATE.label),
        standing("slide", 1e-5, engine="pymunk", contender="pymunk"),
        standing("stack", 1e-2),
        standing("stack", 1e-4, engine="mujoco", contender="MuJoCo"),
    ]
    said = sentences("60 Hz", both)
    assert said[0] == "60 Hz: of 2 questions RATTLE contacts wins 1, MuJoCo wins 1."
    assert "stack (MuJoCo 1.0e-04 against 1.0e-02, 100 times)" in said[1]
    assert "slide" not in said[1]
    assert "slide (pymunk 1.0e-05 against 1.0e-03, 100 times)" in said[2], "without the preset of many sub-steps"


def test_equal_errors_round_off_and_what_is_exact_by_construction_win_nothing():
    shared = [
        standing("slide", 2.70e-6),
        standing("slide", 2.69e-6, engine="pymunk"),
        standing("creep", 1e-16),
        standing("creep", 5e-13, engine="pymunk"),
        standing("fall", 0.0, counts=False),
        standing("fall", 1.0, engine="pymunk", counts=False),
    ]
    assert sentences("60 Hz", shared)[0] == "60 Hz: of 2 questions 2 shared."
    assert losses(shared) == ""


# ------------------------------------------------------------------ contacts


@pytest.fixture(scope="module")
def table(pool):
    return contacts.run(engines=[ENGINE], rates=[60, 240], phases=2, workers=pool, quiet=True)


def cells(study, rate, row):
    (found,) = [shown for shown in study.tables if f"at {rate} Hz" in shown.title]
    (line,) = [line for line in found.rows if line[0].startswith(row)]
    return dict(zip(found.columns, line, strict=True))


def test_every_question_has_a_row_and_every_preset_a_column(table):
    assert len(table.tables) == 2
    rows = [row[0] for row in table.tables[0].rows]
    assert len(rows) == sum(len(question.words) for question in contacts.QUESTIONS)
    assert table.tables[0].columns == ["scene, error", "pymunk, best preset", "pymunk, default"]
    assert sum("exact by construction, no win" in row for row in rows) == 4
    assert all("2 phases" in shown.title for shown in table.tables)


def test_a_cell_is_the_worst_of_the_phases_of_the_better_preset(table, pool):
    def error(preset, lead):
        spec = RunSpec(
            scene="slide",
            engine=ENGINE,
            preset=preset,
            settings={"dt": 1 / 60},
            parameters={"lead": lead},
            metrics=("stop_distance",),
        )
        return execute(spec, pool[ENGINE].run).metric("stop_distance")

    worse = {preset: max(error(preset, lead) for lead in (0.0, 0.5 / 60)) for preset in ("matched", "default")}
    found = cells(table, 60, "slide")
    assert found["pymunk, default"].endswith(f"{worse['default']:.1e}")
    assert f"{min(worse.values()):.1e}" in found["pymunk, best preset"]


def test_what_has_no_result_says_why(table):
    assert cells(table, 60, "free top")["pymunk, default"] == "- unsupported"
    assert not [series for series in table.series if not series.x]


def test_what_would_take_too_long_is_left_out(pool):
    brief = contacts.run(engines=[ENGINE], rates=[60, 240], phases=1, cap=1e-9, workers=pool, quiet=True)
    assert any(row[0].startswith("slide") for row in brief.tables[0].rows)
    assert [row[0] for row in brief.tables[1].rows] == ["free top in 3D, attitude [rad]"], "which takes no time"


def test_errors_are_drawn_by_row_and_survive_json(table, tmp_path):
    table.to_json(tmp_path / "study.json")
    assert from_json(tmp_path / "study.json") == table
    table.plot(tmp_path / "study.svg")
    drawn = (tmp_path / "study.svg").read_text()
    for words in ("slide, stop distance [rel.]", "rolling [m] †", "240 Hz", "pymunk, default"):
        assert words in drawn


@pytest.mark.parametrize(
    ("study", "asked", "field"),
    [
        (contacts, {"engines": ["pbd"]}, "engines"),
        (contacts, {"settings": {ENGINE: {"iterations": 3}}}, "settings"),
        (contacts, {"rates": [61.0]}, "dt"),
        (contacts, {"rates": []}, "rates"),
        (contacts, {"phases": 0}, "phases"),
        (stacking, {"counts": []}, "counts"),
        (stacking, {"seeds": 0}, "seeds"),
        (stacking, {"cap": math.nan}, "cap"),
        (piles, {"counts": [0]}, "counts"),
        (piles, {"solids": [-1]}, "solids"),
        (piles, {"rounds": 0}, "rounds"),
        (falling, {"count": 0}, "count"),
        (falling, {"seeds": 0}, "seeds"),
    ],
)
def test_bad_input_is_refused_before_anything_runs(study, asked, field):
    with pytest.raises(InvalidInput) as refusal:
        study.run(**{"engines": [ENGINE], **asked}, workers=None, quiet=True)
    assert field in str(refusal.value)


# ------------------------------------------------------------------ stacks


@pytest.fixture(scope="module")
def stacks(pool):
    return stacking.run(engines=[ENGINE], counts=[3, 40, 80], rates=[60], seeds=2, workers=pool, quiet=True)


def test_a_line_ends_where_the_stack_falls(stacks):
    runs = [(r.preset, r.parameters["count"]) for r in stacks.records]
    assert runs == [(preset, count) for preset in ("matched", "default") for count in (3, 3, 40, 40)]
    standing_lines = [series for series in stacks.series if series.kind == "measured"]
    ends = [series for series in stacks.series if series.kind == "lost"]
    assert [series.x for series in standing_lines] == [[3.0]] * 2
    assert [series.x for series in ends] == [[3.0, 40.0]] * 2
    assert [row[1].partition(",")[0] for row in stacks.tables[0].rows] == ["3", "3"]
    assert all("(40: falls)" in row[1] for row in stacks.tables[0].rows)


def test_a_drift_is_the_worst_of_the_seeds(stacks):
    drifts = [r.metric("drift") for r in stacks.records[:2]]
    assert drifts[0] != drifts[1]
    assert stacks.series[0].y == [max(drifts)]


def test_what_was_not_tried_is_no_limit(pool):
    low = stacking.run(engines=[ENGINE], counts=[2, 3], rates=[240], seeds=1, cap=1e-9, workers=pool, quiet=True)
    assert {r.parameters["count"] for r in low.records} == {2}
    assert all(row[1].startswith("≥ 2,") for row in low.tables[0].rows)
    assert "pymunk ≥ 2" in low.sentences[0]


# ------------------------------------------------------------------ piles


def test_piles_have_cost_overlap_and_motion(pool, tmp_path):
    study = piles.run(engines=[ENGINE], counts=[5], solids=[3], sizes=None, rounds=1, workers=pool, quiet=True)
    flat = [row for row in study.tables[0].rows if row[0] == "5 boxes, 2D"]
    assert [row[1] for row in flat] == ["pymunk, matched", "pymunk, default"]
    assert all(float(cell) >= 0.0 for row in flat for cell in row[2:])
    assert [row[2:4] for row in study.tables[0].rows if row[0] == "3 boxes, 3D"] == [["-", "- unsupported"]] * 2
    assert [panel.title for panel in study.panels] == ["5 boxes, 2D"] * 2
    study.plot(tmp_path / "piles.svg")
    assert "overlap at the end [m]" in (tmp_path / "piles.svg").read_text()


def test_the_cost_is_of_one_body_in_one_step():
    timed = record(seconds=Seconds(min=3e-3, repeats=1, overhead=0.0))
    heap = piles.Heap(FAST, piles.Pile(10, 2), msgspec.structs.replace(timed, steps=100))
    assert heap.cost == pytest.approx(3.0)


# ------------------------------------------------------------------ falling boxes


@pytest.fixture(scope="module")
def heaps(pool):
    return falling.run(engines=[ENGINE], count=6, seeds=2, solid_seeds=0, workers=pool, quiet=True)


def test_heaps_are_told_by_mean_and_spread(heaps):
    (row,) = heaps.tables[0].rows
    heights = [r.metric("heap_height") for r in heaps.records]
    assert row[:2] == ["pymunk, matched", "2"]
    assert row[2] == f"{np.mean(heights):.2f} ± {np.std(heights, ddof=1):.2f}"
    assert "-" not in row, "pymunk tells the planes' forces"


def test_the_first_heap_is_filmed(heaps, tmp_path):
    (shot,) = heaps.films
    given = build_scene("falling_boxes", heaps.records[0].parameters)
    assert len(shot.times) == len(shot.poses) == 73
    np.testing.assert_allclose([pose[:2] for pose in shot.poses[0]], given.bodies.positions, atol=5.1e-4)
    assert [len(shape) for shape in shot.shapes] == [1 if isinstance(s, Ball) else 2 for s in given.bodies.shapes]
    heaps.to_json(tmp_path / "falling.json")
    assert from_json(tmp_path / "falling.json") == heaps


def test_the_film_is_a_small_gif_and_stands_in_the_report(heaps, tmp_path):
    heaps.plot(tmp_path / "film.gif")
    with Image.open(tmp_path / "film.gif") as shown:
        assert 60 <= shown.n_frames <= 73, "equal frames become one"
        assert shown.width == animation.WIDTH
    assert (tmp_path / "film.gif").stat().st_size < 3e6
    page.write([Chapter(heading="Falling boxes", caption="", studies=[heaps])], tmp_path / "report")
    assert "data:image/gif;base64," in (tmp_path / "report" / "index.html").read_text()
    assert "(figures/falling-boxes.gif)" in (tmp_path / "report" / "report.md").read_text()
    assert (tmp_path / "report" / "figures" / "falling-boxes.gif").exists()


def still_life(dimension=2):
    """A box over the floor, turned by 45 degrees in the second of two samples, and a ball."""
    box = Box((1.0,) * dimension)
    bodies = at_rest((box, Ball(0.5, dimension)), np.ones(2), np.eye(2, dimension) * 0.0 + 0.5)
    planes = Planes(np.eye(dimension)[1:2], np.zeros(1))
    return Scene("life", "life", no_masses(dimension), (), np.zeros(dimension), 1.0, 1, (), bodies, planes)


def test_films_hold_what_was_run():
    scene, places = still_life(), np.array([[[-1.0, 0.5], [1.0, 0.5]], [[-1.0, 2.0], [1.0, 1.23456]]])
    run = Trajectory(scene.times, places, 0.0 * places, 1, orientations=np.array([[0.0, 0.0], [np.pi / 4, 0.0]]))
    shot = film(scene, run, engine="rattle", label="ours", note="")
    assert shot.shapes == [[1.0, 1.0], [0.5]]
    assert shot.planes == [[0.0, 1.0, 0.0]]
    assert shot.poses[1] == [[-1.0, 2.0, 0.785], [1.0, 1.235, 0.0]]
    with pytest.raises(InvalidInput, match="planar"):
        film(still_life(3), run, engine="rattle", label="ours", note="")


def test_bodies_are_drawn_where_they_are():
    """The turned box reaches sqrt(1/2) to its sides, where the unturned one does not; a ball has no corners."""
    poses = [[[-1.0, 2.0, 0.0], [1.0, 1.0, 0.0]], [[-1.0, 2.0, math.pi / 4.0], [1.0, 1.0, 0.0]]]
    shot = Film(
        engine="pybullet",
        label="a",
        note="",
        times=[0.0, 1.0],
        shapes=[[1.0, 1.0], [0.5]],
        planes=[[0.0, 1.0, 0.0]],
        poses=poses,
    )
    before, after = (np.asarray(animation.still([shot], k)).astype(int) for k in (0, 1))
    left, right, bottom, top = animation._view([shot])
    side = animation.WIDTH - 2 * animation.GAP
    floor = before.shape[0] - animation.GAP

    def pixel(image, x, y):
        scale = side / (right - left)
        return image[round(floor - (y - bottom) * scale), round(animation.GAP + (x - left) * scale)]

    def is_body(image, x, y):
        return pixel(image, x, y)[1] > pixel(image, x, y)[0] + 20  # pybullet is green

    assert top > 2.5
    assert is_body(before, -1.0, 2.0)
    assert is_body(before, -1.42, 2.42)
    assert not is_body(after, -1.42, 2.42)
    assert is_body(after, -1.6, 2.0)
    assert not is_body(before, -1.6, 2.0)
    assert is_body(after, 1.0, 1.45)
    assert not is_body(after, 1.42, 1.42)


def test_no_film_is_refused(tmp_path, heaps):
    with pytest.raises(InvalidInput, match="films"):
        animation.write([], tmp_path / "none.gif")
    with pytest.raises(InvalidInput, match="gif"):
        animation.write(heaps.films, tmp_path / "film.mp4")


# ------------------------------------------------------------------ run time against error


def test_a_scene_of_bodies_races_in_its_own_metric_and_worst_phase(pool, tmp_path):
    study = work_precision.run(
        "slide", engines=[ENGINE], dt=[0.01, 0.005], rounds=1, phases=2, workers=pool, quiet=True
    )
    assert study.panels[0].x == "error of the stop distance, relative"
    assert {won.unit for won in study.winners} == {"1"}
    assert study.sentences[0].startswith("To 0.01: pymunk")
    assert "PBD particle boxes does not get there" in study.sentences[0]
    shown = next(r for r in study.records if r.preset == "default" and r.dt == 0.01)
    spec = RunSpec(scene="slide", engine=ENGINE, settings={"dt": 0.01}, metrics=("stop_distance",))
    both = [execute(one, pool[ENGINE].run).metric("stop_distance") for one in phases_of(spec, 2)]
    assert shown.metric("stop_distance") == max(both)
    page.write([Chapter(heading="Races", caption="", studies=[study])], tmp_path)
    assert "error of the stop distance, relative" in (tmp_path / "report.md").read_text()


def test_the_matched_preset_itself_is_tried_and_nothing_twice():
    specs = work_precision.tried("slide", {}, ENGINE, {})
    assert (specs[0].preset, specs[1].preset, specs[1].settings) == ("default", "matched", {})
    settings = [(spec.preset, tuple(sorted(spec.settings.items()))) for spec in specs]
    assert len(set(settings)) == len(settings)
    assert {"iterations": 50} not in [spec.settings for spec in specs], "it is the matched preset's own"


def test_contenders_name_engines_and_presets_that_exist():
    for one in {*contacts.CONTENDERS, *falling.CONTENDERS, *stacking.AT_ONE_PRESET, *piles.CONTENDERS}:
        assert isinstance(one, Contender)
        for preset in one.presets:
            bind(one.spec("drop", {}, preset, 1 / 60, ("impact_time",)))
