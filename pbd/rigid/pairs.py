"""Which bodies may touch: candidate pairs, sought anew only when a body may have left the reach allowed for."""

from __future__ import annotations

import math

from pbd.collision.cells import find_pairs
from pbd.jit import device
from pbd.rigid.rows import keep_row, pair_of_row, recall_row, start_row
from pbd.routine import routine
from pbd.state import LACKING

PAIRS, ACTIVE, BUILDS, WAIT = range(4)
"""Places in `Contacts.counts`: candidate pairs, those that touch or may soon, searches, sub-steps to the next look."""


@device
def note_speeds(contacts, bodies):
    """Speeds of all bodies' fastest points; returns the largest, in radii of its body a second [1/s]."""
    d, fastest = len(bodies.x), 0.0
    for i in range(contacts.reach.shape[0]):
        square, turning = 0.0, 0.0
        for k in range(d):
            square += bodies.motion[i, k] * bodies.motion[i, k]
        for k in range(d, 3 * (d - 1)):
            turning += bodies.motion[i, k] * bodies.motion[i, k]
        contacts.speed[i] = math.sqrt(square) + math.sqrt(turning) * bodies.radius[i]
        fastest = max(fastest, contacts.speed[i] / bodies.radius[i])
    return fastest


@device
def is_stale(contacts, bodies, dt):
    """Whether a body may within dt leave the reach with which pairs were sought."""
    found = contacts.counts[BUILDS] == 0
    for i in range(contacts.reach.shape[0]):
        moved = 0.0
        for k in range(len(bodies.x)):
            step = bodies.x[k][i] - contacts.built[k][i]
            moved += step * step
        found |= math.sqrt(moved) + dt * contacts.speed[i] > contacts.reach[i] - bodies.radius[i]
    return found


@routine
def seek_pairs(contacts, state, dt):
    """Seek all pairs anew; contacts that go on keep what they remember."""
    bodies, rows, counts = state.bodies, contacts.rows, contacts.counts
    n, capacity = contacts.reach.shape[0], contacts.pairs.shape[0]
    counts[BUILDS] += 1
    for i in range(n):
        contacts.reach[i] = bodies.radius[i] + contacts.skin + 2.0 * dt * contacts.speed[i]
        for k in range(len(bodies.x)):
            contacts.built[k][i] = bodies.x[k][i]
    keep(contacts)
    found = find_pairs(contacts.cells, bodies.x, contacts.reach, 0.0, contacts.pairs)
    for c in range(min(found, capacity)):
        start_row(rows, c, contacts.pairs[c, 0], contacts.pairs[c, 1], -1)
        recall(contacts, c)
    for k in range(contacts.planes.offset.shape[0]):
        for i in range(n):
            height = -contacts.planes.offset[k]
            for axis in range(len(bodies.x)):
                height += contacts.planes.normal[axis][k] * bodies.x[axis][i]
            if height <= contacts.reach[i]:
                if found < capacity:
                    start_row(rows, found, i, n, k)
                    recall(contacts, found)
                found += 1
    counts[PAIRS] = min(found, capacity)
    if found > capacity:
        state.work[LACKING] = max(state.work[LACKING], found)


@device
def keep(contacts):
    """Put what active contacts remember aside, found by their pair in an open hash table."""
    table, rows, mask = contacts.table, contacts.rows, contacts.table.shape[0] - 1
    for s in range(table.shape[0]):
        table[s] = -1
    for k in range(contacts.counts[ACTIVE]):
        c = contacts.active[k]
        keep_row(rows, c, k)
        s = first_slot(rows, c, mask)
        while table[s] >= 0:
            s = (s + 1) & mask
        table[s] = k


@device
def recall(contacts, c):
    """Give contact c what it remembers, if it was active before."""
    table, mask = contacts.table, contacts.table.shape[0] - 1
    s = first_slot(contacts.rows, c, mask)
    while table[s] >= 0:
        if recall_row(contacts.rows, c, table[s]):
            return
        s = (s + 1) & mask


@device
def first_slot(rows, c, mask):
    """Where in the hash table the search for a pair begins."""
    i, j, plane = pair_of_row(rows, c)
    return ((i * 73856093) ^ ((j + plane + 1) * 19349663)) & mask
