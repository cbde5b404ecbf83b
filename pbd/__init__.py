"""Position Based Dynamics in Numba.

Names are imported when first used, so that ``import pbd`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pbd.constraints.box_contact import box_contacts as box_contacts
    from pbd.constraints.contact import plane_contact as plane_contact
    from pbd.constraints.corner_contact import corner_planes as corner_planes
    from pbd.constraints.distance import distance as distance
    from pbd.constraints.shape_matching import shape_matching as shape_matching
    from pbd.damping import Damping as Damping
    from pbd.errors import InvalidInput as InvalidInput
    from pbd.external import point_forces as point_forces
    from pbd.fluid.density import densities as densities
    from pbd.fluid.density_input import density as density
    from pbd.integrators.euler import Euler as Euler
    from pbd.integrators.rattle import Rattle as Rattle
    from pbd.integrators.shake import Shake as Shake
    from pbd.rigid.bodies import Ball as Ball
    from pbd.rigid.bodies import Box as Box
    from pbd.rigid.bodies import bodies as bodies
    from pbd.rigid.contact_input import contacts as contacts
    from pbd.rigid.contact_input import planes as planes
    from pbd.rigid.joint_input import ball_joint as ball_joint
    from pbd.rigid.joint_input import distance_joint as distance_joint
    from pbd.rigid.joint_input import hinge as hinge
    from pbd.settings import Settings as Settings
    from pbd.simulation import Outcome as Outcome
    from pbd.simulation import Simulation as Simulation
    from pbd.simulation import simulate as simulate
    from pbd.solvers.conjugate import ConjugateSweeps as ConjugateSweeps
    from pbd.solvers.direct import Direct as Direct
    from pbd.solvers.gauss_seidel import GaussSeidel as GaussSeidel
    from pbd.solvers.implicit import Implicit as Implicit
    from pbd.solvers.jacobi import Jacobi as Jacobi
    from pbd.solvers.multilevel import Multilevel as Multilevel
    from pbd.state import particles as particles
    from pbd.stiffness import Compliance as Compliance
    from pbd.stiffness import Stiffness as Stiffness

_HOME = {
    "plane_contact": "constraints.contact",
    "box_contacts": "constraints.box_contact",
    "corner_planes": "constraints.corner_contact",
    "distance": "constraints.distance",
    "shape_matching": "constraints.shape_matching",
    "Ball": "rigid.bodies",
    "Box": "rigid.bodies",
    "bodies": "rigid.bodies",
    "ConjugateSweeps": "solvers.conjugate",
    "contacts": "rigid.contact_input",
    "planes": "rigid.contact_input",
    "ball_joint": "rigid.joint_input",
    "distance_joint": "rigid.joint_input",
    "hinge": "rigid.joint_input",
    "Rattle": "integrators.rattle",
    "Damping": "damping",
    "densities": "fluid.density",
    "density": "fluid.density_input",
    "Direct": "solvers.direct",
    "Euler": "integrators.euler",
    "GaussSeidel": "solvers.gauss_seidel",
    "Implicit": "solvers.implicit",
    "InvalidInput": "errors",
    "Jacobi": "solvers.jacobi",
    "Multilevel": "solvers.multilevel",
    "point_forces": "external",
    "Settings": "settings",
    "Shake": "integrators.shake",
    "Outcome": "simulation",
    "Simulation": "simulation",
    "simulate": "simulation",
    "particles": "state",
    "Compliance": "stiffness",
    "Stiffness": "stiffness",
}
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'pbd' has no attribute {name!r}")
    return getattr(importlib.import_module(f"pbd.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return __all__
