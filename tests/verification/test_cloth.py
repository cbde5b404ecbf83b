"""The hanging cloth: its geometry, what its engines and references make of it, and how large its energies are."""

from __future__ import annotations

import math

import numpy as np
import pytest

from comparisons import reference
from comparisons.metrics import Subject, reach
from comparisons.record import RunSpec
from comparisons.run import build_scene, execute
from comparisons.scene import Rods, Springs


def cloth(**parameters):
    return build_scene("hanging_cloth", parameters)


def lengths_of(scene):
    link, x = scene.links[0], scene.masses.positions
    return np.linalg.norm(x[link.pairs[:, 0]] - x[link.pairs[:, 1]], axis=1)


def counts(n):
    """Links of each kind, in the scene's order."""
    return {"rows": n * (n - 1), "columns": n * (n - 1), "diagonals": 2 * (n - 1) ** 2, "two_cell": 2 * n * (n - 2)}


@pytest.mark.parametrize("size", [2, 3, 5, 64])
@pytest.mark.parametrize("start", ["horizontal", "vertical"])
def test_links_come_in_order_and_start_at_rest(size, start):
    scene, n, cell = cloth(size=size, side=2.0, start=start), counts(size), 2.0 / (size - 1)
    expected = np.repeat(cell * np.array([1.0, 1.0, math.sqrt(2.0), 2.0]), list(n.values()))
    (link,) = scene.links
    np.testing.assert_allclose(link.lengths, expected, rtol=1e-15)
    assert np.abs(lengths_of(scene) - link.lengths).max() < 1e-15 * 8
    assert len({tuple(sorted(pair)) for pair in link.pairs.tolist()}) == len(link.pairs), "no link twice"


def test_the_cloth_of_the_xpbd_paper_has_24_thousand_links():
    assert len(cloth(size=64).links[0].pairs) == sum(counts(64).values()) == 23_938


@pytest.mark.parametrize("diagonals", [True, False])
@pytest.mark.parametrize("bending", ["two_cell", "none"])
def test_kinds_of_links_can_be_switched_off(diagonals, bending):
    n = counts(6)
    count = n["rows"] + n["columns"] + diagonals * n["diagonals"] + (bending == "two_cell") * n["two_cell"]
    assert len(cloth(size=6, diagonals=diagonals, bending=bending).links[0].pairs) == count


def test_particles_are_numbered_row_by_row():
    size, cell = 4, 1.0 / 3.0
    row, column = 2, 1
    hanging, flat = (cloth(size=size, start=start).masses.positions for start in ("vertical", "horizontal"))
    np.testing.assert_allclose(hanging[row * size + column], [column * cell, -row * cell, 0.0])
    np.testing.assert_allclose(flat[row * size + column], [column * cell, 0.0, row * cell])


@pytest.mark.parametrize("lumping", ["equal", "area"])
def test_masses_add_up_to_density_times_area(lumping):
    m = cloth(size=5, side=2.0, density=0.3, lumping=lumping).masses.masses.reshape(5, 5)
    assert m.sum() == pytest.approx(0.3 * 4.0, rel=1e-14)
    share = 1.0 if lumping == "equal" else 0.5
    assert m[0, 2] == pytest.approx(share * m[2, 2], rel=1e-14)
    assert m[0, 0] == pytest.approx(share**2 * m[2, 2], rel=1e-14)


@pytest.mark.parametrize(("pinned", "expected"), [("corners", (0, 4)), ("edge", (0, 1, 2, 3, 4)), ("none", ())])
def test_what_is_pinned_stays_at_rest_distance(pinned, expected):
    scene = cloth(size=5, stretch=1.1, pinned=pinned)
    assert scene.masses.pinned == expected
    ratio = lengths_of(scene) / scene.links[0].lengths
    n = counts(5)
    rows, columns = ratio[: n["rows"]], ratio[n["rows"] : n["rows"] + n["columns"]]
    assert np.abs(columns - 1.1).max() < 1e-14
    assert np.abs(rows - (1.0 if expected else 1.1)).max() < 1e-14


def test_compliances_of_the_kinds():
    scene = cloth(size=4, compliance=1e-3, diagonal_compliance=2e-3, bending_compliance=3e-3)
    expected = np.repeat([1e-3, 1e-3, 2e-3, 3e-3], list(counts(4).values()))
    assert isinstance(scene.links[0], Springs)
    np.testing.assert_array_equal(scene.links[0].compliances, expected)
    np.testing.assert_array_equal(np.unique(cloth(size=4, compliance=1e-3).links[0].compliances), [1e-3])
    assert isinstance(cloth(size=4).links[0], Rods)


def test_metrics_fit_the_links():
    assert cloth(compliance=1e-3).metrics == ("position_error", "energy_drift")
    assert cloth().metrics == ("link_violation", "energy_drift")
    assert cloth(stretch=1.1).metrics == ("link_residual",)


def test_reach_is_the_longest_way_from_a_pinned_particle():
    assert reach(cloth(size=5, pinned="edge")) == pytest.approx(1.0)
    assert reach(cloth(size=5, diagonals=False, pinned="corners")) == pytest.approx(1.5)
    assert reach(build_scene("pendulum_chain", {"links": 7, "lengths": 0.3})) == pytest.approx(2.1)


# ------------------------------------------------------------------ its motion


def test_the_reference_of_a_compliant_cloth_conserves_energy_and_moves_in_space():
    scene = cloth(size=5, compliance=1e-3, density=25.0, duration=0.3, samples=10)
    found = reference.solve(scene)
    subject = Subject(found, scene)
    assert np.abs(subject.energy - subject.energy[0]).max() / subject.energy_scale < 1e-11
    assert np.ptp(found.positions, axis=(0, 1)).min() > 0.1, "in all three directions"
    mirrored = found.positions.reshape(-1, 5, 5, 3)[:, :, ::-1]
    assert np.abs(mirrored[..., 0] + found.positions.reshape(-1, 5, 5, 3)[..., 0] - 1.0).max() < 1e-11, "symmetric"


def test_a_rigid_cloth_has_no_reference():
    with pytest.raises(reference.NoReference):
        reference.form(cloth(size=4))
    spec = RunSpec(
        scene="hanging_cloth", engine="pbd", parameters={"size": 4, "duration": 0.1}, metrics=("position_error",)
    )
    record = execute(spec)
    assert record.status.code == "refused"
    assert "without a reference" in record.status.quantity


@pytest.mark.parametrize("engine", ["pbd", "symplectic_euler"])
def test_engines_converge_to_the_reference(engine):
    parameters = {"size": 4, "compliance": 1e-3, "density": 16.0, "duration": 0.3, "samples": 3}
    errors = []
    for dt in (1e-3, 2.5e-4):
        settings = {"dt": dt, **({"method": "small_steps"} if engine == "pbd" else {})}
        spec = RunSpec(scene="hanging_cloth", engine=engine, parameters=parameters, settings=settings)
        errors.append(execute(spec).metric("position_error"))
    assert errors[0] < 5e-3
    assert errors[1] < 0.3 * errors[0]


def test_planar_engines_say_so():
    for engine, word in (("pymunk", "planar"), ("pybullet", "planar"), ("dop853", "minimal coordinates")):
        record = execute(RunSpec(scene="hanging_cloth", engine=engine, parameters={"size": 4}))
        assert record.status.code == "unsupported"
        assert word in record.status.quantity or "not installed" in record.status.quantity
