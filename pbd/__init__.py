"""Position Based Dynamics in Numba.

Names are imported when first used, so that ``import pbd`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pbd.constraints.contact import plane_contact as plane_contact
    from pbd.constraints.distance import distance as distance
    from pbd.damping import Damping as Damping
    from pbd.errors import InvalidInput as InvalidInput
    from pbd.external import point_forces as point_forces
    from pbd.integrators.euler import Euler as Euler
    from pbd.integrators.shake import Shake as Shake
    from pbd.settings import Settings as Settings
    from pbd.simulation import Outcome as Outcome
    from pbd.simulation import Simulation as Simulation
    from pbd.simulation import simulate as simulate
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
    "distance": "constraints.distance",
    "Damping": "damping",
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
