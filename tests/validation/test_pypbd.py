"""What pyPBD does, calibrated on closed forms of its discrete equations, on the continuous motion and on our solver."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from comparisons import engine, isolation, reference, run
from comparisons import scene as vocabulary
from comparisons.metrics import Subject
from comparisons.record import RunSpec
from comparisons.scene import PointMasses, Rods, Springs
from pbd.errors import InvalidInput

pytestmark = pytest.mark.slow

adapter = engine.load("pypbd")
if adapter.missing():
    pytest.skip(f"pyPBD is absent: {adapter.missing()}", allow_module_level=True)

G = 9.81
ROUND_OFF = 1e-10
"""What v = (x - x_old) / h magnifies."""


def simulate(scene, preset="matched", **changes):
    settings = engine.make_settings("pypbd", preset, changes)
    assert adapter.unsupported(scene, settings) == ""
    return adapter.prepare(scene, settings)()


def ours(scene, **settings):
    return engine.load("pbd").prepare(scene, engine.make_settings("pbd", "default", settings))()


@functools.cache
def chain(links, **parameters):
    return run.build_scene("pendulum_chain", {"links": links, **parameters})


def error(scene, **changes):
    out, exact = simulate(scene, **changes), reference.solve(scene)
    return float(np.sqrt(np.mean(np.sum((out.positions - exact.positions) ** 2, axis=2), axis=1)).max())


def order(scene, steps, **changes):
    errors = [error(scene, dt=dt, **changes) for dt in steps]
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def cloth(n, kind, duration=0.6, samples=6):
    """An n x n sheet with stretch and diagonal links, pinned at two corners, listed row by row."""
    i, j = np.divmod(np.arange(n * n), n)
    x = np.column_stack([j, np.zeros(n * n), i]) * 0.1
    index = np.arange(n * n).reshape(n, n)
    pairs = np.vstack(
        [
            np.column_stack([a.ravel(), b.ravel()])
            for a, b in (
                (index[:, :-1], index[:, 1:]), (index[:-1], index[1:]),
                (index[:-1, :-1], index[1:, 1:]), (index[1:, :-1], index[:-1, 1:]),
            )
        ]
    )  # fmt: skip
    lengths = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
    link = Rods(pairs, lengths) if kind is Rods else Springs(pairs, lengths, np.full(len(pairs), 1e-4))
    masses = PointMasses(x, np.zeros_like(x), np.linspace(0.5, 1.5, n * n), (0, n - 1))
    return dataclasses.replace(
        chain(1), masses=masses, links=(link,), gravity=np.array([0.0, -G, 0.0]), duration=duration, samples=samples
    )


def reordered(scene, order):
    (link,) = scene.links
    arrays = {f.name: getattr(link, f.name)[order] for f in dataclasses.fields(link)}
    return dataclasses.replace(scene, links=(type(link)(**arrays),))


# ------------------------------------------------------------------ the discrete answers


@pytest.mark.parametrize(("preset", "substeps"), [("default", 5), ("matched", 1)])
def test_free_fall_kicks_first_and_moves_after_in_sub_steps(preset, substeps):
    scene = run.build_scene("free_fall", {"speed": 5.0})
    out = simulate(scene, preset, dt=0.01)
    h, t = 0.01 / substeps, scene.times
    v = scene.masses.velocities[0]
    np.testing.assert_allclose(out.positions[:, 0, 1], 10.0 + v[1] * t - 0.5 * G * t * (t + h), atol=ROUND_OFF)
    np.testing.assert_allclose(out.positions[:, 0, 0], v[0] * t, atol=ROUND_OFF)
    np.testing.assert_allclose(out.velocities[:, 0, 1], v[1] - G * t, atol=1e-9)


def test_second_order_velocities_fall_at_twice_g():
    from comparisons.engines._pypbd_findings import second_order_fall

    scene = run.build_scene("free_fall", {"height": 100.0})
    out = simulate(scene, dt=0.01, velocity_update="second_order")
    expected = [0.0] + [second_order_fall(G, 0.01, n) for n in range(1, 101)]
    np.testing.assert_allclose(100.0 - out.positions[:, 0, 1], expected, atol=1e-9)
    assert expected[-1] / (0.5 * G) == pytest.approx(2.0, rel=0.01)


def test_its_own_findings_are_what_the_closed_forms_say():
    with isolation.Workers() as workers:
        fall, volume, raw, passes, clock = workers["pypbd"].findings("pypbd")
    assert fall.found == pytest.approx(9.713862, abs=1e-6)
    assert volume.found == pytest.approx(5.0 / 6.0, abs=1e-6)
    assert raw.found == pytest.approx(0.5**4, abs=1e-12)
    assert passes.found == 0.0
    assert clock.found != clock.expected
    assert all(word in finding.verdict for word, finding in (("bug", fall), ("bug", volume), ("trap", clock)))


@pytest.mark.parametrize("iterations", [1, 7])
def test_xpbd_spring_at_rest_stretches_by_m_g_alpha(iterations):
    """A hung mass settles at m g alpha for each number of iterations, here with g of another planet."""
    scene = chain(1, compliance=1e-3, angles=0.0, gravity=3.0, duration=10.0, samples=10)
    out = simulate(scene, dt=0.01, iterations=iterations)
    assert -out.positions[-1, 1, 1] - 1.0 == pytest.approx(3.0 * 1e-3, rel=1e-9)


def test_default_preset_is_the_engine_s_own():
    import pypbd

    stepper, ours = pypbd.TimeStepController(), adapter.Settings()
    stepper.init()
    values = [stepper.getValueUInt(getattr(stepper, name)) for name in ("NUM_SUB_STEPS", "MAX_ITERATIONS")]
    assert values == [ours.substeps, ours.iterations]
    assert stepper.getValueUInt(stepper.MAX_ITERATIONS_V) == ours.velocity_iterations
    assert stepper.getValueInt(stepper.VELOCITY_UPDATE_METHOD) == adapter.VELOCITY_UPDATES[ours.velocity_update]


# ------------------------------------------------------------------ the same numbers as our solver


def greedy(pairs):
    """Each constraint joins the first group that does not touch its particles."""
    groups, touched = [], []
    for c, pair in enumerate(pairs.tolist()):
        k = next((k for k, used in enumerate(touched) if used.isdisjoint(pair)), len(groups))
        if k == len(groups):
            groups.append([])
            touched.append(set())
        groups[k].append(c)
        touched[k].update(pair)
    return groups


def test_constraints_are_grouped_greedily_in_the_order_they_were_added():
    scene = cloth(6, Rods)
    world = adapter.World(scene, adapter.Settings())
    assert adapter.projection_groups(world) == greedy(scene.links[0].pairs)


@pytest.mark.parametrize(("kind", "method"), [(Rods, "pbd"), (Rods, "xpbd"), (Springs, "xpbd")])
def test_a_cloth_is_that_of_our_solver_in_the_same_order(kind, method):
    """60 steps of 20 iterations on 8 x 8 particles."""
    scene = cloth(8, kind)
    world = adapter.World(scene, engine.make_settings("pypbd", "matched", {"method": method}))
    order = [c for group in adapter.projection_groups(world) for c in group]
    theirs = simulate(scene, dt=0.01, iterations=20, method=method)
    mine = ours(reordered(scene, order), dt=0.01, iterations=20, method=method)
    assert np.abs(theirs.positions - mine.positions).max() < 1e-12
    natural = ours(scene, dt=0.01, iterations=20, method=method)
    assert np.abs(theirs.positions - natural.positions).max() > 1e-6, "the order matters"


def test_another_gravity_is_another_clock():
    """Turned and scaled gravity, moving start, springs: the motion of our solver, which takes gravity as it is."""
    scene = dataclasses.replace(chain(2, compliance=1e-3), gravity=np.array([3.0, 1.0]))
    spin = 2.0 * scene.masses.positions[:, ::-1] * np.array([-1.0, 1.0])
    scene = dataclasses.replace(scene, masses=dataclasses.replace(scene.masses, velocities=spin))
    theirs, mine = simulate(scene, dt=1e-3), ours(scene, method="xpbd", dt=1e-3)
    assert np.abs(theirs.positions - mine.positions).max() < 1e-10
    assert np.abs(theirs.velocities - mine.velocities).max() < 1e-8


def test_velocities_are_the_same_however_they_are_read():
    """From two positions where a step has one sub-step, else particle by particle."""
    fast = simulate(chain(5), dt=1e-3)
    world = adapter.World(chain(5), engine.make_settings("pypbd", "matched", {"dt": 1e-3}))
    step = world.start()
    for _ in range(10):
        step(world.model)
    slow = np.array([world.particles.getVelocity(i) for i in range(6)])[:, :2]
    np.testing.assert_allclose(fast.velocities[1], slow, atol=1e-12)


# ------------------------------------------------------------------ the continuous motion and conservation


@pytest.mark.parametrize("links", [1, 2])
def test_rods_and_springs_converge_with_order_one(links):
    for compliance in (0.0, 1e-2 / links**2):
        assert 0.9 < order(chain(links, compliance=compliance), (2e-3, 1e-3, 5e-4)) < 1.1


def test_sub_steps_are_steps():
    in_sub_steps, in_steps = (error(chain(2), dt=dt, substeps=n) for dt, n in ((1e-3, 10), (1e-4, 1)))
    assert in_sub_steps == pytest.approx(in_steps, rel=1e-6)


def test_a_pendulum_only_loses_energy():
    energy = Subject(simulate(chain(1, duration=10.0), dt=1e-3), chain(1, duration=10.0)).energy / G
    assert np.all(np.diff(energy) < 1e-12)
    assert -0.2 < energy[-1] - energy[0] < -0.15  # measured -0.175


def test_momentum_of_a_free_pair_is_kept_without_gravity_and_with():
    for gravity in (0.0, 9.81):
        scene = run.build_scene("free_pair", {"gravity": gravity})
        momentum = scene.masses.masses @ simulate(scene, dt=1e-3).velocities
        fallen = 4.0 * np.outer(scene.times, scene.gravity)
        np.testing.assert_allclose(momentum - fallen, momentum[:1] + 0.0 * momentum, atol=1e-9)


# ------------------------------------------------------------------ the adapter


@pytest.mark.parametrize("preset", ["default", "matched"])
def test_empty_world_does_the_same_steps(preset):
    out = simulate(vocabulary.empty(chain(2)), preset, dt=1e-3)
    assert (out.steps, out.positions.shape, out.diverged) == (1000, (101, 0, 2), "")


def test_worlds_do_not_disturb_each_other():
    """The time step belongs to the process: the last one built must not set that of the first."""
    settings = [engine.make_settings("pypbd", "matched", {"dt": dt}) for dt in (1e-3, 5e-3)]
    first, second = (adapter.prepare(chain(1), each) for each in settings)
    second()
    assert np.array_equal(first().positions, simulate(chain(1), dt=1e-3).positions)


def test_it_is_quiet_and_leaves_no_file(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    simulate(chain(3), "default", dt=1e-3)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_child_process_gives_the_same_run():
    spec = RunSpec(scene="pendulum_chain", engine="pypbd", parameters={"links": 2})
    apart, here = isolation.run_apart(spec), simulate(chain(2), "default")
    assert np.array_equal(apart.positions, here.positions)
    assert np.array_equal(apart.velocities, here.velocities)


def test_a_thousand_links_run():
    assert not simulate(chain(1000, duration=0.1), "default", dt=1e-3).diverged


def test_springs_need_xpbd():
    settings = engine.make_settings("pypbd", "default", {"method": "pbd"})
    assert "compliance" in adapter.unsupported(chain(1, compliance=1e-3), settings)


@pytest.mark.parametrize("changes", [{"iterations": 0}, {"substeps": 0}, {"velocity_update": "third_order"}])
def test_settings_out_of_range_are_refused(changes):
    with pytest.raises(InvalidInput, match=r"pypbd\."):
        engine.make_settings("pypbd", "default", changes)
