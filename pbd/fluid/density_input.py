"""What a user says about a fluid, checked, and the batch made of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pbd.arrays import indices, number
from pbd.errors import InvalidInput, unknown
from pbd.fluid.cells import new_cells, sorted_array
from pbd.fluid.density import Density, Sharing, Unit
from pbd.fluid.kernels import KERNELS, lattice_sum, new_kernel, profile
from pbd.fluid.solids import Solids
from pbd.fluid.terms import Repulsion
from pbd.fluid.velocities import Confinement, Viscosity
from pbd.fluid.wall_input import read_walls
from pbd.fluid.walls import new_walls
from pbd.state import Particles
from pbd.stiffness import Compliance, Stiffness

REPULSION_DISTANCE = 0.2
"""Of h: where repulsion is k h^2; the paper has 0.1 to 0.3."""

RELATIONS = ("at_most", "equality")


def density(
    particles: Particles,
    *,
    spacing: float,
    support: float = 2.5,
    kernel: str = "wendland",
    law: Any = None,
    omega: float = 1.0,
    epsilon: float = 0.0,
    normal: Any = None,
    offset: Any = 0.0,
    obstacles: Any = None,
    viscosity: float = 0.0,
    confinement: float = 0.0,
    repulsion: float = 0.0,
    members: Any = None,
    solids: Any = None,
) -> Density:
    """The particles as an incompressible fluid; its rest density is that of a lattice with this spacing.

    Parameters
    ----------
    particles : the group that the fluid is part of, in 2D or 3D
    spacing : of particles in a square or cubic lattice at rest density [m]; m = rho0 spacing^d
    support : h/spacing, the reach of the kernel, in [1.2, 6]
    kernel : "wendland" or "poly6_spiky"
    law : `Stiffness` or `Compliance` (without damping; alpha [1/J]) with one value for all and relation "at_most"
        (default) or "equality"
    omega : relaxation of the Jacobi iteration in (0, 2]
    epsilon : softens the constraints, >= 0, > 0 with an equality; a particle's own sum of squares is 1 to 2 in its unit
    normal, offset : walls n . y >= offset, (d,) or (m, d) and a number or (m,) [m], along the unit normal
    obstacles : boxes (low, high) along the axes, by opposite corners (d,) [m], of edges >= h; those that touch a wall
        go on behind it
    viscosity : c of XSPH in [0, 1]
    confinement : e of vorticity confinement, >= 0 [1/s]
    repulsion : k of s_corr, >= 0
    members : indices of the particles that are fluid; default all that are not solid
    solids : indices of particles of solids that the fluid flows about, pinned ones among them; of any masses, each of
        the volume spacing^d. Another batch holds a solid's particles together

    Raises
    ------
    InvalidInput : a value outside its range; particles in 1D; fluid that is pinned, of different masses, or solid too
    """
    d = len(particles.x)
    if d not in (2, 3):
        raise InvalidInput("particles", d, "of dimension 2 or 3", "a fluid on a line has no kernel here")
    hard = _solids(particles, solids)
    chosen = _members(particles, members, hard)
    spacing = number("spacing", spacing, 1e-9, 1e9, "a finite number >= 1e-09 and <= 1e+09 m")
    h = spacing * number("support", support, 1.2, 6.0, "a number in [1.2, 6]")
    if kernel not in KERNELS:
        raise unknown("kernel", str(kernel), KERNELS)
    form = new_kernel(kernel, h, d)
    volume = spacing**d / lattice_sum(form, spacing, d)
    w, n = float(particles.w[chosen[0]]) if len(chosen) else 1.0, len(chosen) + len(hard)
    law = _law(law)
    softness = _epsilon(epsilon, law) * w / h**2
    factor = number("viscosity", viscosity, 0.0, 1.0, "a number in [0, 1]") * volume * form.value
    return Density(
        kernel=form,
        cells=new_cells(np.concatenate([chosen, hard]), d, h, d + (len(hard) > 0)),
        walls=new_walls(read_walls(normal, offset, obstacles, h, d), form, spacing, d, n),
        value=volume * form.value,
        slope=volume * form.slope,
        inverse_mass=w,
        softness=softness,
        omega=number("omega", omega, 1e-6, 2.0, "a number >= 1e-06 and <= 2"),
        law=law,
        unit=Unit(np.ones(1)),
        position=_sorted_store(n, d),
        velocity=_sorted_store(n, d),
        multiplier=sorted_array(n),
        gradient=_sorted_store(n, d),
        push=_sorted_store(n, d),
        density=np.zeros(n),
        weight=np.zeros(n),
        sharing=Sharing(),
        solids=Solids(len(hard), _marks(hard, particles), particles.w / w, sorted_array(n)) if len(hard) else None,
        repulsion=_repulsion(repulsion, form, h),
        viscosity=Viscosity(factor) if factor > 0.0 else None,
        confinement=_confinement(confinement, h, n, d),
    )


def _solids(particles: Particles, solids: Any) -> np.ndarray:
    return _different("solids", () if solids is None else solids, particles.w.shape[0])


def _different(field: str, values: Any, n: int) -> np.ndarray:
    chosen = indices(field, values, n)
    if chosen.ndim != 1 or len(np.unique(chosen)) < len(chosen):
        raise InvalidInput(field, np.asarray(values).tolist(), "a list of different particles")
    return chosen


def _marks(solids: np.ndarray, particles: Particles) -> np.ndarray:
    """(n,) whether each particle is solid."""
    return np.isin(np.arange(particles.w.shape[0]), solids)


def _members(particles: Particles, members: Any, solids: np.ndarray) -> np.ndarray:
    others = ~_marks(solids, particles)
    chosen = np.flatnonzero(others) if members is None else _different("members", members, len(others))
    if not np.all(others[chosen]):
        twice = int(chosen[~others[chosen]][0])
        raise InvalidInput("solids", twice, "of particles that are no members", "a particle is fluid or solid")
    if len(solids) and not len(chosen):
        raise InvalidInput("members", [], "some particles where there are solids", "solids alone need no fluid")
    w = particles.w[chosen]
    if not np.all(w > 0.0):
        raise InvalidInput(f"members[{int(np.argmin(w))}]", 0.0, "a particle that can move", "list it in solids")
    if len(w) and w.max() - w.min() > 1e-9 * w.max():
        raise InvalidInput("particles", f"masses from {1 / w.max():g} to {1 / w.min():g} kg", "of one mass in a fluid")
    return chosen


def _law(law: Any) -> Any:
    law = Stiffness(relation="at_most") if law is None else law
    allowed = f"a Stiffness or Compliance with relation {' or '.join(RELATIONS)}"
    if not isinstance(law, Stiffness | Compliance) or law.relation not in RELATIONS:
        raise InvalidInput("law", law, allowed)
    field, value = ("law.k", law.k) if isinstance(law, Stiffness) else ("law.alpha", law.alpha)
    if np.ndim(value) > 0:
        raise InvalidInput(field, value, "one number for a fluid", "its particles are sorted anew in each step")
    if isinstance(law, Compliance) and np.any(law.beta):
        raise InvalidInput("law.beta", law.beta, "0 for a fluid", "viscosity damps it")
    return law


def _epsilon(epsilon: float, law: Any) -> float:
    epsilon = number("epsilon", epsilon, 0.0, math.inf, "finite and >= 0")
    if epsilon == 0.0 and law.relation == "equality":
        reason = "two particles at the kernel's edge have no gradient to draw them together with"
        raise InvalidInput("epsilon", epsilon, "> 0 with an equality", reason)
    return epsilon


def _sorted_store(n: int, d: int) -> tuple:
    return tuple(sorted_array(n) for _ in range(d))


def _repulsion(k: float, form: Any, h: float) -> Repulsion | None:
    k = number("repulsion", k, 0.0, math.inf, "finite and >= 0")
    inner = profile(form, np.array([REPULSION_DISTANCE * h]))[0][0] / form.value
    return Repulsion(-k * h**2, 1.0 / float(inner)) if k > 0.0 else None


def _confinement(e: float, h: float, n: int, d: int) -> Confinement | None:
    e = number("confinement", e, 0.0, math.inf, "finite and >= 0 1/s")
    return Confinement(e * h, tuple(np.zeros(n) for _ in range(2 * d - 3)), sorted_array(n)) if e > 0.0 else None
