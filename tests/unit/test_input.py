"""Bad input: one line that names the field, the value and the allowed range; good input: never touched."""

from __future__ import annotations

import numpy as np
import pytest

import pbd
from pbd.errors import InvalidInput
from pbd.vector import from_store

NAN, INF = float("nan"), float("inf")
X = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]


def three(**changes):
    return pbd.particles(**{"positions": X, **changes})


def links(**changes):
    particles = three(**changes.pop("particles", {}))
    return pbd.distance(particles, **{"pairs": [(0, 1), (1, 2)], **changes})


def floor(**changes):
    return pbd.plane_contact(three(), **{"normal": (0.0, 1.0), **changes})


def simulation(**changes):
    return pbd.Simulation(three(), **changes)


def simulate(**changes):
    return pbd.simulate(three(), **{"duration": 1.0, **changes})


def bound_chain(law):
    return pbd.Simulation(three(), [links(law=law)])


def run(steps, samples=None):
    return simulation().run(steps, samples)


def refused(make):
    """The error of a call that must be refused, after checking that it is one readable line."""
    with pytest.raises(InvalidInput) as caught:
        make()
    error = caught.value
    line = str(error)
    assert "\n" not in line
    assert len(line) < 400
    assert line.startswith(f"{error.field} = ")
    assert ": must be " in line
    assert error.allowed
    return error


def case(field, value, make, name):
    return pytest.param(field, value, make, id=f"{field}-{name}")


def settings_cases():
    for value in (0.0, -1e-3, NAN, INF, -INF, 1e-300, 1e6, "0.01", None, True, 1j, np.array([1.0, 2.0])):
        yield case("settings.dt", value, lambda value=value: pbd.Settings(dt=value), str(value))
    for field in ("iterations", "substeps"):
        for value in (0, -1, 2_000_000_000, 10**400, 1.5, 1.0, NAN, "3", None, True):
            name = f"{value:.40}" if isinstance(value, str) else repr(value)[:12]
            yield case(f"settings.{field}", value, lambda f=field, value=value: pbd.Settings(**{f: value}), name)
    for value in (0.1, "rigid", pbd.Damping):
        yield case("settings.damping", value, lambda value=value: pbd.Settings(damping=value), repr(value))
    for value in (-0.1, 1.1, NAN, INF, "much", None):
        yield case("damping.k", value, lambda value=value: pbd.Damping(value), str(value))


def law_cases():
    for value in (-1e-9, 1.0000001, NAN, INF, -INF, "stiff", None, [0.1, 2.0], [0.1, NAN], [[0.1], [0.2, 0.3]], 1j):
        yield case("stiffness.k", value, lambda value=value: pbd.Stiffness(value), str(value))
    for field in ("alpha", "beta"):
        for value in (-1e-9, NAN, INF, -INF, "soft", None, [0.1, -2.0]):
            make = lambda f=field, value=value: pbd.Compliance(**{f: value})  # noqa: E731
            yield case(f"compliance.{field}", value, make, str(value))
    for law in (pbd.Stiffness, pbd.Compliance):
        yield case("relation", "at_mots", lambda law=law: law(relation="at_mots"), law.__name__)
    yield case("k", (3,), lambda: links(law=pbd.Stiffness([0.1, 0.2, 0.3])), "three values for two links")
    pinned = {"pinned": [0, 1]}
    law = pbd.Stiffness([0.1, 0.2, 0.3])
    yield case("k", (3,), lambda: links(law=law, particles=pinned), "three values for two links, one dropped")
    yield case("alpha", (1, 2), lambda: links(law=pbd.Compliance([[0.1, 0.2]])), "a matrix")


def particle_cases():
    for value in (0.0, -1.0, [1.0, 0.0, 1.0], 1e-320):
        yield case("masses", value, lambda value=value: three(masses=value), str(value))
    for value in (NAN, INF, [1.0, 2.0], "heavy", None, [[1.0, 1.0, 1.0]]):
        yield case("masses", value, lambda value=value: three(masses=value), str(value))
    bad_positions = {
        "nan": [[0.0, NAN]],
        "inf": [[0.0, -INF]],
        "flat": [0.0, 1.0],
        "scalar": 1.0,
        "empty list": [],
        "four dimensions": np.zeros((3, 4)),
        "no dimension": np.zeros((3, 0)),
        "three axes": np.zeros((3, 2, 1)),
        "ragged": [[0.0, 1.0], [2.0]],
        "object": np.array([[0.0, None]], dtype=object),
        "object of numbers": np.array([[0.0, 1.0]], dtype=object),
        "complex": np.array([[0.0, 1j]]),
        "text": [["a", "b"]],
        "none": None,
    }
    for name, value in bad_positions.items():
        yield case("positions", None, lambda value=value: pbd.particles(value), name)
    for value in (INF, NAN, [[1.0, 2.0]], np.zeros((3, 3)), "fast", None):
        yield case("velocities", None, lambda value=value: three(velocities=value), str(value))
    for value in ([3], [-1], [0.5], ["a"], [True, False, True], [[0], [1, 2]], [None], [2**63]):
        yield case("pinned", None, lambda value=value: three(pinned=value), str(value))


def constraint_cases():
    bad_pairs = {
        "too large": [(0, 3)],
        "negative": [(-1, 0)],
        "float": [(0.0, 1.0)],
        "triples": [(0, 1, 2)],
        "flat": [0, 1],
        "text": [("a", "b")],
        "ragged": [(0, 1), (2,)],
        "none": None,
    }
    for name, value in bad_pairs.items():
        yield case("pairs", None, lambda value=value: links(pairs=value), name)
    yield case("pairs", 1, lambda: links(pairs=[(0, 1), (1, 1)]), "repeated")
    for value in (0.0, -1.0, NAN, INF, [1.0, 0.0], [1.0, 1.0, 1.0], "long"):
        yield case("rest_length", None, lambda value=value: links(rest_length=value), str(value))
    yield case("rest_length", 0.0, lambda: links(particles={"positions": [[0.0, 0.0]] * 3}), "coincident particles")
    bad_contacts = {
        "friction": (-0.1, NAN, INF, "rough", None),
        "restitution": (2.0, -0.1, NAN, "bouncy", None),
        "gravity": (-9.81, NAN, INF, "down", None),
        "normal": ((0.0, 0.0), (0.0, 1.0, 0.0), (NAN, 1.0), (0.0, INF), "up", 1.0, np.zeros((0, 2))),
        "offset": (NAN, INF, [0.0, 1.0], "low"),
        "candidates": ([3], [-1], [0.5]),
    }
    for field, values in bad_contacts.items():
        for value in values:
            yield case(field, None, lambda f=field, value=value: floor(**{f: value}), str(value))
    for value in (NAN, INF, [[1.0, 2.0]], "push"):
        yield case("forces", None, lambda value=value: pbd.point_forces(three(), value), str(value))


def simulation_cases():
    for value in (NAN, (0.0, NAN), (0.0, -INF), (0.0, 0.0, -9.81), (-9.81,), [], "down", 9.81):
        yield case("gravity", None, lambda value=value: simulation(gravity=value), str(value))
    for value in (0.0, -1.0, NAN, INF, "long", None):
        yield case("duration", value, lambda value=value: simulate(duration=value), str(value))
    off_grid = pbd.Settings(dt=0.3)
    yield case("dt", 0.3, lambda: simulate(settings=off_grid, samples=1), "off the duration's grid")
    tiny = pbd.Settings(dt=1e-12)
    yield case("dt", 1e-12, lambda: simulate(duration=10.0, settings=tiny), "1e13 steps")
    yield case("steps", 2 * 10**12, lambda: run(2 * 10**12, [0]), "2e12 steps")
    for value in (-1, 1.5, NAN, "ten", None, True):
        yield case("steps", value, lambda value=value: run(value, []), str(value))
    for value in (0, -1, 3, 1.5, NAN, "all", None, 2000):
        yield case("samples", value, lambda value=value: simulate(samples=value), str(value))
    for value in ([-1], [11], [3, 2], [2, 2], [0.5], [[1, 2]], ["a"], [NAN]):
        yield case("samples", None, lambda value=value: run(10, value), str(value))


@pytest.mark.parametrize(
    ("field", "value", "make"),
    [*settings_cases(), *law_cases(), *particle_cases(), *constraint_cases(), *simulation_cases()],
)
def test_bad_input_is_refused_by_name(field, value, make):
    error = refused(make)
    assert error.field.partition("[")[0] == field
    if isinstance(value, float) and value == value:
        assert error.value == value


def test_the_offending_element_is_named():
    x = np.zeros((5, 2))
    x[3, 1] = NAN
    assert str(refused(lambda: pbd.particles(x))) == "positions[3, 1] = nan: must be finite"
    assert refused(lambda: links(rest_length=[1.0, -2.0])).field == "rest_length[1]"


def test_long_values_are_shortened():
    assert len(str(refused(lambda: pbd.Settings(iterations="x" * 10_000)))) < 200


def test_misspelt_names_get_a_suggestion():
    assert "did you mean 'at_most'?" in str(refused(lambda: pbd.Stiffness(relation="at_mots")))


def test_too_many_steps_come_with_an_estimate():
    error = refused(lambda: simulate(duration=100.0, settings=pbd.Settings(dt=1e-12)))
    assert "1.0e+14 steps" in str(error)


def test_too_many_particles_come_with_an_estimate():
    huge = np.broadcast_to(np.zeros((1, 3)), (10**9, 3))  # takes no memory by itself
    error = refused(lambda: pbd.particles(huge))
    assert error.value == 10**9
    assert "GB needed" in error.remedy


def test_errors_are_value_errors():
    with pytest.raises(ValueError, match=r"settings\.dt"):
        pbd.Settings(dt=-1.0)


# ------------------------------------------------------------------ good input


def test_no_particles_run():
    """N = 0 is a scene like any other."""
    particles = pbd.particles(np.zeros((0, 2)))
    batches = [pbd.distance(particles, np.zeros((0, 2), dtype=int)), pbd.distance(particles, [])]
    outcome = pbd.Simulation(particles, batches, gravity=(0.0, -9.81)).run(10)
    assert (outcome.status, outcome.projections) == ("ok", 0)
    assert outcome.positions.shape == (11, 0, 2)


def test_no_steps_and_no_samples_run():
    outcome = pbd.Simulation(three(), gravity=(0.0, -9.81)).run(0)
    np.testing.assert_array_equal(outcome.positions[0], X)
    nothing = pbd.Simulation(three(), gravity=(0.0, -9.81)).run(5, [])
    assert (nothing.steps, nothing.positions.shape) == (5, (0, 3, 2))


def test_an_empty_constraint_takes_any_law():
    assert pbd.distance(three(), [], law=pbd.Stiffness(0.5)).size() == 0


def test_settings_of_any_number_type_give_one_kernel():
    """A float32 dt or an int32 count is the same number, not another type of kernel or another precision."""
    plain = pbd.Settings(dt=0.25, iterations=2, substeps=4)
    other = pbd.Settings(dt=np.float32(0.25), iterations=np.int32(2), substeps=np.int16(4))
    assert other.h == plain.h
    assert type(other.h) is float
    ends = [pbd.Simulation(three(), gravity=(0.0, -9.81), settings=s).run(3).positions for s in (plain, other)]
    np.testing.assert_array_equal(*ends)
    assert pbd.simulate(three(), duration=1.0, samples=np.int64(2), settings=pbd.Settings(dt=0.25)).steps == 4


@pytest.mark.parametrize("dtype", [np.float32, np.int64, np.float16, bool])
def test_other_number_types_are_converted(dtype):
    particles = pbd.particles(np.array(X).astype(dtype), masses=np.ones(3, dtype=dtype))
    assert all(axis.dtype == np.float64 for axis in particles.x)
    np.testing.assert_array_equal(from_store(particles.x), np.array(X).astype(dtype))


LAYOUTS = {
    "contiguous": lambda a: a,
    "fortran": np.asfortranarray,
    "every second": lambda a: np.repeat(a, 2, axis=0)[::2],
    "reversed": lambda a: a[::-1].copy()[::-1],
    "big-endian": lambda a: a.astype(a.dtype.newbyteorder(">")),
    "read-only": lambda a: np.broadcast_to(a, a.shape),
}


@pytest.mark.parametrize("layout", list(LAYOUTS))
def test_any_layout_gives_the_same_run_and_stays_as_it_was(layout):
    """Non-contiguous, foreign, read-only: copied on entry, and never written."""
    arrange = LAYOUTS[layout]
    given = {
        "x": arrange(np.array(X)),
        "v": arrange(np.array([[0.0, 0.0], [0.0, 1.0], [2.0, 0.0]])),
        "m": arrange(np.array([1.0, 2.0, 3.0])),
        "pairs": arrange(np.array([[0, 1], [1, 2]])),
        "rest": arrange(np.array([1.0, 0.5])),
        "k": arrange(np.array([0.5, 0.25])),
    }
    before = {name: value.copy() for name, value in given.items()}
    particles = pbd.particles(given["x"], velocities=given["v"], masses=given["m"], pinned=[0])
    law = pbd.Stiffness(given["k"])
    batch = pbd.distance(particles, given["pairs"], rest_length=given["rest"], law=law)
    outcome = pbd.Simulation(particles, [batch], gravity=(0.0, -9.81)).run(20)
    np.testing.assert_allclose(outcome.positions[-1], EXPECTED_END, atol=1e-12)
    for name, value in given.items():
        np.testing.assert_array_equal(value, before[name], err_msg=name)


def expected_end():
    particles = pbd.particles(X, velocities=[[0, 0], [0, 1], [2, 0]], masses=[1, 2, 3], pinned=[0])
    batch = pbd.distance(particles, [(0, 1), (1, 2)], rest_length=[1.0, 0.5], law=pbd.Stiffness([0.5, 0.25]))
    return pbd.Simulation(particles, [batch], gravity=(0.0, -9.81)).run(20, [20]).positions[0]


EXPECTED_END = expected_end()


def test_user_arrays_are_not_aliased():
    """Changing what was handed in, after it was handed in, changes nothing."""
    x, v, m = np.array(X), np.array([[0.0, 0.0], [0.0, 1.0], [2.0, 0.0]]), np.array([1.0, 2.0, 3.0])
    pairs, rest, k = np.array([[0, 1], [1, 2]]), np.array([1.0, 0.5]), np.array([0.5, 0.25])
    gravity, forces = np.array([0.0, -9.81]), np.zeros((3, 2))
    particles = pbd.particles(x, velocities=v, masses=m, pinned=[0])
    law = pbd.Stiffness(k)
    k[:] = 0.0
    batch = pbd.distance(particles, pairs, rest_length=rest, law=law)
    field = pbd.point_forces(particles, forces)
    simulation = pbd.Simulation(particles, [batch], gravity=gravity, external=[field])
    for array in (x, v, m, pairs, rest, gravity, forces):
        array[...] = 7
    np.testing.assert_allclose(simulation.run(20, [20]).positions[0], EXPECTED_END, atol=1e-12)


def test_runs_do_not_touch_one_another():
    """Each run starts from the same state, and an outcome stays as it was when more runs follow."""
    particles = three(pinned=[0])
    batch = pbd.distance(particles, [(0, 1), (1, 2)], law=pbd.Compliance(1e-3))
    simulation = pbd.Simulation(particles, [batch], gravity=(0.0, -9.81))
    first = simulation.run(50)
    kept = [first.positions.copy(), first.scene.batches[0].law.multiplier.copy()]
    kept.append(from_store(first.scene.state.particles.x))
    simulation.run(7)
    np.testing.assert_array_equal(first.positions, kept[0])
    np.testing.assert_array_equal(first.scene.batches[0].law.multiplier, kept[1])
    np.testing.assert_array_equal(from_store(first.scene.state.particles.x), kept[2])
    np.testing.assert_array_equal(simulation.run(50).positions, first.positions)
    np.testing.assert_array_equal(from_store(particles.x), X)


@pytest.mark.parametrize(
    "build",
    [
        lambda huge: pbd.Damping(huge),
        lambda huge: pbd.plane_contact(three(), normal=(0.0, 1.0), friction=huge),
        lambda huge: pbd.simulate(three(), duration=huge),
    ],
    ids=["damping", "friction", "duration"],
)
def test_whole_numbers_beyond_any_float_are_refused(build):
    with pytest.raises(InvalidInput):
        build(10**400)
