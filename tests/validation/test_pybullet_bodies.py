"""Rigid bodies in Bullet, calibrated on closed forms: free motion, every kind of contact pair, traps."""

from __future__ import annotations

import dataclasses
import itertools
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from comparisons import engine
from comparisons.bodies import Ball, Box, Planes, at_rest, rotations
from comparisons.engines import _pybullet_bodies as rigid
from comparisons.metrics import Subject
from comparisons.scene import Scene, empty, no_masses
from pbd.errors import InvalidInput

adapter = engine.load("pybullet")
if adapter.missing():
    pytest.skip(adapter.missing(), allow_module_level=True)

G = 9.81
BOTH = ("by_links", "articulated")
STEP = 1.0 / 240.0
SQUARE, DISC, PLATE = Box((1.0, 1.0)), Ball(0.5), Box((1.0, 0.2))
GROUND = Planes(np.array([[0.0, 1.0]]), np.zeros(1))
NEAR = 1.2e-9
"""What a skin of 1e-10 m and a slop of 1e-9 m leave open [m]."""


def build(shapes, positions, *, masses=None, planes=GROUND, gravity=None, duration=1.0, samples=10, **more):
    """A scene of bodies; in 3D gravity is along -z. ``more``: friction, restitution, and changes to `at_rest`."""
    x = np.atleast_2d(np.asarray(positions, dtype=float))
    d = x.shape[1]
    contact = {key: more.pop(key) for key in ("friction", "restitution") if key in more}
    bodies = at_rest(tuple(shapes), np.ones(len(x)) if masses is None else np.asarray(masses, dtype=float), x, **more)
    pull = np.array([*[0.0] * (d - 1), -G]) if gravity is None else np.asarray(gravity, dtype=float)
    return Scene("test", "", no_masses(d), (), pull, duration, samples, (), bodies=bodies, planes=planes, **contact)


def simulate(scene, preset="matched", **changes):
    settings = engine.make_settings("pybullet", preset, {"dt": STEP, **changes})
    assert adapter.unsupported(scene, settings) == ""
    return adapter.prepare(scene, settings)()


def tilted(angle):
    """A plane through the origin that falls along +x, the way down it, and its normal."""
    normal, down = np.array([np.sin(angle), np.cos(angle)]), np.array([np.cos(angle), -np.sin(angle)])
    return Planes(normal[None], np.zeros(1)), down, normal


def way(out, down):
    """(s,) of the first body along a direction since the start [m]."""
    return (out.positions[:, 0] - out.positions[0, 0]) @ down


# ------------------------------------------------------------------ free motion


@pytest.mark.parametrize("formulation", BOTH)
@pytest.mark.parametrize("dimension", [2, 3])
def test_free_fall_kicks_first_and_the_half_kick_makes_it_exact(formulation, dimension):
    shape = [Box((1.0,) * dimension)]
    scene = build(shape, [[0.0] * dimension], planes=None)
    down = np.array([*[0.0] * (dimension - 1), -1.0])
    fallen = 0.5 * G * scene.times**2
    plain = way(simulate(scene, formulation=formulation, half_kick=False), down)
    np.testing.assert_allclose(plain, fallen + 0.5 * G * scene.times * STEP, atol=1e-12)
    out = simulate(scene, formulation=formulation)
    np.testing.assert_allclose(way(out, down), fallen, atol=1e-12)
    np.testing.assert_allclose(out.velocities[:, 0] @ down, G * scene.times, atol=1e-12)
    assert out.contact_forces is None


def test_defaults_damp_a_fall():
    out = simulate(build([SQUARE], [0.0, 0.0], planes=None), "default", dt=0.01)
    assert out.positions[-1, 0, 1] == pytest.approx(-4.606547, abs=1e-6)  # as of a body without shape, see findings


@pytest.mark.parametrize("formulation", BOTH)
@pytest.mark.parametrize(("shape", "spin"), [(SQUARE, 30.0), (DISC, -80.0), (PLATE, 180.0)])
def test_planar_spin_is_kept_and_its_angle_continuous(formulation, shape, spin):
    """Many turns between samples, from an angle that is itself beyond one turn."""
    scene = build([shape], [0.0, 0.0], planes=None, spins=np.array([spin]), orientations=np.array([7.0]))
    out = simulate(scene, formulation=formulation)
    np.testing.assert_allclose(out.orientations[:, 0], 7.0 + spin * scene.times, atol=1e-10)
    np.testing.assert_allclose(out.spins[:, 0], spin, rtol=1e-12)
    assert out.residue < 1e-12


def euler_top(scene):
    """Attitude and spins in the world of the free 3D body of a scene, by a fine integration of Euler's equations."""
    inertia, start = scene.bodies.inertias[0], scene.bodies.orientations[0]
    body_spin = rotations(start, 3).T @ scene.bodies.spins[0]

    def rhs(_, y):
        (w, *v), spin = y[:4], y[4:]
        turning = 0.5 * np.array([-np.dot(v, spin), *(w * spin + np.cross(v, spin))])
        return np.concatenate([turning, -np.cross(spin, inertia * spin) / inertia])

    times = scene.times
    y = solve_ivp(rhs, (0.0, times[-1]), [*start, *body_spin], rtol=1e-11, atol=1e-13, t_eval=times).y.T
    attitudes = rotations(y[:, :4], 3)
    return attitudes, np.einsum("sij,sj->si", attitudes, y[:, 4:])


@pytest.mark.parametrize("formulation", BOTH)
def test_a_free_body_turns_as_euler_says_to_first_order(formulation):
    """Unequal moments, turned at the start: a slip in the order of axes or quaternions shows at order 0."""
    turned = np.array([[0.8, 0.0, 0.6, 0.0]])
    scene = build(
        [Box((0.3, 0.2, 0.1))], [[0.0] * 3], planes=None, orientations=turned, spins=np.array([[0.5, 5.0, 0.2]])
    )
    attitudes, spins = euler_top(scene)
    errors = []
    for dt in (STEP, STEP / 4.0):
        out = simulate(scene, formulation=formulation, dt=dt)
        errors.append(
            [
                np.abs(rotations(out.orientations[:, 0], 3) - attitudes).max(),
                np.abs(out.spins[:, 0] - spins).max() / 5.0,
            ]
        )
    np.testing.assert_allclose(np.log(np.divide(*errors)) / np.log(4.0), 1.0, atol=0.15)  # measured 1.00 to 1.03
    assert np.max(errors[1]) < 5e-3  # measured 4e-3


# ------------------------------------------------------------------ friction, of every pair


def sliders():
    """Who slides on whom: the scene, and who moves."""
    for on, dimension in itertools.product(("plane", "fixed box"), (2, 3)):
        place = [0.0] * (dimension - 1)
        plate = Box((1.0, 0.2)) if dimension == 2 else Box((1.0, 0.8, 0.2))
        launch = np.array([[4.0, 0.0]]) if dimension == 2 else 4.0 * np.array([[np.cos(0.3), np.sin(0.3), 0.0]])
        if on == "plane":
            planes = Planes(np.eye(dimension)[-1:], np.zeros(1))
            yield build([plate], [[*place, 0.1]], planes=planes, velocities=launch, friction=0.5, duration=2.0)
            continue
        table = Box((20.0,) * dimension)
        yield build(
            [plate, table], [[*place, 0.1], [*place, -10.0]], planes=None, friction=0.5, duration=2.0, fixed=(1,),
            masses=[1.0, 7.0], velocities=np.concatenate([launch, 0.0 * launch]),
        )  # fmt: skip


@pytest.mark.parametrize("scene", list(sliders()), ids=["plane 2D", "plane 3D", "box 2D", "box 3D"])
def test_slide_to_rest_has_the_scene_s_friction(scene):
    distance = 4.0**2 / (2.0 * 0.5 * G)
    out = simulate(scene, half_kick=False)
    gone = np.linalg.norm(out.positions[-1, 0] - out.positions[0, 0])
    assert gone == pytest.approx(distance - 4.0 * STEP / 2.0, abs=5e-5)  # velocity first: v0 h/2 short
    out = simulate(scene)
    gone = out.positions[-1, 0] - out.positions[0, 0]
    assert np.linalg.norm(gone) == pytest.approx(distance, abs=5e-5)  # measured 3e-6 to 2e-5
    assert gone @ scene.bodies.velocities[0] == pytest.approx(4.0 * distance, abs=1e-3), "straight on"
    assert np.abs(out.velocities[-1]).max() < 1e-9
    assert np.array_equal(out.positions[:, 1:], np.broadcast_to(scene.bodies.positions[1:], out.positions[:, 1:].shape))


def test_friction_between_free_bodies():
    """A plate slides on a heavier box, without ground: momentum is kept, and the relative motion ends."""
    scene = build(
        [PLATE, Box((6.0, 1.0))], [[-1.0, 0.1], [0.0, -0.5]], masses=[1.0, 3.0], friction=0.4, duration=0.5,
        planes=Planes(np.array([[0.0, 1.0]]), np.array([-1.0])), velocities=np.array([[3.0, 0.0], [0.0, 0.0]]),
    )  # fmt: skip
    out = simulate(scene)
    slowed = 3.0 - 0.4 * G * scene.times
    np.testing.assert_allclose(out.velocities[:, 0, 0], slowed, atol=2e-3)
    assert np.abs(out.velocities[:, 1, 0]).max() < 1e-9, "the ground holds more than the plate pulls"
    assert out.residue < 1e-9


@pytest.mark.parametrize("preset", ["matched", "matched_bounce"])
def test_incline_holds_below_the_limit_and_slips_above(preset):
    """tan 26 deg = 0.4877 of 0.5; above, the acceleration is g (sin - mu cos)."""
    for angle, friction in ((np.deg2rad(26.0), 0.5), (0.5, 0.3)):
        planes, down, normal = tilted(angle)
        scene = build([PLATE], 0.1 * normal, planes=planes, friction=friction, orientations=np.array([-angle]))
        out = simulate(scene, preset)
        pull = max(0.0, G * (np.sin(angle) - friction * np.cos(angle)))
        late = 0.0 if preset == "matched" else 0.5 * pull * STEP * scene.times
        np.testing.assert_allclose(way(out, down), 0.5 * pull * scene.times**2 + late, atol=NEAR)
        np.testing.assert_allclose(way(out, normal), 0.0, atol=NEAR)


@pytest.mark.parametrize("formulation", BOTH)
@pytest.mark.parametrize(("shape", "share"), [(DISC, 0.5), (Ball(0.5, 3), 0.4)])
def test_rolling_has_the_inertia_of_the_shape(shape, share, formulation):
    """g sin / (1 + c), c = 1/2 of a disc and 2/5 of a sphere, without slipping."""
    angle = 0.3
    planes, down, normal = tilted(angle)
    if shape.dimension == 3:
        down, normal = np.array([down[0], 0.0, down[1]]), np.array([normal[0], 0.0, normal[1]])
        planes = Planes(normal[None], np.zeros(1))
    scene = build([shape], 0.5 * normal, planes=planes, friction=0.5, duration=2.0)
    out = simulate(scene, formulation=formulation)
    pull = G * np.sin(angle) / (1.0 + share)
    np.testing.assert_allclose(way(out, down), 0.5 * pull * scene.times**2, atol=NEAR)
    rolling = -out.spins[:, 0] if shape.dimension == 2 else out.spins[:, 0, 1]
    np.testing.assert_allclose(0.5 * rolling, pull * scene.times, atol=2.0 * NEAR)
    if shape.dimension == 2:
        np.testing.assert_allclose(-0.5 * out.orientations[:, 0], way(out, down), atol=NEAR)


@pytest.mark.parametrize("on_box", [False, True])
def test_a_disc_that_slips_ends_up_rolling_at_two_thirds(on_box):
    planes, more = GROUND, {}
    shapes, places = [DISC], [[0.0, 0.5]]
    if on_box:
        planes, more = None, {"fixed": (1,)}
        shapes, places = [DISC, Box((30.0, 30.0))], [[0.0, 0.5], [0.0, -15.0]]
    launch = np.zeros((len(shapes), 2))
    launch[0, 0] = 3.0
    out = simulate(build(shapes, places, planes=planes, friction=0.3, velocities=launch, **more))
    slowed = np.maximum(3.0 - 0.3 * G * out.times, 2.0)
    np.testing.assert_allclose(out.velocities[:, 0, 0], slowed, atol=1e-5)
    np.testing.assert_allclose(out.spins[-1, 0], -4.0, atol=1e-5)


def test_a_disc_touches_the_sharp_corner_of_a_box():
    """At rest in the notch of two squares whose corners are 0.6 apart: 0.4 above them, as 3-4-5."""
    scene = build(
        [DISC, SQUARE, SQUARE], [[0.0, 0.4], [-0.8, -0.5], [0.8, -0.5]], fixed=(1, 2), planes=None, friction=0.5
    )
    np.testing.assert_allclose(simulate(scene).positions[-1, 0], [0.0, 0.4], atol=NEAR)


# ------------------------------------------------------------------ restitution, of every pair


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize(
    ("first", "second"), [(SQUARE, SQUARE), (DISC, DISC), (DISC, SQUARE), (Box((1.0,) * 3), Ball(0.5, 3))]
)
def test_impact_of_two_has_newton_s_velocities(first, second, restitution):
    d = 3 if isinstance(second, Ball) and second.dimension == 3 else 2
    places, launch = np.zeros((2, d)), np.zeros((2, d))
    places[1, 0], launch[0, 0] = 1.1, 2.0
    scene = build(
        [first, second], places, masses=[1.0, 3.0], planes=None, gravity=np.zeros(d), velocities=launch,
        restitution=restitution,
    )  # fmt: skip
    end = simulate(scene, "matched_bounce").velocities[-1]
    expected = np.zeros((2, d))
    expected[:, 0] = 2.0 * (1.0 - 3.0 * restitution) / 4.0, 2.0 * (1.0 + restitution) / 4.0
    np.testing.assert_allclose(end, expected, atol=2e-6)


@pytest.mark.parametrize("shape", [SQUARE, DISC, Box((1.0,) * 3), Ball(0.5, 3)])
def test_a_flat_impact_reverses_e_times_the_speed(shape):
    """Without gravity: no error of a fall, and none of the place of the impact, touches the speed."""
    d = shape.dimension if isinstance(shape, Ball) else len(shape.size)
    height = np.array([[*[0.0] * (d - 1), 0.8]])
    floor, launch = Planes(np.eye(d)[-1:], np.zeros(1)), -2.5 * height
    scene = build([shape], height, planes=floor, gravity=np.zeros(d), velocities=launch, restitution=0.5)
    out = simulate(scene, "matched_bounce")
    np.testing.assert_allclose(out.velocities[-1, 0], [*[0.0] * (d - 1), 1.0], atol=1e-6)
    assert np.abs(out.spins).max() < 1e-9


@pytest.mark.parametrize("shape", [SQUARE, DISC])
def test_bounce_keeps_elastic_energy_where_rest_loses_or_pumps_it(shape):
    """Ten seconds at e = 1, friction 0; the worst of the samples."""
    scene = build([shape], [0.0, 1.5], restitution=1.0, duration=10.0, samples=200)
    bounced = Subject(simulate(scene, "matched_bounce"), scene).energy
    assert np.abs(bounced[-1] / bounced[0] - 1.0) < 5e-3  # measured 1e-3
    rested = Subject(simulate(scene, "matched"), scene).energy
    assert np.abs(rested[-1] / rested[0] - 1.0) > 0.5  # of its 1.5 m a disc falls 1 m for good; a square gains


def test_an_impact_at_a_sample_shows_no_mean_of_before_and_after():
    """With a half kick rates are kept half a step apart, and their mean over an elastic impact would be nearly 0."""
    scene = build([DISC], [0.0, 1.5], restitution=1.0, duration=2.0, samples=480)
    energy = Subject(simulate(scene, "matched_bounce", half_kick=True), scene).energy
    assert energy.min() > 0.97 * energy[0]  # measured 0.99


# ------------------------------------------------------------------ rest


@pytest.mark.parametrize("formulation", BOTH)
@pytest.mark.parametrize("dimension", [2, 3])
def test_contact_force_of_a_body_at_rest_is_its_weight(formulation, dimension):
    """On an incline too, where friction bears a part."""
    planes, _, normal = tilted(0.3)
    turn = np.array([-0.3])
    if dimension == 3:
        normal = np.array([normal[0], 0.0, normal[1]])
        planes, turn = Planes(normal[None], np.zeros(1)), np.array([[np.cos(0.15), 0.0, np.sin(0.15), 0.0]])
    plate = Box((1.0, 0.2)) if dimension == 2 else Box((1.0, 0.8, 0.2))
    scene = build([plate], 0.1 * normal, masses=[2.5], planes=planes, friction=0.5, orientations=turn)
    out = simulate(scene, formulation=formulation)
    assert out.contact_forces.shape == (11,)
    assert out.contact_forces[-1] == pytest.approx(2.5 * G, rel=1e-6)


def jittered(count, seed=0):
    """A stack of squares, shifted at random by a hundredth."""
    shift = np.random.default_rng(seed).uniform(-0.01, 0.01, count)
    places = np.column_stack([shift, np.arange(count) + 0.5])
    return build([SQUARE] * count, places, friction=0.5, duration=3.0, samples=60)


def test_a_jittered_stack_stands():
    scene = jittered(10)
    errors = {}
    for preset in ("default", "matched", "matched_bounce"):
        out = simulate(scene, preset)
        errors[preset] = np.linalg.norm(out.positions - scene.bodies.positions, axis=2).max()
        assert out.contact_forces[-1] == pytest.approx(10.0 * G, rel=1e-3)
    assert errors["matched"] < 1e-3  # measured 4.9e-4
    assert errors["default"] > 5.0 * errors["matched"]  # measured 3.7e-3: warm starting at 0.1 sinks
    assert errors["matched_bounce"] > 3.0 * errors["matched"]  # measured 2.8e-3
    assert out.residue < 1e-12


def test_a_heavy_box_rests_on_a_light_one():
    """1000 kg on 1 kg."""
    scene = build([SQUARE, SQUARE], [[0.0, 0.5], [0.0, 1.5]], masses=[1.0, 1000.0], friction=0.5, duration=2.0)
    out = simulate(scene)
    assert np.abs(out.positions - scene.bodies.positions).max() < 2e-2  # measured 9e-3


def heap(count, **more):
    """Squares and discs that fall between two walls."""
    numbers, random = np.arange(count), np.random.default_rng(1)
    places = np.column_stack([(numbers % 6 - 2.5) * 1.2, 0.7 + 1.1 * (numbers // 6)])
    places[:, 0] += random.uniform(-0.05, 0.05, count)
    walls = Planes(np.array([[0.0, 1.0], [1.0, 0.0], [-1.0, 0.0]]), np.array([0.0, -4.0, -4.0]))
    shapes = [SQUARE if i % 2 else DISC for i in numbers]
    turns = random.uniform(-0.3, 0.3, count)
    return build(shapes, places, planes=walls, friction=0.5, orientations=turns, duration=4.0, samples=40, **more)


@pytest.mark.parametrize("formulation", BOTH)
@pytest.mark.parametrize("preset", ["matched", "matched_bounce"])
def test_a_heap_stays_in_its_plane_and_comes_to_rest(formulation, preset):
    scene = heap(36)
    out = simulate(scene, preset, formulation=formulation)
    assert out.residue < 1e-6  # measured 1e-10 to 6e-9; of spheres with friction across the plane 2e-2
    energy = Subject(out, scene).energy
    assert (energy - energy[0]).max() < 1e-3 * energy[0]
    assert Subject(out, scene).kinetic[-1] < 3e-3 * energy[0]  # a disc may still roll
    assert (out.positions[-1, :, 1] > 0.49).all()


def test_size_does_not_matter():
    """The same stack a hundred times smaller, in a tenth of the time."""
    scene = jittered(5)
    bodies = dataclasses.replace(scene.bodies, shapes=(Box((0.01, 0.01)),) * 5, positions=0.01 * scene.bodies.positions)
    small = dataclasses.replace(scene, bodies=bodies, duration=0.3)
    one, other = simulate(scene), simulate(small, dt=0.1 * STEP)
    np.testing.assert_allclose(100.0 * other.positions, one.positions, atol=2e-6)


# ------------------------------------------------------------------ traps that the adapter walks around


def test_a_start_that_touches_but_for_round_off_does_not_fall_a_step():
    """A gap of 1e-16 m would be a free fall of g h^2, 1.7e-4 m, in the first step."""
    for angle in (0.1, 0.2, 0.3, 0.4):
        planes, down, normal = tilted(angle)
        scene = build([PLATE], 0.1 * normal, planes=planes, friction=0.6, orientations=np.array([-angle]), duration=0.5)
        assert np.abs(way(simulate(scene), down)).max() < 1e-12


def test_no_contact_is_lost_in_a_slide_at_large_steps():
    """Beyond 0.02 radii a step, the engine's own limit, corners lose contact and the plate rattles."""
    planes, down, normal = tilted(0.5)
    scene = build([PLATE], 0.1 * normal, planes=planes, friction=0.3, orientations=np.array([-0.5]))
    exact = 0.5 * G * (np.sin(0.5) - 0.3 * np.cos(0.5)) * scene.times**2
    dt = 1.0 / 60.0
    np.testing.assert_allclose(way(simulate(scene, dt=dt), down), exact, atol=NEAR)
    assert np.abs(way(simulate(scene, dt=dt, contact_breaking=0.02), down) - exact).max() > 1e-3  # measured 3e-3


def test_runs_prepared_together_do_not_change_each_other():
    """contactBreakingThreshold is one number of the whole process."""
    planes, _, normal = tilted(0.5)
    scene = build([PLATE], 0.1 * normal, planes=planes, friction=0.3, orientations=np.array([-0.5]))
    coarse = {"dt": 1.0 / 60.0, "half_kick": False}
    settings = [engine.make_settings("pybullet", "matched", {**coarse, "contact_breaking": c}) for c in (0.02, 0.1)]
    alone = [adapter.prepare(scene, s)().positions for s in settings]
    together = [adapter.prepare(scene, s) for s in settings]
    assert not np.array_equal(*alone)
    for run, expected in zip(together, alone, strict=True):
        assert np.array_equal(run().positions, expected)


def test_equal_runs_are_equal():
    for preset in adapter.PRESETS:
        one, other = (simulate(heap(12), preset) for _ in range(2))
        assert np.array_equal(one.positions, other.positions)


# ------------------------------------------------------------------ the adapter


def test_continuous_angles_count_whole_turns_by_the_spin():
    times = np.linspace(0.0, 1.0, 11)
    spins = np.column_stack([40.0 * times, np.full(11, -95.0), 0.0 * times])
    exact = np.column_stack([20.0 * times**2, -95.0 * times, 0.0 * times])
    wrapped = np.angle(np.exp(1j * (exact + 0.5)))
    np.testing.assert_allclose(rigid.continuous(wrapped, spins, times), exact, atol=1e-12)


def test_what_cannot_be_run_is_said():
    scene, settings = build([SQUARE], [0.0, 0.5]), adapter.Settings()
    fast = dataclasses.replace(scene, bodies=dataclasses.replace(scene.bodies, spins=np.array([500.0])))
    assert adapter.unsupported(scene, settings) == ""
    assert adapter.unsupported(fast, settings) == ""
    reason = adapter.unsupported(fast, dataclasses.replace(settings, dt=STEP))
    assert "pi/4" in reason
    assert "0.00157 s" in reason
    assert "10" in adapter.unsupported(dataclasses.replace(scene, friction=11.0), settings)
    assert adapter.unsupported(dataclasses.replace(scene, friction=10.0), settings) == ""


@pytest.mark.parametrize("check", [adapter.unsupported, adapter.prepare])
def test_bad_numbers_end_before_the_engine(check, monkeypatch):
    scene = build([SQUARE, DISC], [[0.0, 0.5], [2.0, 0.5]])
    monkeypatch.setitem(sys.modules, "pybullet", None)  # an import would raise ImportError
    for field, bad in (("masses", [1.0, np.nan]), ("masses", [1.0, -1.0]), ("spins", [0.0, np.inf])):
        bodies = dataclasses.replace(scene.bodies, **{field: np.array(bad)})
        with pytest.raises(InvalidInput, match=rf"scene\.bodies\.{field}.*number 1"):
            check(dataclasses.replace(scene, bodies=bodies), adapter.Settings())


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_empty_world_of_a_body_scene_runs(dimension):
    scene = empty(build([Ball(0.5, dimension)], [[0.0] * dimension], planes=None))
    for preset in adapter.PRESETS:
        out = adapter.prepare(scene, engine.make_settings("pybullet", preset, {"dt": 0.01}))()
        assert (out.steps, out.positions.shape, out.diverged) == (100, (11, 0, dimension), "")


def test_a_state_that_is_not_finite_ends_the_trajectory():
    scene = build([SQUARE], [0.0, 0.5], planes=None)
    states = np.zeros((11, 1, 13))
    states[..., 6], states[7:, 0, 1] = 1.0, np.nan
    out = rigid._trajectory(scene, states, np.zeros(11), 240)
    assert (out.diverged, len(out.times), len(out.orientations), out.residue) == ("position", 7, 7, 0.0)


def test_sweep_has_both_recipes():
    tried = adapter.sweep(build([SQUARE], [0.0, 0.5]))
    assert {changes.get("contact", "rest") for changes in tried} == {"rest", "bounce"}


def test_findings_of_contacts_are_traps_here():
    found = {finding.what: finding.verdict for finding in adapter.calibrate()}
    for word in (
        "GEOM_PLANE",
        "ball of restitution 1",
        "box of restitution 1",
        "path",
        "turn within",
        "client",
        "mass",
    ):
        (verdict,) = [said for what, said in found.items() if word in what]
        assert verdict.startswith("trap")
