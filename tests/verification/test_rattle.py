"""RATTLE with contacts against closed forms, at 60 Hz: every gate as the worst of eight phases of the grid of steps.

``fast`` is one sub-step a step, ``accurate`` twenty. A scene may start so far into its exact motion that its events
fall elsewhere in a step; what depends on that is hidden from a single run.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

import pbd
from comparisons import run
from comparisons.bodies import rotations
from comparisons.fit import fit_order
from comparisons.metrics import Subject
from comparisons.record import RunSpec

G, DT = 9.81, 1.0 / 60.0
PHASES = 8


def spec(scene, preset, parameters, settings):
    return RunSpec(
        scene=scene, engine="rattle", preset=preset, parameters=parameters, settings={"dt": DT, **dict(settings)}
    )


@functools.cache
def worst(scene, preset="fast", phases=PHASES, settings=(), **parameters):
    """Each metric's largest value over the phases."""
    found: dict[str, float] = {}
    for k in range(phases):
        lead = {"lead": k / phases * DT} if k else {}
        record = run.execute(spec(scene, preset, {**parameters, **lead}, settings))
        assert record.status.code == "ok", record.status
        for name, value in record.metrics.items():
            found[name] = max(found.get(name, 0.0), value.value)
    return found


@functools.cache
def motion(scene, preset="fast", settings=(), **parameters):
    """(trajectory, scene) of one run."""
    bound = run.bind(spec(scene, preset, parameters, settings))
    return bound.run(), bound.scene


def both(*limits):
    """The limits in 2D, and in 3D."""
    return [pytest.param(d, limit, id=f"{d}D") for d, limit in zip((2, 3), limits, strict=True)]


# ------------------------------------------------------------------ falling, rolling, sliding


@pytest.mark.parametrize(("d", "limit"), both(1e-9, 1e-9))
def test_free_fall_and_the_landing_of_a_flat_box(d, limit):
    found = worst("drop", dimension=d)
    assert found["impact_time"] <= limit
    assert found["position_error"] <= limit
    assert found["penetration"] <= limit


@pytest.mark.parametrize(("d", "limit"), both(1e-9, 1e-9))
def test_a_ball_rolls(d, limit):
    found = worst("rolling", dimension=d)
    assert found["position_error"] <= limit
    assert found["attitude_error"] <= limit


@pytest.mark.parametrize(("d", "limit"), both(1e-9, 3e-6))
def test_a_box_slips_down_a_slope(d, limit):
    """Looser in 3D: there a contact that slides is iterated, in the plane it is a closed form."""
    assert worst("incline_slip", dimension=d)["position_error"] <= limit


@pytest.mark.parametrize("d", [2, 3])
def test_a_box_slips_down_a_slope_with_more_sweeps(d):
    assert worst("incline_slip", "accurate", dimension=d)["position_error"] <= 1e-9


@pytest.mark.parametrize(("d", "limit"), both(2e-4, 2e-3))
def test_a_sliding_box_stops(d, limit):
    """Looser in 3D, as above."""
    found = worst("slide", dimension=d)
    assert found["stop_distance"] <= limit
    assert found["position_error"] <= limit
    assert worst("slide", "accurate", dimension=d)["position_error"] <= 1e-6


# ------------------------------------------------------------------ sticking


@pytest.mark.parametrize("preset", ["fast", "accurate"])
@pytest.mark.parametrize("slope", [{"angle": 20.0}, {"ratio": 0.97}], ids=["20 degrees", "0.97 of the limit"])
@pytest.mark.parametrize(("d", "limit"), both(1e-9, 1e-9))
def test_what_sticks_does_not_creep(d, limit, slope, preset):
    """In 10 s."""
    assert worst("incline_stick", preset, phases=1, dimension=d, **slope)["creep"] <= limit


@pytest.mark.parametrize("d", [2, 3])
def test_just_above_the_limit_it_slips(d):
    """At tan = 1.03 mu it goes down with g (sin - mu cos), within a hundredth; a creeping scheme has no such limit."""
    trajectory, scene = motion("incline_slip", dimension=d, ratio=1.03, friction=0.5)
    way = np.linalg.norm(trajectory.positions[-1, 0] - trajectory.positions[0, 0])
    theta = math.atan(1.03 * 0.5)
    assert way == pytest.approx(0.5 * G * (math.sin(theta) - 0.5 * math.cos(theta)) * scene.duration**2, rel=1e-2)


def loads(d, places, normal, preset=(1, 10, 3), steps=60, **changes):
    """(s, d) forces of a plane on unit boxes of 2 kg with mu = 0.5 [N]."""
    bodies = pbd.bodies([pbd.Box((1.0,) * d)] * len(places), np.array(places)[:, :d], masses=2.0, **changes)
    contacts = pbd.contacts(bodies, pbd.planes(normal[:d]), friction=0.5)
    substeps, iterations, velocity_iterations = preset
    settings = pbd.Settings(
        dt=DT,
        substeps=substeps,
        iterations=iterations,
        integrator=pbd.Rattle(),
        solver=pbd.ConjugateSweeps(velocity_iterations),
    )
    made = pbd.Simulation(None, [contacts], bodies=bodies, gravity=-G * np.eye(d)[1], settings=settings)
    return made.run(steps).bodies.loads


UP = np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize(("d", "limit"), both(1e-9, 1e-3))
def test_forces_of_sliding(d, limit):
    """Weight, and mu times it against the motion. Looser in 3D, as above."""
    forces = loads(d, [[0.0, 0.5, 0.0]], UP, steps=30, velocities=[[5.0, 0.0, 0.0][:d]])
    expected = 2.0 * G * np.array([-0.5, 1.0, 0.0])[:d]
    np.testing.assert_allclose(forces[2:], np.broadcast_to(expected, forces[2:].shape), atol=limit)


@pytest.mark.parametrize("d", [2, 3])
def test_forces_of_sticking(d):
    """On a slope the weight, straight up."""
    steep = math.radians(20.0)
    normal = np.array([math.sin(steep), math.cos(steep), 0.0])
    turn = [-steep] if d == 2 else [[math.cos(steep / 2), 0.0, 0.0, -math.sin(steep / 2)]]
    forces = loads(d, [0.5 * normal], normal, orientations=turn)
    np.testing.assert_allclose(forces[5:], np.broadcast_to(2.0 * G * UP[:d], forces[5:].shape), atol=1e-9)


@pytest.mark.parametrize(("preset", "limit"), [((1, 10, 3), 1e-2), ((20, 20, 10), 1e-3)], ids=["fast", "accurate"])
@pytest.mark.parametrize("d", [2, 3])
def test_forces_under_a_jittered_stack(d, preset, limit):
    """The weight of all, whatever the boxes have between them."""
    forces = loads(d, [[0.0, 0.5, 0.0], [0.01, 1.5, 0.0], [-0.02, 2.5, 0.0]], UP, preset)
    np.testing.assert_allclose(forces[5:] / (6.0 * G), np.broadcast_to(UP[:d], forces[5:].shape), atol=limit)


@pytest.mark.parametrize("d", [2, 3])
def test_no_forces_in_flight(d):
    np.testing.assert_array_equal(loads(d, [[0.0, 3.0, 0.0]], UP, steps=20), 0.0)


# ------------------------------------------------------------------ impacts


@pytest.mark.parametrize(("d", "limit"), both(1e-3, 1e-3))
def test_a_flat_box_rebounds(d, limit):
    found = worst("rebound", dimension=d)
    assert found["rebound"] <= limit
    assert found["position_error"] <= limit


@pytest.mark.parametrize("d", [2, 3])
def test_a_ball_bounces_to_rest(d):
    assert worst("bouncing_ball", dimension=d)["apexes"] <= 1e-3
    assert worst("bouncing_ball", "accurate", dimension=d)["stop_time"] <= 1e-2


@pytest.mark.parametrize("d", [2, 3])
def test_an_elastic_ball_keeps_its_energy(d):
    """For 20 s: 22 impacts, whatever their phase."""
    found = worst("elastic_ball", dimension=d)
    assert found["energy_drift"] <= 1e-9
    assert found["position_error"] <= 1e-9


@pytest.mark.parametrize("substeps", [3, 20])
def test_every_bounce_that_is_one_is_exact(substeps):
    """The discrete answer of a ball: parabola after parabola to round-off, until impacts are too slow to bounce.

    Those are slower than g h (1 - e) / 2 e, whose rebounds would all end within a sub-step h; from the first such
    impact on the ball lies still.
    """
    e, fall = 0.8, math.sqrt(2.0 / G)
    threshold = G * DT / substeps * min(1.0, (1.0 - e) / (2.0 * e))
    count = math.ceil(math.log(threshold / (G * fall)) / math.log(e))
    assert G * fall * e ** (count - 1) >= threshold > G * fall * e**count
    end = fall * (1.0 + 2.0 * e * (1.0 - e**count) / (1.0 - e))
    settings = (("substeps", substeps),)
    trajectory, scene = motion("bouncing_ball", settings=settings, restitution=e, samples=300)
    exact, rests = scene.exact(trajectory.times), trajectory.times >= end
    np.testing.assert_allclose(trajectory.positions[~rests], exact.positions[~rests], atol=1e-12)
    np.testing.assert_allclose(trajectory.velocities[~rests], exact.velocities[~rests], atol=1e-10)
    np.testing.assert_allclose(trajectory.positions[rests, 0, 1], 0.5, atol=1e-12)
    np.testing.assert_allclose(trajectory.velocities[rests], 0.0, atol=1e-12)


@pytest.mark.parametrize(("d", "limit"), both(1e-12, 1e-12))
def test_boxes_exchange_their_momentum(d, limit):
    found = worst("box_impact", dimension=d)
    assert found["velocity_error"] <= limit
    assert found["momentum_drift"] <= limit


def thrown(d, friction, restitution):
    """Two boxes that hit each other askew, spinning, in free space; and their solids' inertias along their axes."""
    sizes, masses = np.array([[1.0, 0.6, 0.8], [0.7, 0.9, 0.5]])[:, :d], np.array([2.0, 1.3])
    turns = [0.4, -0.7] if d == 2 else [[0.8, 0.0, 0.6, 0.0], [0.36, 0.48, 0.48, 0.64]]
    bodies = pbd.bodies(
        [pbd.Box(tuple(size)) for size in sizes],
        np.array([[-1.2, 0.1, 0.0], [1.2, -0.2, 0.1]])[:, :d],
        masses=masses,
        orientations=turns,
        velocities=np.array([[3.0, 0.2, 0.3], [-2.0, 0.0, -0.1]])[:, :d],
        spins=[0.5, 1.6] if d == 2 else [[0.5, 1.6, 1.1], [-1.1, -0.8, 1.5]],
    )
    squares = sizes**2
    sums = squares.sum(axis=1, keepdims=True)
    inertias = masses[:, None] / 12.0 * (sums if d == 2 else sums - squares)
    far = pbd.planes(np.eye(d)[1], -1e6)
    contacts = pbd.contacts(bodies, far, friction=friction, restitution=restitution, gravity=0.0)
    settings = pbd.Settings(dt=DT, substeps=8, iterations=10, integrator=pbd.Rattle(), solver=pbd.ConjugateSweeps(3))
    made = pbd.Simulation(None, [contacts], bodies=bodies, gravity=np.zeros(d), settings=settings)
    return made.run(60).bodies, masses, inertias


def momenta(moving, masses, inertias):
    """(s, d) linear and (s, 1 or 3) angular, about the origin, and (s,) the energy."""
    x, v, d = moving.positions, moving.velocities, moving.positions.shape[2]
    linear = np.einsum("snd,n->sd", v, masses)
    orbital = np.cross(x, v) if d == 3 else (x[..., 0] * v[..., 1] - x[..., 1] * v[..., 0])[..., None]
    if d == 2:
        own = moving.spins[..., None] * inertias
        turning = own * moving.spins[..., None]
    else:
        axes = rotations(moving.orientations, 3)
        along = np.einsum("snij,sni->snj", axes, moving.spins)
        own, turning = np.einsum("snij,snj->sni", axes, inertias * along), inertias * along**2
    energy = 0.5 * np.sum(v**2, axis=2) @ masses + 0.5 * np.sum(turning, axis=(1, 2))
    return linear, np.einsum("sni,n->si", orbital, masses) + own.sum(axis=1), energy


COLLISIONS = [(d, mu, e) for d in (2, 3) for mu in (0.0, 0.4) for e in (0.0, 0.6, 1.0)]


@pytest.mark.parametrize(("d", "friction", "restitution"), COLLISIONS)
def test_collisions_keep_momentum(d, friction, restitution):
    """Linear and angular, to round-off: both bodies are pushed at one place. In small steps: what undoes an overlap of
    centimetres, where a corner has been missed, moves bodies without speed, and with them the angular momentum."""
    linear, angular, _ = momenta(*thrown(d, friction, restitution))
    np.testing.assert_allclose(linear, np.broadcast_to(linear[0], linear.shape), atol=1e-12)
    np.testing.assert_allclose(angular, np.broadcast_to(angular[0], angular.shape), atol=1e-12)


@pytest.mark.parametrize(("d", "friction", "restitution"), COLLISIONS)
def test_collisions_take_energy(d, friction, restitution):
    """An elastic one takes none, but for the turn in the part of the step up to it, which the contact foresees."""
    moving, masses, inertias = thrown(d, friction, restitution)
    energy = momenta(moving, masses, inertias)[2]
    assert np.abs(moving.velocities[-1] - moving.velocities[0]).max() > 0.5  # they did hit
    assert np.diff(energy).max() <= 2e-2 * energy[0]
    if restitution < 1.0:
        assert energy[-1] <= 0.9 * energy[0]
    elif friction == 0.0:
        assert energy[-1] == pytest.approx(energy[0], rel=2e-2)


# ------------------------------------------------------------------ turning


def test_a_top_turns():
    """Ten seconds, some of them flipping over; energy and angular momentum to round-off."""
    found = worst("top")
    assert found["attitude_error"] <= 1e-5
    assert found["angular_momentum_drift"] <= 1e-12
    assert found["energy_drift"] <= 1e-12


def test_a_top_turns_to_fourth_order():
    levels = [1, 2, 4, 8]
    errors = [worst("top", phases=1, settings=(("substeps", n),))["attitude_error"] for n in levels]
    assert np.polyfit(-np.log(levels), np.log(errors), 1)[0] >= 3.85


@pytest.mark.parametrize("d", [2, 3])
def test_a_block_rocks(d):
    """Through five impacts from edge to edge."""
    found = worst("rocking", "accurate", dimension=d)
    assert found["position_error"] <= 1e-3
    assert found["attitude_error"] <= 1e-3
    assert found["energy_rise"] <= 1e-5


def rocking_error(d, substeps, lead, duration):
    """Largest error of the angle [rad], over all steps."""
    settings = (("substeps", substeps), ("iterations", 20), ("velocity_iterations", 10))
    samples = round(duration / DT)
    trajectory, scene = motion("rocking", settings=settings, dimension=d, lead=lead, duration=duration, samples=samples)
    angles, exact = trajectory.orientations[:, 0], scene.exact(trajectory.times).orientations[:, 0]
    if d == 3:
        angles, exact = (2.0 * np.arctan2(q[:, 3], q[:, 0]) for q in (angles, exact))
    return float(np.abs(angles - exact).max())


@pytest.mark.parametrize("lead", [0.0, 0.05, 0.1])
@pytest.mark.parametrize("d", [2, 3])
def test_a_block_turns_about_its_edge_to_second_order(d, lead):
    """Before it lands on the other edge, at 0.349 s; later the other corner is near, and in the contact."""
    levels = [5, 10, 20, 40, 80]
    found = fit_order([1.0 / n for n in levels], [rocking_error(d, n, lead, 12 * DT) for n in levels])
    assert found.order is not None
    assert found.order >= 1.85


@pytest.mark.parametrize("d", [2, 3])
def test_a_block_rocks_to_second_order(d):
    """Through two impacts, as the worst of where in a sub-step they are."""
    levels = [20, 40, 80, 160]
    errors = []
    for n in levels:
        leads = (np.arange(PHASES) + 0.37) / PHASES * DT / n
        errors.append(max(rocking_error(d, n, lead, 1.0) for lead in leads))
    assert np.polyfit(-np.log(levels), np.log(errors), 1)[0] >= 1.85


# ------------------------------------------------------------------ many


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("d", [2, 3])
def test_a_jittered_stack_stands(d, seed):
    found = worst("stack", "accurate", phases=1, dimension=d, count=20, seed=seed)
    assert found["drift"] <= 2e-4
    assert found["penetration"] <= 2e-4
    assert found["fallen"] == 0.0


@pytest.mark.parametrize("d", [2, 3])
def test_a_light_box_carries_a_heavy_one(d):
    found = worst("mass_ratio", "accurate", phases=1, dimension=d)
    assert found["penetration"] <= 3e-4
    assert found["drift"] <= 3e-4


@pytest.mark.parametrize(("d", "seed"), [(2, 0), (2, 1), (2, 3), (3, 0), (3, 1), (3, 2)])
def test_a_pile_never_gains_energy(d, seed):
    """Thirty boxes, looked at after every step; nothing but gravity drives them."""
    trajectory, scene = motion("pile", "accurate", dimension=d, count=30, seed=seed, samples=180)
    subject = Subject(trajectory, scene)
    assert np.diff(subject.energy).max() <= 1e-6 * subject.energy_scale
    assert subject.kinetic[-1] <= 1e-6 * subject.energy_scale


@pytest.mark.parametrize("seed", [1, 4])
def test_many_sweeps_do_no_harm_in_space(seed):
    """K^-1 of a contact must be of its own pose and points: one that had aged made sweeps diverge, to 1e95 J."""
    settings = (("substeps", 20), ("iterations", 100), ("velocity_iterations", 100))
    trajectory, scene = motion("pile", settings=settings, dimension=3, count=30, seed=seed, samples=180)
    subject = Subject(trajectory, scene)
    assert np.diff(subject.energy).max() <= 1e-6 * subject.energy_scale
