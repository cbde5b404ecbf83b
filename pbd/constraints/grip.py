"""What a contact between particles does: it pushes, holds, slides and bounces, all in the projection.

A contact is a row: particles j with weights b_j (of sum 0, or 1 for a contact with what stands still), the gap C and a
normal n with grad_j C = b_j n. With W = sum w_j b_j^2 and u = sum b_j (p_j - x_j), the motion of one side against the
other in this (sub-)step, each projection updates a normal and a tangential multiplier [kg m]:

    l   <- max(l + (C* - C) / W, 0)
    l_t <- l_t - u_t / W, shortened to mu l                 Coulomb
    p_j <- p_j + w_j b_j (dl n + dl_t)

Point masses resist alike in all directions, so one W serves both. Friction as a displacement is that of "Unified
Particle Physics" (Macklin et al. 2014, section 6.1), here with the multiplier of the whole step in the place of one
projection's, or the friction would depend on the number of iterations. C* is 0; where the contact closes with velocity
v_n faster than RESTING_SPEED g h it is the gap that a rebound reaches, C(x) - e v_n h.

Deviation from PBD 2006, which changes velocities after the solve (`pbd.constraints.contact`): there a corner's share of
a body bounces and brakes alone - a sixth of a box's mass if it stands flat -, and the next projection of the body takes
most of it back. A box that should stick on a slope then creeps with 5 g h sin(slope), however many the iterations, and
one that falls flat with e = 1/2 rebounds with 0.003 to 0.67 of its speed, by the phase of the step in which it lands.
Limit: what n iterations have not settled is left. With a sixth of its mass in the lower corners a box rebounds with
e - (1 + e) (5/6)^n, and lies deeper than it should by what `tests/verification/test_particle_boxes.py` says.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pbd.arrays import number
from pbd.constraints.contact import RESTING_SPEED
from pbd.jit import device
from pbd.vector import Store, accumulate, add, dot, load, scale, store, subtract, zero, zeros


class Grip(NamedTuple):
    """Coefficients of all contacts of a batch; of each the multipliers ``push`` and ``drag``, and C*, its ``lift``."""

    friction: float
    restitution: float
    gravity: float
    push: np.ndarray
    drag: Store
    lift: np.ndarray


def new_grip(contacts: int, dimension: int, friction: float, restitution: float, gravity: float) -> Grip:
    """Room for that many contacts; raises `InvalidInput` for coefficients out of range."""
    return Grip(
        friction=number("friction", friction, 0.0, math.inf, "finite and >= 0"),
        restitution=number("restitution", restitution, 0.0, 1.0, "a number in [0, 1]"),
        gravity=number("gravity", gravity, 0.0, math.inf, "finite and >= 0 m/s^2"),
        push=np.zeros(contacts),
        drag=zeros(contacts, dimension),
        lift=np.zeros(contacts),
    )


@device
def open_contact(grip, c, particles, indices, weights, gaps, normal, h):
    """Start contact c: no push yet; its goal, from ``gaps`` = C at the start and C at the prediction."""
    start, predicted = gaps
    grip.push[c] = 0.0
    store(grip.drag, c, zero(particles.x))
    velocity = dot(combined(particles.v, indices, weights), normal)
    is_impact = predicted < 0.0 and -velocity > RESTING_SPEED * grip.gravity * h
    grip.lift[c] = max(start - grip.restitution * velocity * h, 0.0) if is_impact else 0.0


@device
def press(grip, c, particles, indices, weights, gap, normal):
    """One projection of contact c; see above."""
    total = 0.0
    for j in range(len(indices)):
        total += particles.w[indices[j]] * weights[j] * weights[j]
    old = grip.push[c]
    if total == 0.0 or (gap >= grip.lift[c] and old == 0.0):
        return
    push = max(old + (grip.lift[c] - gap) / total, 0.0)
    before = load(grip.drag, c)
    slip = subtract(combined(particles.p, indices, weights), combined(particles.x, indices, weights))
    wanted = subtract(before, scale(1.0 / total, slip))
    wanted = subtract(wanted, scale(dot(wanted, normal), normal))
    length, limit = math.sqrt(dot(wanted, wanted)), grip.friction * push
    drag = scale(limit / length, wanted) if length > limit else wanted
    grip.push[c] = push
    store(grip.drag, c, drag)
    change = add(scale(push - old, normal), subtract(drag, before))
    for j in range(len(indices)):
        accumulate(particles.p, indices[j], particles.w[indices[j]] * weights[j], change)


@device
def combined(values, indices, weights):
    """sum_j b_j a_j of a store's vectors a."""
    total = zero(values)
    for j in range(len(indices)):
        total = add(total, scale(weights[j], load(values, indices[j])))
    return total
