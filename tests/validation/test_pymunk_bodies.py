"""Rigid bodies in Chipmunk, calibrated on closed forms: which coefficients a pair has, where things rest and stop."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest

from comparisons import engine, isolation, run
from comparisons.bodies import Ball, Box, Planes, at_rest
from comparisons.metrics import Subject
from comparisons.record import RunSpec
from comparisons.scene import Scene, no_masses
from pbd.errors import InvalidInput

pymunk = pytest.importorskip("pymunk")
adapter = engine.load("pymunk")

G = 9.81
ROUND_OFF = 1e-12
FLOOR = Planes(np.array([[0.0, 1.0]]), np.zeros(1))
SLAB = Box((40.0, 2.0))
"""Held fixed with its upper face at y = 0, it is a floor that is a body."""


def simulate(scene, preset="matched", **changes):
    return adapter.prepare(scene, engine.make_settings("pymunk", preset, changes))()


def world(shapes, positions, planes=FLOOR, *, gravity=(0.0, -G), duration=1.0, samples=20, mu=0.0, e=0.0, **changes):
    masses = changes.pop("masses", np.ones(len(shapes)))
    bodies = at_rest(tuple(shapes), masses, np.array(positions, dtype=float), **changes)
    return Scene("", "", no_masses(2), (), np.array(gravity), duration, samples, (), bodies, planes, mu, e)


def on(ground, shapes, positions, **changes):
    """The world on the plane y = 0, or on a fixed body there."""
    if ground == "plane":
        return world(shapes, positions, **changes)
    n = len(shapes) + 1
    for name in ("velocities", "spins"):
        if name in changes:
            changes[name] = np.concatenate([changes[name], np.zeros_like(changes[name][:1])])
    return world([*shapes, SLAB], [*positions, [0.0, -1.0]], None, fixed=(n - 1,), **changes)


def tilted(degrees):
    """A plane that falls towards +x through the origin: it, its normal, and the way down."""
    a = np.radians(degrees)
    normal, down = np.array([np.sin(a), np.cos(a)]), np.array([np.cos(a), -np.sin(a)])
    return Planes(normal[None], np.zeros(1)), normal, down


# ------------------------------------------------------------------ free motion


def test_a_free_body_moves_first_and_kicks_after_and_turns_steadily():
    dt, spin = 0.01, 3.0
    scene = world([Box((1.0, 0.5))], [[1.0, 2.0]], None, spins=np.array([spin]), velocities=np.array([[3.0, 4.0]]))
    out = simulate(scene, "default", dt=dt)
    n = np.round(scene.times / dt)
    fallen = 2.0 + 4.0 * scene.times - 0.5 * G * dt**2 * n * (n - 1.0)
    np.testing.assert_allclose(out.positions[:, 0, 1], fallen, atol=ROUND_OFF)
    np.testing.assert_allclose(out.positions[:, 0, 0], 1.0 + 3.0 * scene.times, atol=ROUND_OFF)
    np.testing.assert_allclose(out.velocities[:, 0], np.column_stack([0 * n + 3.0, 4.0 - G * n * dt]), atol=ROUND_OFF)
    np.testing.assert_allclose(out.orientations[:, 0], spin * scene.times, atol=ROUND_OFF)
    np.testing.assert_allclose(out.spins, spin, atol=ROUND_OFF)
    assert out.contact_forces is None
    assert out.steps == 100


def test_half_kick_makes_free_flight_exact():
    scene = world([Ball(0.5)], [[1.0, 2.0]], None, spins=np.array([3.0]), velocities=np.array([[3.0, 4.0]]))
    out, t = simulate(scene, dt=0.01), scene.times
    np.testing.assert_allclose(out.positions[:, 0, 1], 2.0 + 4.0 * t - 0.5 * G * t**2, atol=ROUND_OFF)
    np.testing.assert_allclose(out.velocities[:, 0, 1], 4.0 - G * t, atol=ROUND_OFF)
    np.testing.assert_allclose(out.orientations[:, 0], 3.0 * t, atol=ROUND_OFF)


def test_default_preset_is_the_engine_s_own():
    settings, space = adapter.Settings(), pymunk.Space()
    assert (settings.collision_slop, settings.collision_bias) == (space.collision_slop, space.collision_bias)
    assert settings.skin == pymunk.Poly.create_box(None, (1.0, 1.0)).radius
    assert (space.damping, space.sleep_time_threshold) == (1.0, np.inf)


# ------------------------------------------------------------------ friction


@pytest.mark.parametrize("ground", ["plane", "body"])
@pytest.mark.parametrize("mu", [0.1, 0.3])
def test_a_box_slides_as_far_as_the_scene_s_friction_says(ground, mu):
    """v0^2 / (2 mu g), whatever it slides on; without half kick farther by v0 dt / 2."""
    speed, dt = 2.0, 1.0 / 240.0
    way = speed**2 / (2.0 * mu * G)
    moving = np.array([[speed, 0.0]])
    scene = on(ground, [Box((0.2, 0.1))], [[0.0, 0.05]], mu=mu, velocities=moving, duration=2.5, samples=10)
    assert simulate(scene, dt=dt).positions[-1, 0, 0] == pytest.approx(way, rel=1e-4)  # measured 2e-7 and 4e-7
    late = simulate(scene, dt=dt, half_kick=False).positions[-1, 0, 0] - way
    assert late == pytest.approx(speed * dt / 2.0, rel=0.05)


@pytest.mark.parametrize("ground", ["plane", "body"])
def test_a_disc_slides_until_it_rolls(ground):
    """It loses v0 / 3 at mu g; then v = w r, as its inertia is m r^2 / 2: a sphere's would leave 5/7 of v0."""
    speed, mu, radius = 3.0, 0.2, 0.25
    turning = speed / (3.0 * mu * G)
    scene = on(ground, [Ball(radius)], [[0.0, radius]], mu=mu, velocities=np.array([[speed, 0.0]]), samples=30)
    out, t = simulate(scene, dt=1.0 / 960.0), scene.times
    slows = np.maximum(speed - mu * G * t, 2.0 * speed / 3.0)
    np.testing.assert_allclose(out.velocities[:, 0, 0], slows, atol=1e-3)
    rolls = t > turning + 0.01
    np.testing.assert_allclose(out.spins[rolls, 0], -out.velocities[rolls, 0, 0] / radius, atol=1e-3)


def test_a_box_slips_and_a_disc_rolls_down_as_they_should():
    """At g (sin - mu cos) and at g sin / (1 + 1/2): exact with half kick, as the acceleration is constant."""
    ground, normal, down = tilted(26.0)
    a, t = np.radians(26.0), 1.0
    for shape, mu, fall in ((Box((0.2, 0.2)), 0.3, np.sin(a) - 0.3 * np.cos(a)), (Ball(0.1), 0.5, np.sin(a) / 1.5)):
        turned = np.array([-a if isinstance(shape, Box) else 0.0])
        scene = world([shape], [0.1 * normal], ground, mu=mu, orientations=turned)
        out = simulate(scene, dt=1.0 / 60.0)
        assert (out.positions[-1, 0] - 0.1 * normal) @ down == pytest.approx(0.5 * G * fall * t**2, rel=1e-9)
    assert out.orientations[-1, 0] == pytest.approx(-0.5 * G * fall * t**2 / 0.1, rel=1e-9)


def test_a_box_sticks_on_a_slope_just_below_the_limit():
    """26 degrees at mu = 0.5, whose limit is 26.57: 10 s without creep, one degree more and it is gone."""
    ground, normal, _ = tilted(26.0)
    scene = world([Box((0.2, 0.2))], [0.1 * normal], ground, mu=0.5, orientations=-np.radians([26.0]), duration=10.0)
    out = simulate(scene, dt=1.0 / 60.0)
    assert np.abs(out.positions - scene.bodies.positions).max() < 1e-9  # measured 1.3e-10
    ground, normal, _ = tilted(27.0)
    scene = world([Box((0.2, 0.2))], [0.1 * normal], ground, mu=0.5, orientations=-np.radians([27.0]), duration=10.0)
    assert np.abs(simulate(scene, dt=1.0 / 60.0).positions[-1] - 0.1 * normal).max() > 1.0


# ------------------------------------------------------------------ restitution


@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
@pytest.mark.parametrize(
    "pair", [(Box((1.0, 1.0)), Box((1.0, 1.0))), (Ball(0.5), Ball(0.5)), (Ball(0.5), Box((1.0, 1.0)))]
)
def test_two_bodies_collide_by_newton_s_rule(pair, e):
    """v1' = v (m1 - e m2) / (m1 + m2), v2' = v m1 (1 + e) / (m1 + m2), at any step, with friction or without."""
    masses, v = np.array([2.0, 3.0]), 1.5
    scene = world(
        pair,
        [[0.0, 0.0], [2.0, 0.0]],
        None,
        gravity=(0.0, 0.0),
        masses=masses,
        velocities=np.array([[v, 0.0], [0.0, 0.0]]),
        duration=2.0,
        mu=0.5,
        e=e,
    )
    out = simulate(scene, dt=0.01)
    expected = [v * (masses[0] - e * masses[1]) / masses.sum(), v * masses[0] * (1.0 + e) / masses.sum()]
    np.testing.assert_allclose(out.velocities[-1, :, 0], expected, atol=ROUND_OFF)
    np.testing.assert_allclose(out.velocities[-1, :, 1], 0.0, atol=ROUND_OFF)
    np.testing.assert_allclose(out.spins[-1], 0.0, atol=ROUND_OFF)


@pytest.mark.parametrize("ground", ["plane", "body"])
@pytest.mark.parametrize("shape", [Box((0.4, 0.4)), Ball(0.2)])
def test_a_bounce_on_the_ground_reverses_the_speed(ground, shape):
    scene = on(ground, [shape], [[0.0, 1.0]], velocities=np.array([[0.7, -2.0]]), gravity=(0.0, 0.0), e=0.4, mu=0.0)
    np.testing.assert_allclose(simulate(scene, dt=0.01).velocities[-1, 0], [0.7, 0.8], atol=ROUND_OFF)


def test_an_elastic_ball_keeps_its_energy_at_every_sample_where_overlaps_are_left():
    """Samples fall on impacts too, where the mean of the speeds before and after would be almost none."""
    scene = world([Ball(0.1)], [[0.0, 1.1]], e=1.0, duration=4.0, samples=240)
    energy = Subject(simulate(scene, dt=1.0 / 60.0, collision_bias=1.0), scene).energy
    np.testing.assert_allclose(energy, energy[0], rtol=1e-12)
    lifted = Subject(simulate(scene, dt=1.0 / 60.0), scene).energy
    assert 1e-3 < lifted.max() / energy[0] - 1.0 < 0.1  # the engine's push lifts what bounces; measured 3e-2


# ------------------------------------------------------------------ rest


def stack(count, size=1.0, seed=0, **changes):
    shifts = 0.01 * size * np.random.default_rng(seed).uniform(-1.0, 1.0, count)
    positions = np.column_stack([shifts, size * (np.arange(count) + 0.5)])
    return world([Box((size, size))] * count, positions, mu=0.5, duration=3.0, **changes)


@pytest.mark.parametrize("degrees", [0.0, 17.0])
def test_a_box_rests_at_the_surface(degrees):
    ground, normal, _ = tilted(degrees)
    scene = world([Box((1.0, 1.0))], [0.5 * normal], ground, mu=0.5, orientations=-np.radians([degrees]), duration=5.0)
    out = simulate(scene, dt=1.0 / 60.0)
    assert np.abs(out.positions - scene.bodies.positions).max() < 1e-10
    assert np.abs(out.velocities).max() < 1e-10
    np.testing.assert_allclose(out.contact_forces[1:], G, rtol=1e-9)
    assert out.contact_forces[0] == 0.0
    bare = simulate(scene, dt=1.0 / 60.0, skin=0.0)
    assert np.abs(bare.positions - scene.bodies.positions).max() > 1e-4  # measured 1.2e-3 and more


def test_by_default_a_dropped_box_rests_in_the_ground():
    scene = world([Box((1.0, 1.0))], [[0.0, 0.6]], mu=0.5, duration=10.0)
    depth = {preset: 0.5 - simulate(scene, preset, dt=1.0 / 60.0).positions[-1, 0, 1] for preset in adapter.PRESETS}
    assert 0.01 < depth["default"] < 0.05  # measured 2.3e-2
    assert abs(depth["matched"]) < ROUND_OFF


def test_a_stack_stands_and_presses_with_its_weight():
    scene = stack(10)
    for dt, limit in ((1.0 / 240.0, 1e-3), (1.0 / 960.0, 1e-4)):  # measured 4.5e-4 and 2.6e-5
        out = simulate(scene, dt=dt)
        assert np.abs(out.positions - scene.bodies.positions).max() < limit
        assert out.contact_forces[-1] == pytest.approx(10.0 * G, rel=1e-3)
    loose = simulate(scene, dt=1.0 / 240.0, collision_slop=1e-5, skin=0.0)
    assert np.abs(loose.positions - scene.bodies.positions).max() > 3e-3  # measured 8e-3


def test_forces_of_planes_are_told_from_those_of_fixed_bodies():
    """A box of 2 kg on the plane, a disc of 3 kg in a corner of two planes, one of 5 kg on a fixed body."""
    planes = Planes(np.array([[0.0, 1.0], [1.0, 0.0]]), np.array([0.0, -5.0]))
    shapes = [Box((1.0, 1.0)), Ball(0.5), Ball(0.5), Box((2.0, 2.0))]
    positions = [[0.0, 0.5], [-4.5, 0.5], [4.0, 2.5], [4.0, 1.0]]
    scene = world(shapes, positions, planes, mu=0.3, masses=np.array([2.0, 3.0, 5.0, 1.0]), fixed=(3,))
    out = simulate(scene, dt=1.0 / 240.0)
    np.testing.assert_allclose(out.contact_forces[1:], 5.0 * G, rtol=1e-9)
    np.testing.assert_allclose(out.positions, np.broadcast_to(positions, out.positions.shape), atol=1e-6)


def test_planes_reach_as_far_as_bodies_fly():
    """Half a kilometre below and a kilometre to the side, on a slope, and still at the surface."""
    ground, normal, down = tilted(20.0)
    ground = dataclasses.replace(ground, offsets=np.array([-500.0]))
    start = -499.0 * normal
    scene = world([Box((1.0, 1.0))], [start], ground, velocities=100.0 * down[None], orientations=-np.radians([20.0]),
                  duration=10.0)  # fmt: skip
    out = simulate(scene, dt=1.0 / 60.0)
    assert out.positions[-1, 0] @ normal == pytest.approx(-499.5, abs=1e-3)
    assert (out.positions[-1, 0] - start) @ down > 1000.0


# ------------------------------------------------------------------ the adapter


def test_bodies_keep_the_scene_s_order_around_a_fixed_one():
    shapes = [Ball(0.5), Box((1.0, 1.0)), Ball(0.25)]
    scene = world(
        shapes,
        [[0.0, 5.0], [3.0, 5.0], [6.0, 5.0]],
        None,
        velocities=np.array([[1.0, 0.0], [9.0, 9.0], [2.0, 0.0]]),
        spins=np.array([1.0, 9.0, 2.0]),
        orientations=np.array([0.1, 0.2, 0.3]),
        fixed=(1,),
        samples=10,
    )
    out = simulate(scene, dt=0.01)
    np.testing.assert_allclose(out.velocities[:, :, 0], np.broadcast_to([1.0, 0.0, 2.0], (11, 3)), atol=ROUND_OFF)
    np.testing.assert_allclose(out.spins, np.broadcast_to([1.0, 0.0, 2.0], (11, 3)), atol=ROUND_OFF)
    np.testing.assert_allclose(out.orientations[-1], [1.1, 0.2, 2.3], atol=ROUND_OFF)
    assert np.all(out.positions[:, 1] == [3.0, 5.0])


def test_fixed_bodies_alone_and_no_bodies_run():
    held = simulate(world([Box((1.0, 1.0))], [[0.0, 5.0]], fixed=(0,)), dt=0.01)
    assert np.all(held.positions == [0.0, 5.0])
    assert simulate(world([], np.zeros((0, 2))), dt=0.01).positions.shape == (21, 0, 2)


def test_child_process_gives_the_same_run():
    spec = RunSpec(scene="stack", engine="pymunk", parameters={"count": 3}, preset="matched", settings={"dt": 0.01})
    apart, here = isolation.run_apart(spec), simulate(run.build_scene("stack", {"count": 3}), dt=0.01)
    assert np.array_equal(apart.positions, here.positions)
    assert np.array_equal(apart.velocities, here.velocities)
    assert np.array_equal(apart.orientations, here.orientations)
    assert np.array_equal(apart.contact_forces, here.contact_forces)


def test_only_space_is_unsupported():
    flat, solid = run.build_scene("stack", {}), run.build_scene("stack", {"dimension": 3})
    assert adapter.unsupported(flat, adapter.Settings()) == ""
    assert adapter.unsupported(solid, adapter.Settings()) == "pymunk is planar"
    tried = [engine.make_settings("pymunk", "matched", changes) for changes in adapter.sweep(flat)]
    assert len(set(tried)) == len(tried) > 2


@pytest.mark.parametrize("check", [adapter.unsupported, adapter.prepare])
@pytest.mark.parametrize("mass", [np.nan, -1.0, 0.0, np.inf])
def test_bad_masses_end_before_the_engine(check, mass, monkeypatch):
    """Chipmunk would end the process."""
    monkeypatch.setitem(sys.modules, "pymunk", None)  # an import would raise ImportError
    with pytest.raises(InvalidInput, match=r"scene\.bodies\.masses"):
        check(world([Ball(0.5)], [[0.0, 1.0]], masses=np.array([mass])), adapter.Settings())


@pytest.mark.parametrize("changes", [{"collision_slop": -1.0}, {"collision_bias": 2.0}, {"skin": float("nan")}])
def test_settings_out_of_range_are_refused(changes):
    with pytest.raises(InvalidInput, match=r"pymunk\."):
        engine.make_settings("pymunk", "default", changes)
