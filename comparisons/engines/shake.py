"""This project's second-order methods: SHAKE and its compositions of order 4 and 6, in the position-based loop.

Not PBD: constraint gradients are frozen at the start of the step, and velocities live at half steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from comparisons.engines import _pbd_scene
from comparisons.scene import Rods, Scene
from comparisons.trajectory import Trajectory
from pbd import fields

TITLE = "SHAKE"
FOREIGN = False
ORDERS = ("2", "4", "6")
SOLVERS = ("direct", "gauss_seidel")
VELOCITIES = ("impulses", "differences")
NAMES = {"2": "SHAKE", "4": "SHAKE, Suzuki's composition", "6": "SHAKE, Kahan and Li's composition"}
SUBSTEPS = {"2": 1, "4": 5, "6": 9}
"""Sub-steps of a composed step."""


@dataclass(frozen=True)
class Settings:
    """``iterations`` are Gauss-Seidel's; the direct solver converges by itself."""

    order: str = fields.choice("2", ORDERS, "of convergence: 2; 4, Suzuki 1990; 6, Kahan and Li 1997")
    dt: float = fields.real(1e-3, "s", 1e-12, 1e3, "time step")
    solver: str = fields.choice("direct", SOLVERS, "of the constraints of a step")
    iterations: int = fields.whole(1, 1, 1_000_000, "Gauss-Seidel sweeps in each sub-step")
    velocity: str = fields.choice("impulses", VELOCITIES, "v <- v + impulse, or (p - x)/h")

    def __post_init__(self) -> None:
        fields.check(self, "settings")


PRESETS: dict[str, dict[str, Any]] = {"default": {}, "fast": {}, "accurate": {"order": "6"}}
VARIANTS: list[dict[str, Any]] = [{"order": order} for order in ORDERS]


def missing() -> str:
    return ""


def version() -> str:
    return metadata.version("pbdbench")


def unsupported(scene: Scene, settings: Settings) -> str:
    return _pbd_scene.why_not(scene, _solver_settings(settings), _rigid)


def sweep(scene: Scene) -> list[dict[str, Any]]:
    """The three orders; nothing where a link is soft."""
    return VARIANTS if len(scene.of(Rods)) == len(scene.links) else VARIANTS[:1]


def describe(settings: Settings) -> str:
    """The method and its order in words."""
    sweeps = f", {settings.iterations} sweeps" if settings.solver == "gauss_seidel" else ""
    velocity = ", v from differences" if settings.velocity == "differences" else ""
    return f"{NAMES[settings.order]}{sweeps}{velocity}"


def prepare(scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """Bind the simulation; the run is one kernel call."""
    return _pbd_scene.prepare(scene, _solver_settings(settings), _rigid)


def _solver_settings(settings: Settings) -> Any:
    import pbd

    return pbd.Settings(
        dt=settings.dt,
        iterations=settings.iterations,
        integrator=pbd.Shake(int(settings.order), settings.velocity),
        solver=pbd.Direct() if settings.solver == "direct" else pbd.GaussSeidel(),
    )


def _rigid(link: Any, w: Any) -> Any:
    import pbd

    return pbd.Stiffness() if isinstance(link, Rods) else pbd.Compliance(link.compliances)
