"""Matched scenes in several engines: how wrong, how fast, how stable.

Names are imported when first used; ``comparisons.convergence("pendulum_chain", ...)`` runs that study.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from comparisons.record import Record as Record
    from comparisons.record import RunSpec as RunSpec
    from comparisons.run import execute as execute
    from comparisons.studies.blow_up import run as blow_up
    from comparisons.studies.box_stiffness import run as box_stiffness
    from comparisons.studies.calibration import run as calibration
    from comparisons.studies.contacts import run as contacts
    from comparisons.studies.convergence import run as convergence
    from comparisons.studies.dam_break import run as dam_break
    from comparisons.studies.density_stiffness import run as density_stiffness
    from comparisons.studies.falling import run as falling
    from comparisons.studies.fluid_convergence import run as fluid_convergence
    from comparisons.studies.fluid_throughput import run as fluid_throughput
    from comparisons.studies.front_reference import run as front_reference
    from comparisons.studies.implicit_euler import run as implicit_euler
    from comparisons.studies.piles import run as piles
    from comparisons.studies.scaling import run as scaling
    from comparisons.studies.small_steps import run as small_steps
    from comparisons.studies.solvers import run as solvers
    from comparisons.studies.stacking import run as stacking
    from comparisons.studies.stiffness import run as stiffness
    from comparisons.studies.throughput import run as throughput
    from comparisons.studies.work_precision import run as work_precision
    from comparisons.study import Study as Study

_HOME = {
    "Record": ("record", "Record"),
    "RunSpec": ("record", "RunSpec"),
    "Study": ("study", "Study"),
    "calibration": ("studies.calibration", "run"),
    "contacts": ("studies.contacts", "run"),
    "dam_break": ("studies.dam_break", "run"),
    "falling": ("studies.falling", "run"),
    "fluid_convergence": ("studies.fluid_convergence", "run"),
    "fluid_throughput": ("studies.fluid_throughput", "run"),
    "front_reference": ("studies.front_reference", "run"),
    "piles": ("studies.piles", "run"),
    "stacking": ("studies.stacking", "run"),
    "blow_up": ("studies.blow_up", "run"),
    "box_stiffness": ("studies.box_stiffness", "run"),
    "convergence": ("studies.convergence", "run"),
    "density_stiffness": ("studies.density_stiffness", "run"),
    "execute": ("run", "execute"),
    "implicit_euler": ("studies.implicit_euler", "run"),
    "scaling": ("studies.scaling", "run"),
    "small_steps": ("studies.small_steps", "run"),
    "solvers": ("studies.solvers", "run"),
    "stiffness": ("studies.stiffness", "run"),
    "throughput": ("studies.throughput", "run"),
    "work_precision": ("studies.work_precision", "run"),
}
__all__ = [
    "Record",
    "RunSpec",
    "Study",
    "blow_up",
    "box_stiffness",
    "calibration",
    "contacts",
    "convergence",
    "dam_break",
    "density_stiffness",
    "execute",
    "falling",
    "fluid_convergence",
    "fluid_throughput",
    "front_reference",
    "implicit_euler",
    "piles",
    "scaling",
    "small_steps",
    "solvers",
    "stacking",
    "stiffness",
    "throughput",
    "work_precision",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'comparisons' has no attribute {name!r}")
    module, attribute = _HOME[name]
    return getattr(importlib.import_module(f"comparisons.{module}"), attribute)
