"""The memory of all contacts in the plane, and what a contact does in a step."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd.rigid.detect_2d import detect_pair
from pbd.rigid.pass_2d import foresee, project_contact, push, refresh, relieve, speeds, strike, turn_over


def record(whole: str, real: str) -> np.dtype:
    """The type of a record of whole numbers, then of reals, by their names."""
    return np.dtype([(n, np.int64) for n in whole.split()] + [(n, np.float64) for n in real.split()], align=True)


HOT = record(
    "i j points",
    "nx ny ai aj bi bj ti tj wa wb wt a b t low_a low_b spent_n spent_t iaa iab ibb iat ibt itt"
    " da db dt ca cb ct aa ab bb at bt tt",
)
"""What projections touch: bodies; the normal; moments r x n and r x t of the rows a, b, t, for both bodies; their
biases [m/s] and impulses [N s]; the least normal impulses, and what a position pass has spent; K^-1; the last
sweep's change, and the conjugate direction; K."""

COLD = record(
    "plane owner feature_a feature_b",
    "local_nx local_ny iax iay ibx iby jax jay jbx jby gap_a gap_b share slip rest_a rest_b force_a force_b"
    " force_t impact_a impact_b",
)
"""The plane, or -1; in whose frame the normal is fixed (0: i, 1: j), and the normal there; arms of both points in both
frames; gaps [m]; how much of the contact is at b; what a sticking contact has slipped [m]: to be undone; speeds at the
start of the sub-step; forces of the last velocity pass [N]; speeds of impacts [m/s], 0 for none."""

KEPT = record("i j plane feature_a feature_b", "force_a force_b force_t slip")
"""What a contact remembers while pairs are sought anew."""


class Rows2(NamedTuple):
    """Contacts of a 2D scene, one for each candidate pair: ``hot`` is what projections touch, ``cold`` the rest."""

    hot: np.ndarray
    cold: np.ndarray
    kept: np.ndarray
    points: np.ndarray

    def start_row(self, c, i, j, plane):
        """Contact c of bodies i < j, or of body i with a plane, j being the ground; it remembers nothing."""
        hot, cold = self.hot[c], self.cold[c]
        hot["i"], hot["j"], hot["points"], cold["plane"] = i, j, 0, plane
        cold["feature_a"] = cold["feature_b"] = -1
        cold["force_a"] = cold["force_b"] = cold["force_t"] = cold["slip"] = 0.0

    def pair_of_row(self, c):
        return self.hot[c]["i"], self.hot[c]["j"], self.cold[c]["plane"]

    def force_of_row(self, c):
        hot, cold = self.hot[c], self.cold[c]
        n, t = cold["force_a"] + cold["force_b"], cold["force_t"]
        return n * hot["nx"] - t * hot["ny"], n * hot["ny"] + t * hot["nx"]

    def keep_row(self, c, k):
        kept, cold = self.kept[k], self.cold[c]
        kept["i"], kept["j"], kept["plane"] = self.hot[c]["i"], self.hot[c]["j"], cold["plane"]
        kept["feature_a"], kept["feature_b"] = cold["feature_a"], cold["feature_b"]
        kept["force_a"], kept["force_b"], kept["force_t"] = cold["force_a"], cold["force_b"], cold["force_t"]
        kept["slip"] = cold["slip"]

    def recall_row(self, c, k):
        kept, cold = self.kept[k], self.cold[c]
        if kept["i"] != self.hot[c]["i"] or kept["j"] != self.hot[c]["j"] or kept["plane"] != cold["plane"]:
            return False
        cold["feature_a"], cold["feature_b"] = kept["feature_a"], kept["feature_b"]
        cold["force_a"], cold["force_b"], cold["force_t"] = kept["force_a"], kept["force_b"], kept["force_t"]
        cold["slip"] = kept["slip"]
        return True

    def detect_row(self, c, bodies, planes, margin):
        return detect_pair(self.hot[c], self.cold[c], self.points, bodies, planes, margin)

    def mark_row(self, c, bodies):
        cold = self.cold[c]
        hot = self.hot[c]
        cold["rest_a"], cold["rest_b"], _ = speeds(hot, bodies.motion)
        hot["a"] = hot["b"] = hot["t"] = 0.0

    def warm_start_row(self, c, bodies, h):
        hot, cold = self.hot[c], self.cold[c]
        a, b, t = 0.5 * h * cold["force_a"], 0.5 * h * cold["force_b"], 0.5 * h * cold["force_t"]
        push(hot, bodies.motion, a - hot["a"], b - hot["b"], t - hot["t"])
        hot["a"], hot["b"], hot["t"] = a, b, t

    def foresee_row(self, c, bodies, h, limits):
        return foresee(self.hot[c], self.cold[c], bodies, h, limits)

    def refresh_row(self, c, bodies):
        cold = self.cold[c]
        refresh(self.hot[c], cold, bodies, cold["force_a"], cold["force_b"])

    def project_row(self, c, bodies, mu):
        return project_contact(self.hot[c], bodies.motion, mu)

    def extrapolate_row(self, c, bodies, share):
        hot = self.hot[c]
        a, b, t = share * hot["ca"], share * hot["cb"], share * hot["ct"]
        hot["ca"], hot["cb"], hot["ct"] = a + hot["da"], b + hot["db"], t + hot["dt"]
        if share != 0.0:
            hot["a"] += a
            hot["b"] += b
            hot["t"] += t
            push(hot, bodies.motion, a, b, t)

    def relieve_row(self, c, bodies, depth):
        relieve(self.hot[c], self.cold[c], bodies.motion, depth)

    def turn_over_row(self, c, bodies, h, mu, restitution):
        turn_over(self.hot[c], self.cold[c], bodies, h, mu, restitution)

    def strike_row(self, c, bodies, restitution):
        strike(self.hot[c], self.cold[c], bodies, restitution)

    def settle_row(self, c, h, steady):
        hot, cold = self.hot[c], self.cold[c]
        if steady:
            scale = 2.0 / h
            cold["force_a"], cold["force_b"], cold["force_t"] = scale * hot["a"], scale * hot["b"], scale * hot["t"]


def new_rows(capacity: int) -> Any:
    """Memory for so many pairs."""
    return Rows2(np.zeros(capacity, HOT), np.zeros(capacity, COLD), np.zeros(capacity, KEPT), np.zeros((2, 4)))
