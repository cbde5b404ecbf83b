"""Sums over candidates near_first, ..., near_last-1, a register at a time; positions and most results are tuples."""

from __future__ import annotations

from typing import Any

from pbd.fluid.kernels import shape
from pbd.fluid.lanes import fused, lanes, no_lanes, totals, width
from pbd.fluid.solids import dragged, lightened_lanes
from pbd.fluid.terms import attract
from pbd.intrinsics import typed
from pbd.jit import device
from pbd.vector import negate


@device
def density_sums(kernel, solids, near, first, last, point):
    """sum w, sum r_j g^2 |x_i - x_j|^2, and the components of sum g (x_i - x_j); see `pbd.fluid.kernels.shape`.

    r_j, beside the candidates' positions where there are solids, is 1 in a fluid.
    """
    value, norm, slope = no_lanes(near[0]), no_lanes(near[0]), nothing(point, near)
    for k in range(first, last, width(near[0])):
        apart = difference(point, near, k)
        squared = square(apart)
        w, g = shape(kernel, squared)
        value = value + w
        norm = fused(lightened_lanes(solids, near, len(point), k, g * g), squared, norm)
        slope = weighted(g, apart, slope)
    return totals((value, norm) + slope)


@device
def push_sums(kernel, repulsion, near, first, last, point):
    """sum (L_j + s_ij) g (x_i - x_j), the L_j beside the candidates' positions."""
    push = nothing(point, near)
    for k in range(first, last, width(near[0])):
        apart = difference(point, near, k)
        w, g = shape(kernel, square(apart))
        push = weighted(g * attract(repulsion, lanes(near[len(point)], k), w), apart, push)
    return totals(push)


@device
def smoothed_differences(kernel, solids, near, first, last, place, point, own):
    """sum w min(1, m_j/m_i) (v_j - v_i) of the sorted particle at ``place``, the v_j beside candidates' positions."""
    drag = nothing(point, near)
    for k in range(first, last, width(near[0])):
        w, _ = shape(kernel, square(difference(point, near, k)))
        w = dragged(solids, place, near, 2 * len(point), k, w)
        drag = weighted(w, difference(own, near[len(point) :], k), drag)
    return negate(totals(drag))


@device
def curl_sums(kernel, near, first, last, point, own):
    """sum g (x_i - x_j) x (v_i - v_j); in 2D a tuple of its one component."""
    curl = nothing(cross(point, own), near)
    for k in range(first, last, width(near[0])):
        apart = difference(point, near, k)
        _, g = shape(kernel, square(apart))
        curl = weighted(g, cross(apart, difference(own, near[len(point) :], k)), curl)
    return totals(curl)


@device
def slope_sums(kernel, near, first, last, point, own):
    """sum g (x_i - x_j) (a_i - a_j), the a_j beside the candidates' positions."""
    slope = nothing(point, near)
    for k in range(first, last, width(near[0])):
        apart = difference(point, near, k)
        _, g = shape(kernel, square(apart))
        slope = weighted(g * (own - lanes(near[len(point)], k)), apart, slope)
    return totals(slope)


# ------------------------------------------------------------------ tuples of lanes, as many as there are dimensions


def nothing(point: tuple, near: tuple) -> tuple:
    """Zeros for each component of ``point``."""
    return tuple(no_lanes(near[0]) for _ in point)


@typed(nothing)
def _nothing(point: Any, near: Any) -> Any:
    if len(point) == 1:
        return lambda point, near: (no_lanes(near[0]),)
    return lambda point, near: (no_lanes(near[0]),) + nothing(point[1:], near)


def difference(point: tuple, near: tuple, k: int) -> tuple:
    """point - lanes k, ... of each array."""
    return tuple(p - lanes(array, k) for p, array in zip(point, near))


@typed(difference)
def _difference(point: Any, near: Any, k: Any) -> Any:
    if len(point) == 1:
        return lambda point, near, k: (point[0] - lanes(near[0], k),)
    return lambda point, near, k: (point[0] - lanes(near[0], k),) + difference(point[1:], near[1:], k)


def square(a: tuple) -> Any:
    """a . a."""
    sum_ = a[0] * a[0]
    for part in a[1:]:
        sum_ = fused(part, part, sum_)
    return sum_


@typed(square)
def _square(a: Any) -> Any:
    if len(a) == 2:
        return lambda a: fused(a[1], a[1], a[0] * a[0])
    return lambda a: fused(a[2], a[2], fused(a[1], a[1], a[0] * a[0]))


def weighted(s: Any, a: tuple, sums: tuple) -> tuple:
    """sums + s a."""
    return tuple(fused(s, part, sum_) for part, sum_ in zip(a, sums))


@typed(weighted)
def _weighted(s: Any, a: Any, sums: Any) -> Any:
    if len(a) == 1:
        return lambda s, a, sums: (fused(s, a[0], sums[0]),)
    return lambda s, a, sums: (fused(s, a[0], sums[0]),) + weighted(s, a[1:], sums[1:])


def cross(a: tuple, b: tuple) -> tuple:
    """a x b; in 2D its one component."""
    if len(a) == 2:
        return (a[0] * b[1] - a[1] * b[0],)
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@typed(cross)
def _cross(a: Any, b: Any) -> Any:
    if len(a) == 2:
        return lambda a, b: (a[0] * b[1] - a[1] * b[0],)
    return lambda a, b: (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
