"""The memory of all contacts in space, and what a contact does in a step."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd.jit import device
from pbd.rigid import block_3d as at
from pbd.rigid.block_3d import COLUMNS, POINTS, ROWS, push_bodies, solve_block
from pbd.rigid.detect_3d import detect
from pbd.rigid.pass_3d import contact_speeds, foresee, refresh, relieve, strike, turn_over


class Rows3(NamedTuple):
    """Contacts of a 3D scene, one for each candidate pair.

    pair (m, 4) : bodies i < j, or body i and the ground; points that touch; plane, or -1
    row (m, COLUMNS) : what projections touch, see `pbd.rigid.block_3d`
    feature (m, 7) : of each point the features that touch; the owner of the normal; the axis that separated last
    local (m, 3 + 6 POINTS) : the normal in its owner's frame; arms of the points in both frames
    gap, share, impact (m, POINTS) : [m]; how much of the contact is there; speed of an impact [m/s], 0 for none
    before (m, POINTS) : speeds at the start of the sub-step
    force (m, ROWS) : of the last velocity pass [N]
    drift (m, 3) : what sticking contacts have slipped [m] and twisted [rad]: to be undone
    kept_pair, kept_feature, kept_force, kept_drift : the same while pairs are sought anew
    points, square : scratch of the narrow phase and of the inversion of K
    """

    pair: np.ndarray
    row: np.ndarray
    feature: np.ndarray
    local: np.ndarray
    gap: np.ndarray
    share: np.ndarray
    impact: np.ndarray
    before: np.ndarray
    force: np.ndarray
    drift: np.ndarray
    kept_pair: np.ndarray
    kept_feature: np.ndarray
    kept_force: np.ndarray
    kept_drift: np.ndarray
    points: np.ndarray
    square: np.ndarray

    def pair_of_row(self, c):
        return self.pair[c, 0], self.pair[c, 1], self.pair[c, 3]

    def start_row(self, c, i, j, plane):
        self.pair[c, 0], self.pair[c, 1], self.pair[c, 2], self.pair[c, 3] = i, j, 0, plane
        for k in range(6):
            self.feature[c, k] = -1
        self.row[c, at.PROBES] = 0.0
        for r in range(ROWS):
            self.force[c, r] = 0.0
        for r in range(3):
            self.drift[c, r] = 0.0

    def force_of_row(self, c):
        f, row = self.force, self.row
        n = f[c, 0] + f[c, 1] + f[c, 2] + f[c, 3]
        return (
            n * row[c, 0] + f[c, 4] * row[c, 3] + f[c, 5] * row[c, 6],
            n * row[c, 1] + f[c, 4] * row[c, 4] + f[c, 5] * row[c, 7],
            n * row[c, 2] + f[c, 4] * row[c, 5] + f[c, 5] * row[c, 8],
        )

    def keep_row(self, c, k):
        copy_row(self.kept_pair, k, self.pair, c)
        copy_row(self.kept_feature, k, self.feature, c)
        copy_row(self.kept_force, k, self.force, c)
        copy_row(self.kept_drift, k, self.drift, c)

    def recall_row(self, c, k):
        pair, kept = self.pair, self.kept_pair
        if kept[k, 0] != pair[c, 0] or kept[k, 1] != pair[c, 1] or kept[k, 3] != pair[c, 3]:
            return False
        copy_row(self.feature, c, self.kept_feature, k)
        copy_row(self.force, c, self.kept_force, k)
        copy_row(self.drift, c, self.kept_drift, k)
        return True

    def detect_row(self, c, bodies, planes, margin):
        return detect(self, c, bodies, planes, margin)

    def refresh_row(self, c, bodies):
        refresh(self, c, bodies, self.force, 0)

    def mark_row(self, c, bodies):
        contact_speeds(self, c, bodies)
        for r in range(ROWS):
            self.row[c, at.IMPULSE + r] = 0.0

    def warm_start_row(self, c, bodies, h):
        row = self.row
        for r in range(ROWS):
            impulse = 0.5 * h * self.force[c, r]
            row[c, at.CHANGE + r] = impulse - row[c, at.IMPULSE + r]
            row[c, at.IMPULSE + r] = impulse
        push_bodies(row, c, self.pair[c, 2], bodies.motion, self.pair[c, 0], self.pair[c, 1], at.CHANGE)

    def foresee_row(self, c, bodies, h, limits):
        return foresee(self, c, bodies, h, limits)

    def project_row(self, c, bodies, friction):
        pair = self.pair
        return solve_block(self.row, c, pair[c, 2], bodies.motion, pair[c, 0], pair[c, 1], friction)

    def extrapolate_row(self, c, bodies, share):
        row = self.row
        for r in range(ROWS):
            step = share * row[c, at.DIRECTION + r]
            row[c, at.DIRECTION + r] = step + row[c, at.CHANGE + r]
            row[c, at.IMPULSE + r] += step
            row[c, at.CHANGE + r] = step
        if share != 0.0:
            push_bodies(row, c, self.pair[c, 2], bodies.motion, self.pair[c, 0], self.pair[c, 1], at.CHANGE)

    def relieve_row(self, c, bodies, depth):
        relieve(self, c, bodies, depth)

    def turn_over_row(self, c, bodies, h, friction, restitution):
        turn_over(self, c, bodies, h, friction, restitution)

    def strike_row(self, c, bodies, restitution):
        strike(self, c, bodies, restitution)

    def settle_row(self, c, h, steady):
        if steady:
            for r in range(ROWS):
                self.force[c, r] = 2.0 / h * self.row[c, at.IMPULSE + r]


@device
def copy_row(to, k, source, c):
    for r in range(source.shape[1]):
        to[k, r] = source[c, r]


def new_rows(capacity: int) -> Any:
    """Memory for so many pairs."""
    whole, real = (lambda n: np.zeros((capacity, n), dtype=np.int64)), (lambda n: np.zeros((capacity, n)))
    remembered = whole(4), whole(6), real(ROWS), real(3)
    return Rows3(
        whole(4),
        real(COLUMNS),
        whole(6),
        real(3 + 6 * POINTS),
        real(POINTS),
        real(POINTS),
        real(POINTS),
        real(POINTS),
        real(ROWS),
        real(3),
        *remembered,
        np.zeros((8, 5)),
        np.zeros((ROWS, ROWS)),
    )
