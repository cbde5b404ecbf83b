"""Contacts of particles with planes: no tunnelling, calm starts, friction, restitution (claims 24 and 25)."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import pbd
from pbd.collision.plane import Planes, ray_cast
from pbd.vector import to_store

G = 9.81
H = 0.001


def drop(x, v, *, normal=None, gravity=None, steps=1000, samples=None, dt=H, iterations=1, **contact):
    """One particle over a plane (default: the floor y >= 0) under gravity along -y."""
    dimension = len(x)
    up = np.eye(dimension)[1]
    particles = pbd.particles([x], velocities=[v])
    planes = pbd.plane_contact(particles, normal=up if normal is None else normal, **contact)
    settings = pbd.Settings(dt=dt, iterations=iterations)
    field = -G * up if gravity is None else gravity
    outcome = pbd.Simulation(particles, [planes], gravity=field, settings=settings).run(steps, samples)
    assert outcome.status == "ok"
    return outcome.positions[:, 0], outcome.velocities[:, 0], outcome


def in_plane(dimension, along, up):
    """A vector of the dimension with these x and y components."""
    return np.array([along, up, 0.0][:dimension])


# ------------------------------------------------------------------ which side


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("speed", [1.0, 1e3, 1e7])
def test_fast_particles_do_not_tunnel(dimension, speed):
    """A particle that crosses any distance in one step ends on the side it came from."""
    x, v, _ = drop(in_plane(dimension, 0.0, 0.5), in_plane(dimension, 0.3 * speed, -speed), steps=2000)
    assert x[:, 1].min() >= -1e-15 * speed
    assert abs(x[-1, 1]) <= 1e-15 * speed  # it stays where it landed
    assert abs(v[-1, 1]) <= 1e-11 * speed


@pytest.mark.parametrize("dimension", [2, 3])
def test_entry_point_is_where_the_ray_meets_the_plane(dimension):
    """x -> p enters at q, C(p) = (p - q).n; without friction the tangential motion goes on."""
    height, down, along = 0.5, 1000.0, 200.0
    x, v, outcome = drop(
        in_plane(dimension, 0.0, height), in_plane(dimension, along, -down), steps=1, gravity=np.zeros(dimension)
    )
    contact = outcome.scene.batches[0]
    entry = [axis[0] for axis in contact.point]
    np.testing.assert_allclose(entry, in_plane(dimension, along * height / down, 0.0), atol=1e-12)
    np.testing.assert_allclose(x[1], in_plane(dimension, along * H, 0.0), atol=1e-12)
    np.testing.assert_allclose(v[1], in_plane(dimension, along, 0.0), atol=1e-9)


@pytest.mark.parametrize(
    ("start", "stop", "hits", "point"),
    [
        ((0.0, 1.0), (2.0, -1.0), True, (1.0, 0.0)),
        ((0.0, 0.0), (2.0, -1.0), True, (0.0, 0.0)),  # on the surface is outside: a resting particle is found
        ((0.0, 1.0), (2.0, 0.0), False, None),  # to the surface is not through it
        ((0.0, -1.0), (2.0, -2.0), False, None),  # from inside there is no entry
        ((0.0, -1.0), (2.0, 1.0), False, None),  # nor on the way out
        ((0.0, 2.0), (2.0, 1.0), False, None),
    ],
)
def test_ray_cast(start, stop, hits, point):
    floor = Planes(to_store(np.array([[0.0, 1.0]])), np.zeros(1))
    found, entry = ray_cast(floor, 0, start, stop)
    assert found is hits
    assert not hits or entry == pytest.approx(point)


@pytest.mark.parametrize("speed", [-3.0, 0.0])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_start_inside_is_calm(speed, restitution):
    """The static fall-back lifts a particle to the surface without turning depth into speed: not 1 m / 1 ms."""
    x, v, _ = drop((0.0, -1.0), (0.0, speed), restitution=restitution, steps=3000)
    assert x[1, 1] == pytest.approx(0.0, abs=1e-12)
    assert np.abs(v).max() <= abs(speed) + 2.0 * G * H
    assert x[1:, 1].min() >= -1e-12
    assert abs(v[-1, 1]) <= 1e-9


def test_the_free_side_is_free():
    """Above the plane nothing is projected, and free fall is what it is without a plane."""
    x, _, outcome = drop((0.0, 1.0), (0.5, 0.0), steps=100)
    n = np.arange(101)
    np.testing.assert_allclose(x[:, 1], 1.0 - G * H * H * n * (n + 1) / 2, atol=1e-12)
    assert outcome.projections == 0


def test_only_candidates_collide():
    particles = pbd.particles([[0.0, 0.001], [1.0, 0.001], [2.0, 0.001]], pinned=[2])
    planes = pbd.plane_contact(particles, normal=(0.0, 1.0), candidates=[1, 2])
    outcome = pbd.Simulation(particles, [planes], gravity=(0.0, -G), settings=pbd.Settings(dt=H)).run(1000, [1000])
    assert outcome.positions[0, 0, 1] < -4.0
    assert outcome.positions[0, 1, 1] == pytest.approx(0.0, abs=1e-12)
    assert outcome.positions[0, 2, 1] == 0.001


# ------------------------------------------------------------------ rest


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("restitution", [0.0, 0.9])
def test_a_resting_particle_stays_at_rest(dimension, restitution):
    """Gravity's own kick is no impact: no bounce, no drift, no sinking."""
    start = in_plane(dimension, 0.3, 0.0)
    x, v, outcome = drop(start, in_plane(dimension, 0.0, 0.0), steps=5000, restitution=restitution, friction=0.5)
    assert np.abs(x - start).max() <= 1e-15
    assert np.abs(v).max() == 0.0
    assert outcome.projections == 5000


@pytest.mark.parametrize("slope", [60.0, 45.0, 30.0])
def test_a_particle_rests_in_the_corner_of_two_planes(slope):
    """Two walls at +-slope to the floor, corner in the origin: it slides down to it and stays."""
    s, c = math.sin(math.radians(slope)), math.cos(math.radians(slope))
    x, v, _ = drop((0.3, 1.0), (0.1, 0.0), normal=[(s, c), (-s, c)], steps=8000, friction=0.3, iterations=20)
    assert np.all(x @ np.array([s, c]) >= -1e-5)
    assert np.all(x @ np.array([-s, c]) >= -1e-5)
    assert np.abs(x[-1]).max() <= 1e-5
    assert np.abs(v[-1]).max() <= 2.0 * G * H


def test_both_walls_of_a_right_corner_stop_a_throw():
    x, v, _ = drop((0.2, 0.3), (-40.0, -90.0), normal=[(0.0, 1.0), (1.0, 0.0)], steps=100)
    assert x.min() >= -1e-16  # a particle on a wall may lie a round-off inside
    np.testing.assert_allclose(x[-1], 0.0, atol=1e-12)
    assert np.abs(v[-1]).max() <= 1e-9


def test_a_throw_into_a_right_corner_comes_back():
    """Restitution acts on each wall by itself: both components are reversed and scaled by e."""
    x, v, _ = drop(
        (0.2, 0.3, 0.0),
        (-40.0, -90.0, 1.0),
        normal=np.eye(3)[[1, 0]],
        gravity=np.zeros(3),
        restitution=0.5,
        steps=50,
    )
    assert x[:, :2].min() >= -1e-12
    np.testing.assert_allclose(v[-1], (20.0, 45.0, 1.0), rtol=1e-9)


# ------------------------------------------------------------------ friction


def incline(degrees, dimension):
    """(normal, gravity, downhill) of a floor tilted by an angle about z: gravity is turned, 1D tests stay readable."""
    s, c = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    return in_plane(dimension, s, c), in_plane(dimension, 0.0, -G), in_plane(dimension, c, -s)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("degrees", [10.0, 30.0, 50.0])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_a_steep_incline_slips_at_the_coulomb_acceleration(dimension, degrees, share):
    """tan(theta) > mu: v = n h g (sin - mu cos), exactly, for the scheme as for the particle (claim 25)."""
    theta = math.radians(degrees)
    mu = share * math.tan(theta)
    normal, gravity, downhill = incline(degrees, dimension)
    x, v, _ = drop(np.zeros(dimension), np.zeros(dimension), normal=normal, gravity=gravity, friction=mu)
    acceleration = G * (math.sin(theta) - mu * math.cos(theta))
    n = np.arange(1001)
    np.testing.assert_allclose(v @ downhill, n * H * acceleration, rtol=1e-8, atol=1e-9)
    # position sees the kick before friction does: n^2/2 of the net acceleration, n of the frictionless kick
    exact = acceleration * H * H * n * (n - 1) / 2 + G * math.sin(theta) * H * H * n
    np.testing.assert_allclose(x @ downhill, exact, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(x @ normal, 0.0, atol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("degrees", [10.0, 30.0, 50.0])
@pytest.mark.parametrize("share", [1.01, 2.0])
def test_a_gentle_incline_holds(dimension, degrees, share):
    """tan(theta) < mu: velocity 0; the position creeps by the h^2 g sin(theta) a step that Contact states."""
    theta = math.radians(degrees)
    normal, gravity, downhill = incline(degrees, dimension)
    friction = share * math.tan(theta)
    x, v, _ = drop(np.zeros(dimension), np.zeros(dimension), normal=normal, gravity=gravity, friction=friction)
    assert np.abs(v).max() <= 1e-12
    np.testing.assert_allclose(x @ downhill, np.arange(1001) * H * H * G * math.sin(theta), rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_sliding_particle_stops_after_its_stopping_distance(dimension):
    """v^2 / (2 mu g) on the level floor, within a step's way."""
    mu, speed = 0.4, 2.0
    x, v, _ = drop(in_plane(dimension, 0.0, 0.0), in_plane(dimension, speed, 0.0), steps=2000, friction=mu)
    assert x[-1, 0] == pytest.approx(speed**2 / (2.0 * mu * G), abs=2.0 * speed * H)
    np.testing.assert_array_equal(v[-1], 0.0)
    assert np.all(np.diff(v[:, 0]) <= 1e-12)  # friction only ever slows


def test_friction_of_an_impact_is_coulombs():
    """An impact at 45 degrees: the tangential change is mu (1 + e) times the normal speed."""
    mu, e, speed = 0.2, 0.5, 4.0
    _, v, _ = drop((0.0, 0.01), (speed, -speed), steps=20, friction=mu, restitution=e, gravity=np.zeros(2))
    np.testing.assert_allclose(v[-1], (speed - mu * (1.0 + e) * speed, e * speed), rtol=1e-9)


# ------------------------------------------------------------------ restitution


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("e", [0.0, 0.3, 0.8, 1.0])
def test_bounce_ratio(dimension, e):
    """The normal velocity after the impact is e times the one before, the last kick of gravity included."""
    _, v, _ = drop(in_plane(dimension, 0.0, 0.5), in_plane(dimension, 1.5, 0.0), steps=400, restitution=e)
    hit = int(np.flatnonzero(v[1:, 1] > v[:-1, 1])[0]) + 1
    assert v[hit, 1] == pytest.approx(e * (G * H - v[hit - 1, 1]), rel=1e-10, abs=1e-12)
    assert v[hit - 1, 1] == pytest.approx(-math.sqrt(2 * G * 0.5), rel=0.01)
    np.testing.assert_allclose(v[:, 0], 1.5, rtol=1e-9)  # no friction


def test_bounces_fade_by_the_square_of_the_ratio():
    """Heights of successive bounces follow e^2, within the step's resolution."""
    x, v, _ = drop((0.0, 1.0), (0.0, 0.0), steps=40_000, dt=1e-4, restitution=0.7)
    impacts = np.flatnonzero((v[1:, 1] > v[:-1, 1]) & (v[:-1, 1] < 0.0)) + 1
    peaks = [x[a:b, 1].max() for a, b in itertools.pairwise(impacts[:4])]
    np.testing.assert_allclose(np.array(peaks[1:]) / peaks[:-1], 0.49, rtol=0.01)
    assert peaks[0] == pytest.approx(0.49, rel=0.01)


@pytest.mark.parametrize("phase", np.linspace(0.0, 1.0, 7, endpoint=False))
def test_elastic_bounces_gain_little_energy(phase):
    """e = 1: position is set to the surface, so an impact may gain up to the height g v h of one step, no more."""
    start = 0.5 + phase * 0.003
    x, v, _ = drop((0.0, start), (0.0, 0.0), steps=3000, restitution=1.0)
    impacts = int(((v[1:, 1] > 0.0) & (v[:-1, 1] < 0.0)).sum())
    speed = math.sqrt(2 * G * start)
    assert impacts >= 3
    assert x[:, 1].max() <= start + (impacts + 1) * 2.0 * speed * H


def test_masses_do_not_matter_for_a_static_plane():
    paths = []
    for mass in (1e-3, 1.0, 1e6):
        particles = pbd.particles([[0.0, 0.2]], velocities=[[1.0, 0.0]], masses=mass)
        planes = pbd.plane_contact(particles, normal=(0.1, 1.0), friction=0.3, restitution=0.5)
        settings = pbd.Settings(dt=H)
        paths.append(pbd.Simulation(particles, [planes], gravity=(0.0, -G), settings=settings).run(1500).positions)
    np.testing.assert_allclose(paths[0], paths[1], atol=1e-9)
    np.testing.assert_allclose(paths[2], paths[1], atol=1e-9)
