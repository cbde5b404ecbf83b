"""Bad input of rigid bodies: one line that names the field, the value and the allowed range; nothing is changed."""

from __future__ import annotations

import numpy as np
import pytest

import pbd
from pbd.errors import InvalidInput

NAN, INF = float("nan"), float("inf")
UP = {2: [0.0, 1.0], 3: [0.0, 1.0, 0.0]}
NUMBERS = (-1.0, NAN, INF, "much", None, [0.1, 0.2], True, 10**400)


def boxes(d=2, n=2, **changes):
    """A column of n boxes that do not touch."""
    x = np.zeros((n, d))
    x[:, 1] = 1.0 + 2.0 * np.arange(n)
    return pbd.bodies(**{"shapes": [pbd.Box((1.0,) * d)] * n, "positions": x, **changes})


def floor(bodies, **changes):
    return pbd.contacts(bodies, pbd.planes(UP[len(bodies.x)]), **changes)


def simulation(bodies=None, batches=None, gravity=(0.0, -9.81), particles=None, **changes):
    bodies = boxes() if bodies is None else bodies
    batches = [floor(bodies)] if batches is None else batches
    chosen = {"integrator": pbd.Rattle(), "solver": pbd.ConjugateSweeps(), **changes}
    settings = pbd.Settings(**chosen)
    return pbd.Simulation(particles, batches, bodies=bodies, gravity=gravity, settings=settings)


def arrays(value):
    """Copies of all arrays in nested tuples."""
    if isinstance(value, np.ndarray):
        return [value.copy()]
    return [array for part in value for array in arrays(part)] if isinstance(value, tuple) else []


def refused(make):
    """The error of a call that must be refused, after checking that it is one readable line."""
    with pytest.raises(InvalidInput) as caught:
        make()
    line = str(caught.value)
    assert "\n" not in line
    assert len(line) < 400
    assert line.startswith(f"{caught.value.field} = ")
    assert ": must be " in line
    return caught.value


def case(field, make, name):
    return pytest.param(field, make, id=f"{field}-{name}")


def shape_cases():
    for size in ((1.0, 0.0), (-1.0, 1.0), (NAN, 1.0), (1.0, INF), (1.0, 1e10), (1.0,), (1.0,) * 3, 1.0, "ab", None):
        yield case("shapes[0].size", lambda size=size: boxes(shapes=[pbd.Box(size)] * 2), str(size))
    for radius in (0.0, -1.0, NAN, INF, 1e10, "big", None, True, [1.0]):
        yield case("shapes[1].radius", lambda r=radius: boxes(shapes=[pbd.Ball(1.0), pbd.Ball(r)]), str(radius))
    box = pbd.Box((1.0, 1.0))
    for name, value in {"one": [box], "three": [box] * 3, "none": None, "a shape": box, "numbers": [1.0, 1.0]}.items():
        yield case("shapes", lambda value=value: boxes(shapes=value), name)


def body_cases():
    for value in (0.0, -1.0, [1.0, 0.0], 1e-320, NAN, INF, [1.0] * 3, [[1.0, 1.0]], "heavy", None, 1j):
        yield case("masses", lambda value=value: boxes(masses=value), str(value))
    bad = {
        "nan": [[0.0, NAN]],
        "inf": [[0.0, INF]],
        "flat": [0.0, 1.0],
        "line": np.zeros((2, 1)),
        "four dimensions": np.zeros((2, 4)),
        "ragged": [[0.0, 1.0], [2.0]],
        "text": [["a", "b"]],
        "none": None,
    }
    for name, value in bad.items():
        yield case("positions", lambda value=value: boxes(positions=value), name)
    for d in (2, 3):
        for value in (NAN, [1.0, INF], "fast", None, np.zeros((3, d)), np.zeros((2, 5 - d))):
            yield case("velocities", lambda d=d, value=value: boxes(d, velocities=value), f"{d}D-{value}")
        for value in (NAN, "fast", np.zeros(3), np.zeros((3, 3)), np.zeros((2, 3)) if d == 2 else np.zeros(2)):
            yield case("spins", lambda d=d, value=value: boxes(d, spins=value), f"{d}D-{value}")
    for value in ([2], [-1], [0.5], ["a"], [True, False], [[0], [0, 1]]):
        yield case("fixed", lambda value=value: boxes(fixed=value), str(value))


def orientation_cases():
    for value in (NAN, [0.0, INF], [0.0] * 3, [[1.0, 0.0, 0.0, 0.0]] * 2, "up"):
        yield case("orientations", lambda value=value: boxes(2, orientations=value), f"2D-{value}")
    one = [1.0, 0.0, 0.0, 0.0]
    for value in ([NAN, 0.0, 0.0, 0.0], [0.0] * 4, [2.0, 0.0, 0.0, 0.0], [1.0 + 2e-6, 0.0, 0.0, 0.0], [1.0] * 4):
        yield case("orientations", lambda value=value: boxes(3, orientations=[one, value]), f"3D-{value}")
    for value in ([0.0, 0.0], [one], [one] * 3, np.eye(3), [one[:3]] * 2, 1.0):
        yield case("orientations", lambda value=value: boxes(3, orientations=value), f"3D-{np.shape(value)}")


def contact_cases():
    for field in ("friction", "restitution", "gravity", "depenetration"):
        for value in NUMBERS:
            yield case(field, lambda f=field, value=value: floor(boxes(), **{f: value}), repr(value)[:12])
    yield case("restitution", lambda: floor(boxes(), restitution=2.0), "2")
    yield case("depenetration", lambda: floor(boxes(), depenetration=0.0), "0")
    for d in (2, 3):
        yield case(
            "planes", lambda d=d: pbd.contacts(boxes(d), pbd.planes(UP[5 - d])), f"in {d}D of the other dimension"
        )
    for value in ((0.0, 0.0), (NAN, 1.0), (0.0, INF), (1.0,), [[1.0] * 4], 1.0, "up", None, np.ones((1, 1, 2))):
        yield case("normals", lambda value=value: pbd.planes(value), str(value))
    for value in (NAN, [0.0, 1.0], "low", None):
        yield case("offsets", lambda value=value: pbd.planes([0.0, 1.0], value), str(value))


def settings_cases():
    for value in (-1, 1001, 1.5, NAN, "all", None, True):
        yield case("integrator.events", lambda value=value: pbd.Rattle(value), str(value))
    for value in (0, -1, 1.5, 10**7, "all", None, True):
        yield case("solver.velocity_iterations", lambda value=value: pbd.ConjugateSweeps(value), str(value))
    for value in (-1e-9, 1.1, NAN, "fine", None):
        yield case("solver.tolerance", lambda value=value: pbd.ConjugateSweeps(10, value), str(value))


def simulation_cases():
    for value in ((0.0, NAN), (0.0, -INF), 9.81, "down", (-9.81,), (0.0, -9.81, 0.0)):
        yield case("gravity", lambda value=value: simulation(gravity=value), f"2D-{value}")
    yield case("gravity", lambda: simulation(boxes(3), gravity=(0.0, -9.81)), "3D")
    other = {
        "euler": lambda: simulation(integrator=pbd.Euler()),
        "shake": lambda: simulation(integrator=pbd.Shake()),
        "rattle with particles too": lambda: simulation(particles=pbd.particles([[0.0, 0.0]])),
        "rattle without bodies": lambda: pbd.Simulation(
            pbd.particles([[0.0, 0.0]]), settings=pbd.Settings(integrator=pbd.Rattle())
        ),
    }
    for name, make in other.items():
        yield case("settings.integrator", make, name)
    yield case("settings.precision", lambda: simulation(precision="float32"), "float32")
    yield case("settings.damping", lambda: simulation(damping=pbd.Damping(0.1)), "damping")
    lone = pbd.Settings(solver=pbd.ConjugateSweeps())
    yield case("settings.solver", lambda: pbd.Simulation(pbd.particles([[0.0, 0.0]]), settings=lone), "without bodies")
    for solver in (pbd.Direct(), pbd.Jacobi(), pbd.Multilevel()):
        yield case("settings.solver", lambda solver=solver: simulation(solver=solver), type(solver).__name__)


CASES = [
    *shape_cases(),
    *body_cases(),
    *orientation_cases(),
    *contact_cases(),
    *settings_cases(),
    *simulation_cases(),
]


@pytest.mark.parametrize(("field", "make"), CASES)
def test_bad_input_is_refused_by_name(field, make):
    error = refused(make)
    assert error.field == field or error.field.startswith(f"{field}[")


@pytest.mark.parametrize(
    ("bodies", "made_for"),
    [((2, 2), (2, 3)), ((2, 3), (2, 2)), ((2, 2), (3, 2)), ((3, 2), (2, 2))],
    ids=["more", "fewer", "in space", "in the plane"],
)
def test_contacts_of_other_bodies_are_refused(bodies, made_for):
    """Their arrays have another length: a kernel would read and write beyond them."""
    mine = boxes(*bodies)
    refused(lambda: simulation(mine, [floor(boxes(*made_for))], gravity=[-9.81 * y for y in UP[bodies[0]]]))


def test_contacts_of_bodies_are_refused_beside_particles():
    refused(lambda: pbd.Simulation(pbd.particles([[0.0, 0.0]]), [floor(boxes())]))


def test_constraints_of_particles_are_refused_beside_bodies():
    plane = pbd.plane_contact(pbd.particles([[0.0, 0.0]]), normal=(0.0, 1.0))
    refused(lambda: simulation(batches=[plane]))


def test_the_offending_element_is_named():
    x = np.zeros((5, 2))
    x[3, 1] = NAN
    assert str(refused(lambda: boxes(positions=x))) == "positions[3, 1] = nan: must be finite"
    far = refused(lambda: boxes(3, orientations=[[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 3.0, 0.0]]))
    assert (far.field, far.value) == ("orientations[1]", [0.0, 0.0, 3.0, 0.0])
    assert refused(lambda: boxes(masses=[1.0, -2.0])).value == -2.0
    assert refused(lambda: boxes(fixed=[1, 7])).value == 7
    assert refused(lambda: floor(boxes(), friction=-0.5)).value == -0.5


def test_what_may_be_done_instead_is_told():
    assert refused(lambda: boxes(masses=0.0)).remedy == "list immovable bodies in fixed"
    assert "rattle" in str(refused(lambda: simulation(integrator=pbd.Euler())))


@pytest.mark.parametrize("d", [2, 3])
def test_a_refusal_changes_nothing(d):
    x, m = np.array([UP[d]]), np.array([2.0])
    bodies = pbd.bodies([pbd.Ball(0.5)], x, masses=m)
    contacts = floor(bodies)
    before = arrays(bodies), arrays(contacts)
    for make in (
        lambda: pbd.bodies([pbd.Ball(0.5)], x, masses=m, spins=NAN),
        lambda: floor(bodies, friction=-1.0),
        lambda: simulation(bodies, [contacts], gravity=(NAN,) * d),
        lambda: simulation(bodies, [contacts], gravity=(0.0,) * d, precision="float32"),
    ):
        refused(make)
    np.testing.assert_array_equal(x, [UP[d]])
    np.testing.assert_array_equal(m, [2.0])
    for old, new in zip(before, (arrays(bodies), arrays(contacts)), strict=True):
        for one, other in zip(old, new, strict=True):
            np.testing.assert_array_equal(one, other)


# ------------------------------------------------------------------ good input


@pytest.mark.parametrize("d", [2, 3])
def test_a_scene_without_bodies_runs(d):
    """N = 0 is a scene like any other."""
    none = pbd.bodies([], np.zeros((0, d)))
    outcome = simulation(none, gravity=[-9.81 * y for y in UP[d]]).run(3)
    assert (outcome.status, outcome.projections, outcome.pairs) == ("ok", 0, 0)
    assert outcome.bodies.positions.shape == (4, 0, d)
    assert outcome.bodies.orientations.shape == ((4, 0) if d == 2 else (4, 0, 4))


@pytest.mark.parametrize("d", [2, 3])
def test_user_arrays_are_not_aliased(d):
    """Changing what was handed in, after it was handed in, changes nothing."""
    turns = np.zeros(1) if d == 2 else np.array([[1.0, 0.0, 0.0, 0.0]])
    spins = np.ones(1) if d == 2 else np.array([[0.0, 0.0, 1.0]])
    given = {
        "positions": 2.0 * np.array([UP[d]]),
        "masses": np.array([3.0]),
        "orientations": turns,
        "velocities": np.array([UP[d]]),
        "spins": spins,
    }
    normal, offset, gravity = np.array([UP[d]]), np.zeros(1), -9.81 * np.array(UP[d])
    bodies = pbd.bodies([pbd.Ball(0.5)], **given)
    made = simulation(bodies, [pbd.contacts(bodies, pbd.planes(normal, offset))], gravity=gravity, dt=0.01)
    expected = made.run(50, [50]).bodies
    for array in (*given.values(), normal, offset, gravity):
        array[...] = 7.0
    again = made.run(50, [50]).bodies
    for one, other in zip(expected, again, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("d", [2, 3])
def test_runs_do_not_touch_one_another(d):
    """Each run starts from the same state, and an outcome stays as it was when more runs follow."""
    bodies = boxes(d, velocities=1.0, spins=1.0)
    made = simulation(bodies, [floor(bodies, friction=0.5)], gravity=[-9.81 * y for y in UP[d]], dt=0.01)
    before = arrays(bodies)
    first = made.run(50)
    kept = [array.copy() for array in first.bodies]
    made.run(20)
    for one, other, third in zip(kept, first.bodies, made.run(50).bodies, strict=True):
        np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(one, third)
    for one, other in zip(before, arrays(bodies), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_nearly_unit_quaternion_is_normalised():
    q = np.array([0.6, 0.0, 0.8, 0.0]) * (1.0 + 9e-7)
    bodies = boxes(3, orientations=[q, q])
    turn = np.array([axis[0] for axis in bodies.turn])
    assert abs(np.linalg.norm(turn) - 1.0) <= 1e-15
    np.testing.assert_allclose(turn, [0.6, 0.0, 0.8, 0.0], atol=1e-15)


def test_normals_of_any_length_are_normalised():
    made = pbd.planes([[0.0, 3.0], [-4.0, 3.0]], [1.0, 2.0])
    np.testing.assert_allclose(np.transpose(made.normal), [[0.0, 1.0], [-0.8, 0.6]], atol=1e-15)
    np.testing.assert_array_equal(made.offset, [1.0, 2.0])
