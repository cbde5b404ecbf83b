"""Settings of a simulation: frozen, validated, each with unit and range; they stay outside kernels."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pbd import fields
from pbd.damping import Damping
from pbd.errors import InvalidInput
from pbd.integrators.euler import Euler
from pbd.solvers.gauss_seidel import GaussSeidel

PRECISIONS = ("float64", "float32")


@dataclass(frozen=True)
class Settings:
    """How to step: time step, sub-steps, solver iterations, damping; who integrates and who solves.

    A sub-step is a whole pass of the algorithm with h = dt / substeps (Small Steps, Macklin et al. 2019);
    constraint projections a step = substeps x iterations x constraints.

    integrator : `pbd.Euler` (2006, the default), `pbd.Shake` or `pbd.Rattle`
    solver : `pbd.GaussSeidel` (2006, the default), `pbd.Direct`, `pbd.Jacobi`, `pbd.Multilevel` or `pbd.Implicit`
    precision : of the state and of all arithmetic of Gauss-Seidel and Jacobi
    threads : that share out the sums of fluids; results are the same, to the last bit, for any number
    """

    dt: float = fields.real(1e-3, "s", 1e-12, 1e3, "time step")
    iterations: int = fields.whole(1, 1, 1_000_000, "solver iterations in each sub-step")
    substeps: int = fields.whole(1, 1, 1_000_000, "sub-steps in each step")
    damping: Damping | None = None
    integrator: Any = field(default_factory=Euler)
    solver: Any = field(default_factory=GaussSeidel)
    precision: str = fields.choice("float64", PRECISIONS, "of positions, velocities and projections")
    threads: int = fields.whole(1, 1, 64, "threads that share out the sums of fluids")

    def __post_init__(self) -> None:
        fields.check(self, "settings")
        if self.damping is not None and not isinstance(self.damping, Damping):
            raise InvalidInput("settings.damping", self.damping, "a Damping or None")
        for name, method in (("integrator", "bind"), ("solver", "arrange")):
            value = getattr(self, name)
            if isinstance(value, type) or not hasattr(value, method):
                raise InvalidInput(f"settings.{name}", value, f"an object with {method}(problem)")

    @property
    def h(self) -> float:
        """Length of a sub-step [s]."""
        return float(self.dt) / int(self.substeps)

    @property
    def dtype(self) -> Any:
        """The numpy type of ``precision``."""
        return np.dtype(self.precision)
