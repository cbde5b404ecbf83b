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
    from pbd.settings import Settings as Settings
    from pbd.simulate import Outcome as Outcome
    from pbd.simulate import Simulation as Simulation
    from pbd.simulate import simulate as simulate
    from pbd.state import particles as particles
    from pbd.stiffness import Compliance as Compliance
    from pbd.stiffness import Stiffness as Stiffness

_HOME = {
    "plane_contact": "constraints.contact",
    "distance": "constraints.distance",
    "Damping": "damping",
    "InvalidInput": "errors",
    "point_forces": "external",
    "Settings": "settings",
    "Outcome": "simulate",
    "Simulation": "simulate",
    "simulate": "simulate",
    "particles": "state",
    "Compliance": "stiffness",
    "Stiffness": "stiffness",
}
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'pbd' has no attribute {name!r}")
    module = importlib.import_module(f"pbd.{_HOME[name]}")
    # All names of the module at once: a function of the same name as its module must win over the module.
    globals().update({other: getattr(module, other) for other, home in _HOME.items() if home == _HOME[name]})
    return globals()[name]


def __dir__() -> list[str]:
    return __all__
