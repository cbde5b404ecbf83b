"""Contacts between boxes made of particles: corners over faces and, in 3D, crossing edges, found once per (sub-)step.

A corner over a face is PBD 2006's point over a triangle (section 3.4), in 2D over an edge: the normal is that of the
face's particles as they now are, and they share the push by barycentric weights. Crossing edges share theirs likewise.
Both momenta are kept. Distances and gradients stand in `pbd.constraints.surface`, what a contact does - push, friction,
restitution - in `pbd.constraints.grip`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd.collision.cells import Cells, find_pairs, new_cells
from pbd.constraints.corner_contact import corners_of, margin_of
from pbd.constraints.corner_search import (
    Frames,
    edge_of_face,
    face_toward,
    is_at_face,
    is_inside_edge,
    meeting_axis,
    new_frames,
    particles_below,
    place_in_box,
    read_frames,
)
from pbd.constraints.grip import Grip, new_grip, open_contact, press
from pbd.constraints.surface import gap_between, line_over_line
from pbd.intrinsics import typed
from pbd.routine import routine
from pbd.state import Particles
from pbd.vector import dot, from_store, load, negate, store, subtract

ALONG = 0.7
"""Cosine of the angle between the normal of crossing edges and the axis along which their boxes meet, at least."""

PER_CORNER = 4
"""Contacts for each corner that there is room for."""

PER_BOX = 32
"""Pairs of a box with near others that there is room for."""


class BoxContacts(NamedTuple):
    """Boxes with corners (b, 2^d) against each other.

    filled : slots in use; contacts and pairs for which there was no room, ever
    touching : store of the d + 1 particles of each slot: a corner and the face below it, or two edges
    are_edges (m,) : which of the two
    pair : room for the pairs that are near; radius (b,) [m] of the balls around the boxes, moves (b,) whether they can
    start, goal : the frames at x and at p
    """

    corner: np.ndarray
    radius: np.ndarray
    moves: np.ndarray
    margin: float
    cells: Cells
    pair: np.ndarray
    start: Frames
    goal: Frames
    filled: np.ndarray
    touching: tuple[np.ndarray, ...]
    are_edges: np.ndarray
    grip: Grip

    def begin(self, state, h):
        read_frames(self.start, self.corner, state.particles.x)
        read_frames(self.goal, self.corner, state.particles.p)
        self.filled[0] = 0
        found = find_pairs(self.cells, self.goal.center, self.radius, self.margin, self.pair)
        self.filled[1] += max(found - self.pair.shape[0], 0)
        for n in range(min(found, self.pair.shape[0])):
            a, b = self.pair[n, 0], self.pair[n, 1]
            if self.moves[a] or self.moves[b]:
                axis = meeting_axis(self.start, a, b)
                find_edges(self, state.particles, (a, b), axis, h)
                for _ in range(2):  # a loop, so that it is compiled once
                    find_corners(self, state.particles, (a, b), axis, h)
                    a, b, axis = b, a, negate(axis)

    def project(self, state, h):
        particles = state.particles
        for c in range(self.filled[0]):
            indices = load(self.touching, c)
            gap, normal, weights = gap_between(particles.p, indices, self.are_edges[c])
            press(self.grip, c, particles, indices, weights, gap, normal)
        state.work[0] += self.filled[0]


@routine
def find_corners(contacts, particles, pair, n, h):
    """Open a contact for each corner of the second box that is, or might come, below the first one's face toward n."""
    b, other = pair
    face, is_flat = face_toward(contacts.goal, b, n)
    beside = contacts.margin if is_flat else 0.0
    for k in range(contacts.corner.shape[1]):
        i = contacts.corner[other, k]
        place = place_in_box(contacts.goal.axis, b, subtract(load(particles.p, i), load(contacts.goal.center, b)))
        if is_at_face(contacts.goal, b, face, place, beside, contacts.margin):
            below = particles_below(contacts.corner, contacts.goal, b, face, place)
            add_contact(contacts, particles, (i,) + below, False, h)


@routine
def find_crossings(contacts, particles, pair, n, h):
    """In 3D: open a contact for each two edges that cross, of the faces by which the boxes face each other along n.

    Not where they cross so near a corner that `find_corners` takes it.
    """
    a, b = pair
    own, own_flat = face_toward(contacts.goal, a, n)
    other, other_flat = face_toward(contacts.goal, b, negate(n))
    beside = contacts.margin if own_flat and other_flat else 0.0
    for j in range(4):
        first, second, axis = edge_of_face(contacts.corner, a, own, j)
        for m in range(4):
            third, fourth, other_axis = edge_of_face(contacts.corner, b, other, m)
            distance, normal, weights = line_over_line(particles.p, (first, second, third, fourth))
            along = dot(normal, n)
            if (
                abs(along) < ALONG
                or not is_inside_edge(contacts.goal, a, axis, -weights[1], beside)
                or not is_inside_edge(contacts.goal, b, other_axis, weights[3], beside)
            ):
                continue
            if along < 0.0:
                third, fourth, distance = fourth, third, -distance
            if distance < contacts.margin:
                add_contact(contacts, particles, (first, second, third, fourth), True, h)


def find_edges(contacts: Any, particles: Any, pair: tuple[int, int], n: tuple[float, ...], h: float) -> None:
    """`find_crossings` in 3D; in 2D no edges cross."""
    if len(n) == 3:
        find_crossings(contacts, particles, pair, n, h)


@typed(find_edges)
def _find_edges(contacts: Any, particles: Any, pair: Any, n: Any, h: Any) -> Any:
    if len(n) == 3:
        return lambda contacts, particles, pair, n, h: find_crossings(contacts, particles, pair, n, h)
    return lambda contacts, particles, pair, n, h: None


@routine
def add_contact(contacts, particles, indices, are_edges, h):
    """Fill the next slot, if there is one."""
    c = contacts.filled[0]
    if c == contacts.are_edges.shape[0]:
        contacts.filled[1] += 1
        return
    contacts.filled[0] = c + 1
    store(contacts.touching, c, indices)
    contacts.are_edges[c] = are_edges
    before, _, _ = gap_between(particles.x, indices, are_edges)
    gap, normal, weights = gap_between(particles.p, indices, are_edges)
    open_contact(contacts.grip, c, particles, indices, weights, (before, gap), normal, h)


def box_contacts(
    particles: Particles, corners: Any, *, friction: float = 0.0, restitution: float = 0.0, gravity: float = 9.81
) -> BoxContacts:
    """Contacts of boxes' corners with the faces of the other boxes.

    Parameters
    ----------
    corners : (b, 2^d) particle indices, numbered by bits: bit k of a corner's number is its side along axis k
    friction : Coulomb coefficient mu >= 0, of every pair
    restitution : e in [0, 1], of every pair
    gravity : magnitude [m/s^2], >= 0; only sets which impacts are too slow to bounce

    Raises
    ------
    InvalidInput : a value outside its range
    """
    d = len(particles.x)
    index = corners_of(particles, corners)
    boxes, slots = len(index), index.size * PER_CORNER
    places = from_store(particles.x)[index]
    radius = np.linalg.norm(places - places.mean(axis=1, keepdims=True), axis=2).max(axis=1, initial=0.0)
    return BoxContacts(
        corner=index,
        radius=radius,
        moves=np.any(particles.w[index] > 0.0, axis=1),
        margin=margin_of(particles, index),
        cells=new_cells(radius, d),
        pair=np.zeros((min(boxes * PER_BOX, boxes * (boxes - 1) // 2), 2), dtype=np.int64),
        start=new_frames(boxes, d),
        goal=new_frames(boxes, d),
        filled=np.zeros(2, dtype=np.int64),
        touching=tuple(np.zeros(slots, dtype=np.int64) for _ in range(d + 1)),
        are_edges=np.zeros(slots, dtype=np.bool_),
        grip=new_grip(slots, d, friction, restitution, gravity),
    )
