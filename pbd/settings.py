"""Settings of a simulation: frozen, validated, each with unit and range; they stay outside kernels."""

from __future__ import annotations

from dataclasses import dataclass

from pbd import fields
from pbd.damping import Damping
from pbd.errors import InvalidInput


@dataclass(frozen=True)
class Settings:
    """How to step: time step, sub-steps, solver iterations, damping.

    A sub-step is a whole pass of the algorithm with h = dt / substeps (Small Steps, Macklin et al. 2019);
    constraint projections a step = substeps x iterations x constraints.
    """

    dt: float = fields.real(1e-3, "s", 1e-12, 1e3, "time step")
    iterations: int = fields.whole(1, 1, 1_000_000, "solver iterations in each sub-step")
    substeps: int = fields.whole(1, 1, 1_000_000, "sub-steps in each step")
    damping: Damping | None = None

    def __post_init__(self) -> None:
        fields.check(self, "settings")
        if self.damping is not None and not isinstance(self.damping, Damping):
            raise InvalidInput("settings.damping", self.damping, "a Damping or None")

    @property
    def h(self) -> float:
        """Length of a sub-step [s]."""
        return float(self.dt) / int(self.substeps)
