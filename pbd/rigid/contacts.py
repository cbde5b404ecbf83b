"""Contacts of rigid bodies with each other and with planes: found once per step, projected in every sub-step.

Candidate pairs are sought only when a body may have left the margin with which they were sought before (a Verlet
list), so that a heap at rest pays nothing for it. What a contact remembers - its forces, and what sticking
friction has slipped - stays with its pair, and in it with the features that touch.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pbd.collision.cells import Cells
from pbd.collision.plane import Planes
from pbd.jit import device
from pbd.rigid import rows_2d, rows_3d
from pbd.rigid.pairs import ACTIVE, PAIRS, WAIT, is_stale, note_speeds, seek_pairs
from pbd.rigid.rows import (
    detect_row,
    extrapolate_row,
    force_of_row,
    foresee_row,
    mark_row,
    pair_of_row,
    project_row,
    refresh_row,
    relieve_row,
    settle_row,
    strike_row,
    turn_over_row,
    warm_start_row,
)
from pbd.routine import routine
from pbd.state import CHANGE, EARLIEST, IMPACTS, LEAST, PAIRS_TESTED, SIZE
from pbd.vector import Store

FARTHEST = 0.02
"""Contacts are found anew within a step before any body has moved by more than this share of its radius."""

SKIN = 0.1
"""How far bodies may move before pairs are sought anew, over the median bounding radius."""

DEEP = 0.1
"""An overlap is deep, and undone without speed, beyond this share of the median bounding radius. Less is undone by the
passes themselves: taken back whole, their impulses would be missing to what is heavily loaded."""

SPECULATIVE = 1e-3
"""A contact is kept while its gap is less than this share of a body's radius, beside what may close in the step."""


class Contacts(NamedTuple):
    """All contacts of a group of bodies; see `contacts` for what the numbers mean.

    active (capacity,) : the rows that touch or may within the step
    counts (4,) : PAIRS, ACTIVE, BUILDS, WAIT
    built, reach : where bodies were when pairs were sought, and the radius of each that was allowed for
    speed (n + 1,) : of each body's fastest point at the start of the step; 0 for the ground
    table : an open hash table of the pairs that remember
    """

    rows: Any
    planes: Planes
    friction: float
    restitution: float
    gravity: float
    most_push: float
    skin: float
    cells: Cells
    pairs: np.ndarray
    active: np.ndarray
    counts: np.ndarray
    built: Store
    reach: np.ndarray
    speed: np.ndarray
    table: np.ndarray

    def grown(self, capacity: int) -> Contacts:
        """The same with room for so many pairs (called by Python, not by kernels)."""
        new_rows = rows_2d.new_rows if len(self.built) == 2 else rows_3d.new_rows
        return self._replace(
            rows=new_rows(capacity),
            pairs=np.zeros((capacity, 2), dtype=np.int64),
            active=np.zeros(capacity, dtype=np.int64),
            table=np.zeros(1 << (2 * capacity - 1).bit_length(), dtype=np.int64),
        )

    def made_for(self) -> tuple[int, int]:
        """Number and dimension of the bodies (called by Python)."""
        return len(self.reach), len(self.built)

    def detect(self, state, h, left):
        self.counts[WAIT] -= 1
        if self.counts[WAIT] <= 0:
            detect_all(self, state, h, left)

    def record_load(self, recording, k):
        for a in range(self.counts[ACTIVE]):
            c = self.active[a]
            if pair_of_row(self.rows, c)[2] >= 0:
                push = force_of_row(self.rows, c)
                for axis in range(len(recording.load)):
                    recording.load[axis][k, 0] -= push[axis]

    def mark(self, state):
        mark_all(self, state)

    def warm_start(self, state, h):
        warm_start_all(self, state, h)

    def foresee(self, state, h, whole):
        foresee_all(self, state, h, whole)

    def project(self, state, h):
        project_all(self, state, h)

    def extrapolate(self, state, share):
        extrapolate_all(self, state, share)

    def relieve(self, state):
        relieve_all(self, state)

    def turn_over(self, state, h, strikes):
        turn_over_all(self, state, h, strikes)

    def strike(self, state):
        strike_all(self, state)

    def settle(self, state, h, steady):
        settle_all(self, state, h, steady)


@routine
def detect_all(contacts, state, h, left):
    bodies, rows = state.bodies, contacts.rows
    fastest = note_speeds(contacts, bodies)
    wait = left
    if fastest * h * left > FARTHEST:
        wait = max(1, int(FARTHEST / (fastest * h)))
    contacts.counts[WAIT] = wait
    dt = h * wait
    if is_stale(contacts, bodies, dt):
        seek_pairs(contacts, state, dt)
    fall, active = contacts.gravity * dt * dt, 0
    for c in range(contacts.counts[PAIRS]):
        i, j, _ = pair_of_row(rows, c)
        margin = dt * (contacts.speed[i] + contacts.speed[j]) + fall + SPECULATIVE * bodies.radius[i]
        if detect_row(rows, c, bodies, contacts.planes, margin):
            contacts.active[active] = c
            refresh_row(rows, c, bodies)
            active += 1
    contacts.counts[ACTIVE] = active
    state.work[PAIRS_TESTED] += contacts.counts[PAIRS]


@routine
def mark_all(contacts, state):
    for k in range(contacts.counts[ACTIVE]):
        mark_row(contacts.rows, contacts.active[k], state.bodies)


@routine
def warm_start_all(contacts, state, h):
    for k in range(contacts.counts[ACTIVE]):
        warm_start_row(contacts.rows, contacts.active[k], state.bodies, h)


@routine
def foresee_all(contacts, state, h, whole):
    limits = (contacts.most_push, slowest_impact(contacts.restitution, contacts.gravity * whole), 1.0 / whole)
    for k in range(contacts.counts[ACTIVE]):
        when, gap = foresee_row(contacts.rows, contacts.active[k], state.bodies, h, limits)
        state.signals[LEAST] = min(state.signals[LEAST], gap)
        if when < math.inf:
            state.signals[IMPACTS] += 1.0
            state.signals[EARLIEST] = min(state.signals[EARLIEST], when)


@routine
def project_all(contacts, state, h):
    change, size = 0.0, 0.0
    for k in range(contacts.counts[ACTIVE]):
        changed, sized = project_row(contacts.rows, contacts.active[k], state.bodies, contacts.friction)
        change += changed
        size += sized
    state.signals[CHANGE] += change
    state.signals[SIZE] += size
    state.work[0] += contacts.counts[ACTIVE]


@routine
def extrapolate_all(contacts, state, share):
    for k in range(contacts.counts[ACTIVE]):
        extrapolate_row(contacts.rows, contacts.active[k], state.bodies, share)


@routine
def relieve_all(contacts, state):
    depth = DEEP / SKIN * contacts.skin
    if state.signals[LEAST] < -depth:
        for k in range(contacts.counts[ACTIVE]):
            relieve_row(contacts.rows, contacts.active[k], state.bodies, depth)


@routine
def turn_over_all(contacts, state, h, strikes):
    restitution = -1.0 if strikes else contacts.restitution
    for k in range(contacts.counts[ACTIVE]):
        turn_over_row(contacts.rows, contacts.active[k], state.bodies, h, contacts.friction, restitution)


@routine
def strike_all(contacts, state):
    for k in range(contacts.counts[ACTIVE]):
        strike_row(contacts.rows, contacts.active[k], state.bodies, contacts.restitution)


@routine
def settle_all(contacts, state, h, steady):
    for k in range(contacts.counts[ACTIVE]):
        settle_row(contacts.rows, contacts.active[k], h, steady)


@device
def slowest_impact(restitution, kick):
    """Impacts slower than this [m/s] do not bounce: those whose whole sequence of bounces ends within the sub-step.

    A bounce at speed e u lasts 2 e u/g, all that follow it 1/(1 - e) of that; ``kick`` is g h. Without restitution it
    is the speed that gravity alone gives in a sub-step.
    """
    e = restitution
    return kick * min(1.0, (1.0 - e) / (2.0 * e)) if e > 0.0 else kick
