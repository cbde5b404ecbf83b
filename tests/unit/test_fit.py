"""Fitted orders: exact on exact data, blind to floors and coarse levels, silent where the data say nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comparisons.fit import MIN_LEVELS, Fit, fit_order

LEVELS = 0.1 / 2.0 ** np.arange(10)


def fit(errors, xs=LEVELS):
    return fit_order(list(xs), list(errors))


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0, 8.0])
@pytest.mark.parametrize("constant", [1e-12, 1.0, 1e9])
def test_an_exact_power_gives_its_order(order, constant):
    found = fit(constant * LEVELS**order)
    assert found.order == pytest.approx(order, abs=1e-9)
    assert found.low - 1e-9 <= order <= found.high + 1e-9
    assert found.floor is None
    assert found.xs == pytest.approx(sorted(LEVELS))


@pytest.mark.parametrize("order", [0.4, 0.7, 1.5, 2.3])
def test_a_steady_slope_that_is_no_whole_order_is_none(order):
    """100 compliant links under XPBD show 0.4 over five levels, on the way to 1."""
    assert fit(LEVELS**order).order is None


def test_levels_on_the_bend_to_a_floor_are_left_out():
    """The last of six halvings gains a third instead of a half: v = (p - x)/h at its round-off."""
    errors = np.array([5.47e-4, 2.78e-4, 1.40e-4, 7.01e-5, 3.63e-5, 2.57e-5])
    found = fit(errors, LEVELS[:6])
    assert found.order == pytest.approx(1.0, abs=0.03)
    assert found.xs == pytest.approx(sorted(LEVELS[:5]))
    assert found.floor == pytest.approx(2.57e-5)


def test_a_dip_at_the_finest_level_is_left_out():
    """As below, with no finer level to show the floor: a slope that steepens away from its order is round-off."""
    errors = 1e-3 * LEVELS
    errors[9] *= 0.6
    found = fit(errors)
    assert found.order == pytest.approx(1.0, abs=0.01)
    assert found.xs == pytest.approx(sorted(LEVELS[:9]))


def test_a_dip_before_a_rising_floor_is_left_out():
    """Round-off first cancels the error, then takes over: one rigid link at time steps below 1e-6 s."""
    errors = np.append(1e-3 * LEVELS[:8], [2.5e-7, 9e-7])
    found = fit(errors)
    assert found.order == pytest.approx(1.0, abs=0.01)
    assert found.xs == pytest.approx(sorted(LEVELS[:8]))


def test_the_levels_may_come_in_any_order():
    shuffled = np.random.default_rng(0).permutation(LEVELS)
    assert fit(3.0 * shuffled**2, shuffled) == fit(3.0 * LEVELS**2)


@pytest.mark.parametrize("order", [1.0, 2.0])
def test_a_floor_is_named_and_left_out(order):
    clean = LEVELS**order
    floor = clean[5]
    found = fit(np.maximum(clean, floor))
    assert found.order == pytest.approx(order, abs=1e-9)
    assert found.floor == pytest.approx(floor)
    assert found.xs == pytest.approx(sorted(LEVELS[:6]))


def test_a_floor_that_rises_is_a_floor():
    """Round-off grows with the number of steps."""
    errors = LEVELS**2
    errors[6:] = errors[5] * np.array([1.2, 1.5, 2.0, 4.0])
    found = fit(errors)
    assert found.order == pytest.approx(2.0, abs=1e-9)
    assert found.floor == pytest.approx(errors[9])


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("exponent", np.linspace(-20.0, 0.0, 41))
def test_a_floor_that_is_added_never_gives_a_wrong_order(order, exponent):
    """The bend between slope and floor may leave no order, but not one in between."""
    found = fit(LEVELS**order + 10.0**exponent)
    assert found.order is None or found.order == pytest.approx(order, abs=max(0.2, 0.1 * order))


def test_coarse_levels_before_the_asymptotic_range_are_left_out():
    errors = LEVELS**2
    errors[:3] = [0.5, 0.49, 0.3]
    found = fit(errors)
    assert found.order == pytest.approx(2.0, abs=1e-9)
    assert found.xs == pytest.approx(sorted(LEVELS[3:]))


def test_higher_terms_fade_out():
    found = fit(LEVELS + 50.0 * LEVELS**2)
    assert found.order == pytest.approx(1.0, abs=0.15)
    assert found.floor is None


@pytest.mark.parametrize("seed", range(20))
def test_the_interval_holds_the_truth_despite_noise(seed):
    noise = np.exp(0.005 * np.random.default_rng(seed).standard_normal(10))
    found = fit(LEVELS**2 * noise)
    assert found.order == pytest.approx(2.0, abs=0.015)
    assert found.low < found.order < found.high
    assert found.high - found.low < 0.03
    assert found.low - 0.005 < 2.0 < found.high + 0.005


def test_the_interval_is_one_of_95_percent():
    rng = np.random.default_rng(0)
    for levels in (MIN_LEVELS, 10):
        few = LEVELS[:levels]
        fits = [fit(few**2 * np.exp(0.002 * rng.standard_normal(levels)), few) for _ in range(400)]
        share = np.mean([f.low <= 2.0 <= f.high for f in fits])
        assert 0.92 <= share <= 0.98


def test_the_interval_shrinks_with_the_noise():
    widths = []
    for size in (0.005, 0.0005):
        found = fit(LEVELS * np.exp(size * np.random.default_rng(1).standard_normal(10)))
        widths.append(found.high - found.low)
    assert widths[1] == pytest.approx(0.1 * widths[0], rel=0.1)


def test_an_order_still_on_its_way_is_none():
    """Local slopes of 1.3, 1.2, 1.1, 1.0 towards the finest level agree with their mean, but go on falling."""
    errors = np.concatenate([[0.0], np.cumsum([1.0, 1.1, 1.2, 1.3])])
    assert fit(2.0**errors, LEVELS[:5][::-1]).order is None


def test_wild_data_have_no_order():
    assert fit([1.0, 1e-3, 0.5, 1e-4, 0.2, 1e-5, 0.1, 1e-3, 1e-2, 1e-6]).order is None


@pytest.mark.parametrize("count", range(MIN_LEVELS))
def test_fewer_than_four_levels_have_no_order(count):
    found = fit(LEVELS[:count] ** 2, LEVELS[:count])
    assert (found.order, found.low, found.high, found.xs) == (None, None, None, [])


def test_four_levels_have_one():
    assert fit(LEVELS[:4] ** 2, LEVELS[:4]).order == pytest.approx(2.0)


def test_a_floor_alone_has_no_order():
    found = fit(np.full(10, 1e-9))
    assert found.order is None
    assert found.floor == pytest.approx(1e-9)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_errors_without_a_logarithm_are_dropped(bad):
    errors = LEVELS**2
    errors[[0, 9]] = bad
    found = fit(errors)
    assert found.order == pytest.approx(2.0)
    assert found.xs == pytest.approx(sorted(LEVELS[1:9]))
    assert fit(np.full(10, bad)) == Fit()


def test_lengths_must_agree():
    with pytest.raises(ValueError, match="zip"):
        fit_order([1.0, 2.0], [1.0])


def test_in_words():
    assert fit(LEVELS**2).text() == "order 2.00 ± 0.00 on 10 levels"
    assert fit(np.full(10, 1e-9)).text() == "no order, fewer than 4 asymptotic levels, floor 1.0e-09"
    assert "floor" in fit(np.maximum(LEVELS**2, 1e-4)).text()


@settings(max_examples=100, deadline=None)
@given(order=st.floats(0.5, 8.0), constant=st.floats(1e-6, 1e6), scale=st.floats(1e-3, 1e3))
def test_units_do_not_matter(order, constant, scale):
    one, other = fit(LEVELS**order), fit(constant * LEVELS**order, scale * LEVELS)
    assert one.order == pytest.approx(other.order, abs=1e-6)
