"""Inequalities, laws with one value per constraint, and what is skipped because a scene does not need it."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import pbd
from pbd.projection import AtLeast, AtMost, Compliant, DampedCompliant, Equality, Hard, Scaled

pytestmark = pytest.mark.slow

G = 9.81
H = 0.01
ALPHA, BETA, K = 2e-4, 30.0, 0.4
LAWS = {
    "hard": lambda relation: pbd.Stiffness(relation=relation),
    "scaled": lambda relation: pbd.Stiffness(K, relation=relation),
    "compliant": lambda relation: pbd.Compliance(ALPHA, relation=relation),
    "damped": lambda relation: pbd.Compliance(ALPHA, BETA, relation=relation),
}
CASES = [(relation, law) for relation in ("at_least", "at_most") for law in LAWS]


def pairs(length, *, velocity=0.0):
    """One vertical pair per case, the upper one pinned, all ``length`` apart, and a batch for each case."""
    count = len(CASES)
    x = np.zeros((2 * count, 2))
    x[:, 0] = np.repeat(np.arange(count), 2)
    x[1::2, 1] = -length
    v = np.zeros_like(x)
    v[1::2, 1] = velocity
    particles = pbd.particles(x, velocities=v, pinned=range(0, 2 * count, 2))
    batches = [
        pbd.distance(particles, [(2 * n, 2 * n + 1)], rest_length=1.0, law=LAWS[law](relation))
        for n, (relation, law) in enumerate(CASES)
    ]
    return particles, batches


def run(length, steps, *, velocity=0.0, gravity=0.0, iterations=1):
    """Lengths (steps + 1, cases) of the pairs, and the outcome."""
    particles, batches = pairs(length, velocity=velocity)
    settings = pbd.Settings(dt=H, iterations=iterations)
    outcome = pbd.Simulation(particles, batches, gravity=(0.0, -gravity), settings=settings).run(steps)
    assert outcome.status == "ok"
    return np.linalg.norm(outcome.positions[:, 1::2] - outcome.positions[:, ::2], axis=2), outcome


def residual_factor(law, iterations):
    """What one step from rest leaves of C on a unit mass, by the law's own formula."""
    a, c = ALPHA / H**2, ALPHA * BETA / H
    return {"hard": 0.0, "scaled": 1.0 - K, "compliant": a / (1.0 + a), "damped": (a + c) / (1.0 + c + a)}[law]


# ------------------------------------------------------------------ struts and ropes


@pytest.mark.parametrize("iterations", [1, 6])
@pytest.mark.parametrize(("length", "acting"), [(0.8, "at_least"), (1.3, "at_most")])
def test_inequalities_act_where_violated_and_nowhere_else(length, acting, iterations):
    """A strut pushes when too short, a rope pulls when too long, as stiffly as their law says."""
    found, _ = run(length, 1, iterations=iterations)
    for n, (relation, law) in enumerate(CASES):
        if relation == acting:
            expected = 1.0 + (length - 1.0) * residual_factor(law, iterations)
            assert found[1, n] == pytest.approx(expected, abs=1e-12), (relation, law)
        else:
            assert found[1, n] == length, (relation, law)


def test_a_rope_falls_freely_until_it_is_taut():
    """Rigid rope: free fall to its length, never beyond it, and then it carries the mass."""
    found, outcome = run(0.5, 300, gravity=G)
    n = np.arange(301)
    free = 0.5 + G * H * H * n * (n + 1) / 2
    slack = free < 1.0
    at = CASES.index(("at_most", "hard"))
    np.testing.assert_allclose(found[slack, at], free[slack], atol=1e-12)
    assert found[:, at].max() <= 1.0 + 1e-12
    np.testing.assert_allclose(found[-50:, at], 1.0, atol=1e-12)
    force = -outcome.scene.batches[CASES.index(("at_most", "compliant"))].law.multiplier[0] / H**2
    assert force == pytest.approx(G, rel=1e-9)


def test_soft_ropes_hang_at_the_sag_of_their_law():
    """Static answers of a rope are those of a spring or of PBD's k: it is taut."""
    found, _ = run(1.0, 4000, gravity=G, iterations=3)
    sag = dict(zip(CASES, found[-1] - 1.0, strict=True))
    assert sag["at_most", "hard"] == pytest.approx(0.0, abs=1e-12)
    assert sag["at_most", "scaled"] == pytest.approx(G * H * H * (1 - K) / K, abs=1e-12)
    assert sag["at_most", "compliant"] == pytest.approx(G * ALPHA, abs=1e-10)
    assert sag["at_most", "damped"] == pytest.approx(G * ALPHA, abs=1e-10)


@pytest.mark.parametrize(("velocity", "sign", "idle"), [(-60.0, -1, "at_least"), (60.0, 1, "at_most")])
def test_multipliers_of_inequalities_keep_their_sign(velocity, sign, idle):
    """However many iterations overshoot: a strut only pushes (lambda >= 0), a rope only pulls (lambda <= 0)."""
    _, outcome = run(1.0, 1, velocity=velocity, iterations=8)
    for (relation, law), batch in zip(CASES, outcome.scene.batches, strict=True):
        if law in ("compliant", "damped"):
            found = batch.law.multiplier[0]
            assert found == 0.0 if relation == idle else sign * found > 0.0, (relation, law)


def test_a_clamped_multiplier_gives_back_what_it_took_too_much():
    """XPBD clamps the TOTAL multiplier: a rope pulled taut early in the sweep is released when others slacken it.

    Masses in a row, the rope 0-1 listed first and the rod 1-2 second; the rod alone must end satisfied.
    """
    particles = pbd.particles([[0.0, 0.0], [1.2, 0.0], [1.7, 0.0]], pinned=[0, 2])
    rope = pbd.distance(particles, [(0, 1)], rest_length=1.0, law=pbd.Compliance(0.0, relation="at_most"))
    rod = pbd.distance(particles, [(1, 2)], rest_length=0.75, law=pbd.Compliance(0.0, relation="equality"))
    settings = pbd.Settings(dt=H, iterations=40)
    outcome = pbd.Simulation(particles, [rope, rod], gravity=(0.0, 0.0), settings=settings).run(1, [1])
    np.testing.assert_allclose(outcome.positions[0, 1], (0.95, 0.0), atol=1e-12)
    assert outcome.scene.batches[0].law.multiplier[0] == pytest.approx(0.0, abs=1e-12)


# ------------------------------------------------------------------ one value per constraint


def row_of_springs(count, law):
    """Independent unit masses on vertical springs of rest length 1, stretched to 1.5."""
    x = np.zeros((2 * count, 2))
    x[:, 0] = np.repeat(np.arange(count), 2)
    x[1::2, 1] = -1.5
    particles = pbd.particles(x, pinned=range(0, 2 * count, 2))
    links = [(2 * n, 2 * n + 1) for n in range(count)]
    return particles, pbd.distance(particles, links, rest_length=1.0, law=law)


def after_one_step(law, count, iterations=1):
    particles, batch = row_of_springs(count, law)
    settings = pbd.Settings(dt=H, iterations=iterations)
    outcome = pbd.Simulation(particles, [batch], gravity=(0.0, 0.0), settings=settings).run(1, [1])
    return -outcome.positions[0, 1::2, 1] - 1.0


@pytest.mark.parametrize("iterations", [1, 4])
@pytest.mark.parametrize("kind", [np.array, list])
def test_each_constraint_has_its_own_k(kind, iterations):
    """k = 0 leaves all, k = 1 nothing, and 1 among the values raises no warning."""
    k = [0.0, 0.25, 1.0, 0.9]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        left = after_one_step(pbd.Stiffness(kind(k)), 4, iterations)
    np.testing.assert_allclose(left, 0.5 * (1.0 - np.array(k)), atol=1e-12)


def test_each_constraint_has_its_own_compliance():
    alpha = np.array([0.0, 1e-5, 1e-4, 1e-2])
    a = alpha / H**2
    np.testing.assert_allclose(after_one_step(pbd.Compliance(alpha), 4, 3), 0.5 * a / (1 + a), atol=1e-12)


def test_each_constraint_has_its_own_damping():
    """beta = 0 and alpha = 0 among damped ones are an undamped spring and a rigid one (eq. 26: alpha beta)."""
    alpha, beta = np.array([1e-4, 1e-4, 0.0]), np.array([0.0, 50.0, 50.0])
    a, c = alpha / H**2, alpha * beta / H
    expected = 0.5 * (a + c) / (1 + a + c)
    np.testing.assert_allclose(after_one_step(pbd.Compliance(alpha, beta), 3, 2), expected, atol=1e-12)


# ------------------------------------------------------------------ what is skipped


@pytest.mark.parametrize(
    ("law", "kind"),
    [
        (pbd.Stiffness(), Hard),
        (pbd.Stiffness(np.ones(3)), Hard),
        (pbd.Stiffness(1.0, raw=True), Hard),
        (pbd.Stiffness(0.5), Scaled),
        (pbd.Stiffness(np.array([1.0, 1.0, 0.5])), Scaled),
        (pbd.Compliance(), Compliant),
        (pbd.Compliance(0.1), Compliant),
        (pbd.Compliance(0.0, 5.0), Compliant),
        (pbd.Compliance(np.array([0.1, 0.0, 0.0]), np.array([0.0, 5.0, 5.0])), Compliant),
        (pbd.Compliance(0.1, 5.0), DampedCompliant),
        (pbd.Compliance(np.array([0.0, 0.0, 0.1]), 5.0), DampedCompliant),
    ],
)
def test_laws_bind_to_the_cheapest_kernel_law(law, kind):
    assert type(law.bind(3, 4)) is kind


@pytest.mark.parametrize(("name", "kind"), [("equality", Equality), ("at_least", AtLeast), ("at_most", AtMost)])
def test_relations_are_types(name, kind):
    assert type(pbd.Stiffness(relation=name).bind(1, 1).relation) is kind
    assert type(pbd.Compliance(0.1, relation=name).bind(1, 1).relation) is kind


def test_no_damping_is_none():
    assert pbd.Damping(0.0).bind() is None


def test_links_of_two_pinned_particles_are_dropped():
    """They cannot act: with nothing left there is no batch, and the counter stands at 0."""
    particles = pbd.particles([[0.0, 0.0], [1.0, 0.0], [2.0, 0.5]], pinned=[0, 1])
    batch = pbd.distance(particles, [(0, 1)], rest_length=0.5)
    assert batch.size() == 0
    outcome = pbd.Simulation(particles, [batch], gravity=(0.0, -G), settings=pbd.Settings(dt=H, iterations=9)).run(10)
    assert outcome.scene.batches == ()
    assert outcome.projections == 0
    np.testing.assert_array_equal(outcome.positions[-1, :2], outcome.positions[0, :2])


@pytest.mark.parametrize("kind", [np.array, list])
def test_dropped_links_take_their_own_values_along(kind):
    """k, alpha and rest lengths stay with their links, whether given as arrays or as lists."""
    particles = pbd.particles([[0.0, 0.0], [1.0, 0.0], [1.0, -1.5]], pinned=[0, 1])
    links = [(0, 1), (1, 2)]
    for law, left in ((pbd.Stiffness(kind([0.1, 0.4])), 0.6), (pbd.Compliance(kind([0.0, H * H])), 0.5)):
        batch = pbd.distance(particles, links, rest_length=kind([5.0, 1.0]), law=law)
        assert (batch.size(), batch.rest.tolist()) == (1, [1.0])
        simulation = pbd.Simulation(particles, [batch], gravity=(0.0, 0.0), settings=pbd.Settings(dt=H))
        assert -simulation.run(1, [1]).positions[0, 2, 1] - 1.0 == pytest.approx(0.5 * left, abs=1e-12)


@pytest.mark.parametrize(
    ("steps", "substeps", "iterations", "links"), [(7, 1, 1, 5), (7, 3, 4, 5), (0, 3, 4, 5), (2, 1, 9, 1)]
)
def test_projections_are_counted_exactly(steps, substeps, iterations, links):
    x = np.column_stack([np.arange(links + 1.0), np.zeros(links + 1)])
    particles = pbd.particles(x, pinned=[0])
    batch = pbd.distance(particles, [(i, i + 1) for i in range(links)])
    settings = pbd.Settings(dt=H, substeps=substeps, iterations=iterations)
    outcome = pbd.Simulation(particles, [batch], gravity=(0.0, -G), settings=settings).run(steps)
    assert outcome.projections == steps * substeps * iterations * links
    assert outcome.steps == steps


def test_the_counter_sums_over_batches():
    _, outcome = run(1.0, 5, iterations=3)
    assert outcome.projections == 5 * 3 * len(CASES)
