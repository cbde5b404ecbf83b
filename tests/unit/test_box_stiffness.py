"""The study of the stiffness of boxes made of particles: its lines, closed forms, sentences, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from comparisons.studies import box_stiffness
from comparisons.studies._box_depth import sunk, truss
from comparisons.study import from_json
from pbd.errors import InvalidInput

pytestmark = pytest.mark.slow

COUNTS, RATIOS = (1, 5, 20), (1.0, 100.0)


@pytest.fixture(scope="module")
def study():
    return box_stiffness.run(iterations=COUNTS, ratios=RATIOS, quiet=True)


def line(study, panel, label):
    (found,) = [series for series in study.series if (series.panel, series.label) == (panel, label)]
    return dict(zip(found.x, found.y, strict=True))


def test_every_way_to_hold_a_box_has_a_line_at_both_time_steps(study):
    assert {record.status.code for record in study.records} == {"ok"}
    assert len(study.records) == 2 * (3 + 4) * len(COUNTS) + 4 * len(RATIOS)
    for panel in ("shape_matching", "distance"):
        for part in ("", ", 2"):
            for label in ("k'", "raw k", "k = 1"):
                assert list(line(study, panel + part, label)) == list(COUNTS)
    assert {series.kind for series in study.series if not series.engine} == {"closed form"}


@pytest.mark.parametrize("part", [1, 2])
def test_shape_matching_leaves_what_its_closed_form_says(study, part):
    """To the digits that are left of a depth that is a difference of positions of 0.5 m."""
    panel = "shape_matching" if part == 1 else f"shape_matching, {part}"
    for label, k, raw in (("k'", 0.4, False), ("raw k", 0.4, True), ("k = 1", 1.0, False)):
        for n, depth in line(study, panel, label).items():
            assert depth == pytest.approx(sunk(k, int(n), box_stiffness.DT / part, raw), rel=1e-7)


def test_compliance_gives_load_times_compliance_at_any_time_step(study):
    """Within what small displacements leave out, once the iterations are enough."""
    (level,) = truss(box_stiffness.COMPLIANCE, [1.0], sticks=False)
    for panel in ("distance", "distance, 2"):
        assert line(study, panel, "XPBD compliance")[20] == pytest.approx(level, rel=0.01)
        assert line(study, panel, "XPBD compliance")[1] > 2.0 * level, "few iterations leave it softer"


def test_stiffness_depends_on_the_time_step(study):
    """k' divides the depth by 4 when dt is halved; to the digits of small displacements with distances too."""
    for panel, tolerance in (("shape_matching", 1e-8), ("distance", 0.1)):
        whole, half = (line(study, panel + part, "k'") for part in ("", ", 2"))
        assert whole[20] / half[20] == pytest.approx(4.0, rel=tolerance)


def test_a_load_presses_in_proportion(study):
    """Rigid shapes give way by what is unfinished, soft distances by their compliance."""
    for label in ("shapes, k = 1, n = 10", "distances, XPBD, n = 100"):
        depth = line(study, "load", label)
        assert 50.0 < depth[100.0] / depth[1.0] < 100.0
    assert line(study, "load", "distances, XPBD, n = 100")[100.0] == pytest.approx(
        line(study, "load", "load x compliance")[100.0], rel=0.05
    )


def test_sentences_and_table_say_what_was_found(study):
    words = "\n".join(study.sentences)
    assert "divides the depth by 4:" in words
    assert "from load x compliance" in words
    assert "Under 100 times its mass" in words
    (table,) = study.tables
    assert len(table.rows) == 2 * (3 + 4) + 4 + 3


def test_the_study_can_be_written_read_and_drawn(study, tmp_path):
    study.to_json(tmp_path / "study.json")
    assert from_json(tmp_path / "study.json") == study
    study.plot(tmp_path / "study.png")
    assert (tmp_path / "study.png").stat().st_size > 10_000


# ------------------------------------------------------------------ closed forms


def test_a_truss_is_linear_in_load_and_compliance():
    soft = np.array(truss(1e-3, [1.0, 10.0], sticks=True))
    np.testing.assert_allclose(truss(1e-6, [1.0, 10.0], sticks=True), 1e-3 * soft, rtol=1e-9)
    np.testing.assert_allclose(truss(1e-3, [2.0, 20.0], sticks=True), 2.0 * soft, rtol=1e-9)
    assert soft[1] > soft[0] > 0.0
    alone = truss(1e-3, [1.0], sticks=True)[0]
    assert truss(1e-3, [1.0, 1e-12], sticks=True)[0] == pytest.approx(alone, rel=0.3), "the other box braces its top"
    assert truss(1e-3, [1.0], sticks=False)[0] > alone, "corners that slide let it sink deeper"


def test_the_depth_in_limits():
    """One iteration: 5 g h^2 / k. Endless iterations of k': 5/6 g h^2 r / (1 - r) with r = (1 - k)^(1/6)."""
    fall = 9.81 * 0.01**2
    assert sunk(0.4, 1, 0.01) == pytest.approx(5.0 * fall / 0.4, rel=1e-12)
    r = 0.6 ** (1.0 / 6.0)
    assert sunk(0.4, 10**6, 0.01) == pytest.approx(5.0 / 6.0 * fall * r / (1.0 - r), rel=1e-4)
    assert sunk(1.0, 100, 0.01) < 1e-7 * fall


@pytest.mark.parametrize(
    "changes",
    [
        {"engines": ["pymunk"]},
        {"settings": {"particle_boxes": {"dt": 0.1}}},
        {"k": 1.0},
        {"compliance": 0.0},
        {"dt": float("nan")},
        {"iterations": []},
        {"iterations": [0]},
        {"ratios": [-1.0]},
    ],
)
def test_bad_input_is_refused_before_anything_runs(changes):
    with pytest.raises(InvalidInput):
        box_stiffness.run(quiet=True, **changes)
