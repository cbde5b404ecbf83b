"""The rotation nearest to a matrix: R of the polar decomposition A = R S, the R in SO(d) that maximises tr(R^T A).

Matrices are tuples of d rows. In 2D R has a closed form; in 3D it is found by turning a unit quaternion (w, x, y, z),
which starts from where it was last.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pbd.intrinsics import typed
from pbd.jit import device
from pbd.vector import Store, Vector, add, dot, load, scale, store, zero

Matrix = tuple[Vector, ...]
Quaternion = tuple[float, float, float, float]

MAX_TURNS = 50
"""Of one extraction. From the last step's rotation two or three do."""

TURNED = 1e-16
"""Newton's turn whose square [rad^2] is below is the last: they shrink as their cubes, so the next would be none."""

NEAR = 0.5
"""[rad] Newton's turns are taken up to here: farther away the expansion in the turn means nothing."""

DEFINITE = 1e-9
"""Of the largest diagonal element: a Hessian whose pivots are smaller has no inverse to trust."""


@device
def extract(A, start):
    """The quaternion of R, from the quaternion ``start``.

    With B = A R^T and R turned by exp([w]), tr(R^T A) is  tr B + w . b - w^T H w / 2 + ...,  b the axial vector of B,
    H = tr(B) 1 - (B + B^T)/2. Where H is positive definite Newton's turn w = H^-1 b converges cubically. Elsewhere the
    turn is about b, as in Mueller, Bender, Chentanez and Macklin (2016, "A Robust Method to Extract the Rotational Part
    of Deformations"), which gets there from anywhere, for inverted A too; not by their angle |b| / |tr B|, but by the
    one that is best about that axis.
    Limits: exactly half a turn away from the maximum b is 0, and R stays where it is; from far away, and with singular
    values in a ratio of hundreds, MAX_TURNS are not enough, and the next extraction goes on.
    """
    q = start
    for _ in range(MAX_TURNS):
        w, is_newtons = best_turn(A, quaternion_rows(q))
        q = turned(q, w)
        if is_newtons and dot(w, w) < TURNED:
            break
    return q


@device
def best_turn(A, R):
    """(the turn w [rad], a vector, of the rotation with rows R; whether it is Newton's); see `extract`."""
    xx, xy, xz = dot(A[0], R[0]), dot(A[0], R[1]), dot(A[0], R[2])
    yx, yy, yz = dot(A[1], R[0]), dot(A[1], R[1]), dot(A[1], R[2])
    zx, zy, zz = dot(A[2], R[0]), dot(A[2], R[1]), dot(A[2], R[2])
    b = (zy - yz, xz - zx, yx - xy)
    diagonal = (yy + zz, xx + zz, xx + yy)
    beside = (-0.5 * (yz + zy), -0.5 * (xz + zx), -0.5 * (xy + yx))
    newton, w = solve_definite(diagonal, beside, b)
    if newton and dot(w, w) < NEAR * NEAR:
        return w, True
    length = math.sqrt(dot(b, b))
    u = scale(1.0 / length if length > 0.0 else 0.0, b)
    bent = dot((diagonal[0] * u[0], diagonal[1] * u[1], diagonal[2] * u[2]), u)
    bent += 2.0 * dot((beside[0] * u[1] * u[2], beside[1] * u[0] * u[2], beside[2] * u[0] * u[1]), (1.0, 1.0, 1.0))
    return scale(math.atan2(length, bent), u), False


@device
def solve_definite(diagonal, beside, b):
    """(True, H^-1 b) by Cholesky's LDL^T for H = ((a, f, e), (f, b, d), (e, d, c)); (False, b) where not definite."""
    d, e, f = beside
    floor = DEFINITE * max(abs(diagonal[0]), max(abs(diagonal[1]), abs(diagonal[2])))
    first = diagonal[0]
    if not first > floor:
        return False, b
    l1, l2 = f / first, e / first
    second = diagonal[1] - l1 * f
    if not second > floor:
        return False, b
    l3 = (d - l1 * e) / second
    third = diagonal[2] - l2 * e - l3 * l3 * second
    if not third > floor:
        return False, b
    y1 = b[1] - l1 * b[0]
    y2 = b[2] - l2 * b[0] - l3 * y1
    z = y2 / third
    y = y1 / second - l3 * z
    return True, (b[0] / first - l1 * y - l2 * z, y, z)


@device
def turned(q, w):
    """exp([w]) q, of length 1: the quaternion q turned by the vector w [rad]."""
    angle = math.sqrt(dot(w, w))
    share = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    a, (b, c, d) = math.cos(0.5 * angle), scale(share, w)
    product = (
        a * q[0] - b * q[1] - c * q[2] - d * q[3],
        a * q[1] + b * q[0] + c * q[3] - d * q[2],
        a * q[2] - b * q[3] + c * q[0] + d * q[1],
        a * q[3] + b * q[2] - c * q[1] + d * q[0],
    )
    return scale(1.0 / math.sqrt(dot(product, product)), product)


@device
def quaternion_rows(q):
    """The rows of the rotation of a unit quaternion."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@device
def plane_rotation(A):
    """In 2D tr(R^T A) = (A_xx + A_yy) cos t + (A_yx - A_xy) sin t; no turn where A has no direction."""
    cosine, sine = A[0][0] + A[1][1], A[1][0] - A[0][1]
    length = math.sqrt(cosine * cosine + sine * sine)
    cosine, sine = (cosine / length, sine / length) if length > 0.0 else (1.0, 0.0)
    return ((cosine, -sine), (sine, cosine))


@device
def space_rotation(A, turn, c):
    q = extract(A, load(turn, c))
    store(turn, c, q)
    return quaternion_rows(q)


def nearest_quaternions(A: np.ndarray) -> np.ndarray:
    """(..., 4) quaternions of R for any (..., 3, 3) matrices A, w >= 0 (called by Python, not by kernels).

    tr(R^T A) is a quadratic form in the quaternion; its maximum is the form's last eigenvector (Horn 1987).
    """
    form = np.empty((*A.shape[:-2], 4, 4))
    diagonal = np.diagonal(A, axis1=-2, axis2=-1)
    form[..., 0, 0] = diagonal.sum(axis=-1)
    form[..., 1:, 1:] = A + np.swapaxes(A, -2, -1)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        form[..., k + 1, k + 1] = diagonal[..., k] - diagonal[..., i] - diagonal[..., j]
        form[..., 0, k + 1] = form[..., k + 1, 0] = A[..., j, i] - A[..., i, j]
    q = np.linalg.eigh(form)[1][..., -1]
    return np.where(q[..., :1] < 0.0, -q, q)


# ------------------------------------------------------------------ either dimension


def nearest_rotation(A: Matrix, turn: Store, c: int) -> Matrix:
    """R of A; in 3D from quaternion c of the store ``turn``, which is left at R; in 2D ``turn`` is empty."""
    return plane_rotation(A) if len(A) == 2 else space_rotation(A, turn, c)


@typed(nearest_rotation)
def _nearest_rotation(A: Any, turn: Any, c: Any) -> Any:
    if len(A) == 2:
        return lambda A, turn, c: plane_rotation(A)
    return lambda A, turn, c: space_rotation(A, turn, c)


def times(A: Matrix, a: Vector) -> Vector:
    """A a."""
    return tuple(dot(row, a) for row in A)


@typed(times)
def _times(A: Any, a: Any) -> Any:
    if len(A) == 1:
        return lambda A, a: (dot(A[0], a),)
    return lambda A, a: (dot(A[0], a),) + times(A[1:], a)


def add_outer(A: Matrix, s: float, a: Vector, b: Vector) -> Matrix:
    """A + s a b^T."""
    return tuple(add(row, scale(s * component, b)) for row, component in zip(A, a, strict=True))


@typed(add_outer)
def _add_outer(A: Any, s: Any, a: Any, b: Any) -> Any:
    if len(A) == 1:
        return lambda A, s, a, b: (add(A[0], scale(s * a[0], b)),)
    return lambda A, s, a, b: (add(A[0], scale(s * a[0], b)),) + add_outer(A[1:], s, a[1:], b)


def zero_matrix(x: Store, rows: Store) -> Matrix:
    """The zero matrix of a store's dimension; ``rows`` is the store again."""
    return tuple(zero(x) for _ in rows)


@typed(zero_matrix)
def _zero_matrix(x: Any, rows: Any) -> Any:
    if len(rows) == 1:
        return lambda x, rows: (zero(x),)
    return lambda x, rows: (zero(x),) + zero_matrix(x, rows[1:])
