"""The subject: this project's PBD solver, as published - PBD 2006, XPBD 2016, Small Steps 2019."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np

from comparisons.engines import _pbd_scene
from comparisons.scene import Rods, Scene, Springs
from comparisons.trajectory import Trajectory
from pbd import fields
from pbd.errors import InvalidInput

TITLE = "PBD"
FOREIGN = False
METHODS = ("pbd", "xpbd", "small_steps")
SOLVERS = ("gauss_seidel", "direct", "jacobi", "multilevel", "implicit")
ORDERS = ("natural", "wavefront", "coloured")
PRECISIONS = ("float64", "float32")


@dataclass(frozen=True)
class Settings:
    """``pbd`` takes k from each link's compliance where k is not given, so that its first projection is XPBD's."""

    method: str = fields.choice("pbd", METHODS, "PBD 2006; XPBD 2016; XPBD with one iteration a sub-step (2019)")
    dt: float = fields.real(1e-3, "s", 1e-12, 1e3, "time step")
    iterations: int = fields.whole(1, 1, 1_000_000, "solver iterations in each sub-step")
    substeps: int = fields.whole(1, 1, 1_000_000, "sub-steps in each step")
    k: float | None = fields.real(None, "1", 0.0, 1.0, "PBD stiffness; default from the compliance", optional=True)
    raw: bool = fields.flag(False, "apply k itself in each iteration instead of k'")
    damping: float = fields.real(0.0, "1", 0.0, 1.0, "k_damp of the plain velocity damping")
    solver: str = fields.choice("gauss_seidel", SOLVERS, "of the constraints of a sub-step")
    order: str = fields.choice("natural", ORDERS, "of the constraints in a Gauss-Seidel sweep")
    levels: int = fields.whole(64, 0, 64, "coarse levels at most, of the multilevel solver")
    period: int = fields.whole(0, 0, 1000, "sweeps between re-synchronisations, of the implicit solver; 0: none")
    precision: str = fields.choice("float64", PRECISIONS, "of positions, velocities and projections")

    def __post_init__(self) -> None:
        fields.check(self, "settings")
        for name, owner in (("order", "gauss_seidel"), ("levels", "multilevel"), ("period", "implicit")):
            value, usual = getattr(self, name), getattr(type(self), name)
            if self.solver != owner and value != usual:
                raise InvalidInput(f"settings.{name}", value, f"{usual} with solver {self.solver}", f"{owner} has it")
        if self.method == "small_steps" and self.iterations != 1:
            raise InvalidInput("settings.iterations", self.iterations, "1 with small_steps", "set substeps instead")
        if self.method != "pbd" and (self.k is not None or self.raw):
            raise InvalidInput("settings.method", self.method, "pbd where k or raw is set", "XPBD takes compliance")


NAMES = {"pbd": "PBD 2006", "xpbd": "XPBD", "small_steps": "Small Steps"}

PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "fast": {"method": "small_steps", "substeps": 1},
    "accurate": {"method": "small_steps", "substeps": 20},
}
VARIANTS: list[dict[str, Any]] = [
    {"method": "pbd"},
    {"method": "xpbd", "iterations": 10},
    {"method": "small_steps", "substeps": 10},
]
SWEEP: list[dict[str, Any]] = [
    {"method": "pbd", "iterations": 1},
    {"method": "pbd", "iterations": 10},
    {"method": "xpbd", "iterations": 10},
    {"method": "small_steps", "substeps": 10},
]


def missing() -> str:
    return ""


def version() -> str:
    return metadata.version("pbdbench")


def unsupported(scene: Scene, settings: Settings) -> str:
    return _pbd_scene.why_not(scene, _solver_settings(settings), _law_of(settings))


def sweep(scene: Scene) -> list[dict[str, Any]]:
    """Without compliance XPBD is PBD with k = 1, to the last bit: one of the two is enough."""
    return SWEEP if scene.of(Springs) else [chosen for chosen in SWEEP if chosen["method"] != "xpbd"]


def describe(settings: Settings) -> str:
    """The method, how it is solved, and its counts, in words; what is usual is left out."""
    counts = ((settings.iterations, "iterations"), (settings.substeps, "sub-steps"))
    how = [settings.solver if settings.solver != "gauss_seidel" else "", settings.order, settings.precision]
    said = [word.replace("_", " ") for word in how if word and word not in ("natural", "float64")]
    return ", ".join([NAMES[settings.method], *said, *(f"{n} {what}" for n, what in counts if n > 1)])


def prepare(scene: Scene, settings: Settings) -> Callable[[], Trajectory]:
    """Bind the simulation; the run is one kernel call."""
    return _pbd_scene.prepare(scene, _solver_settings(settings), _law_of(settings))


def _solver_settings(settings: Settings) -> Any:
    import pbd

    return pbd.Settings(
        dt=settings.dt,
        iterations=settings.iterations,
        substeps=settings.substeps,
        damping=pbd.Damping(settings.damping, plain=True),
        solver=_solver(settings),
        precision=settings.precision,
    )


def _solver(settings: Settings) -> Any:
    import pbd

    if settings.solver == "multilevel":
        return pbd.Multilevel(levels=settings.levels)
    if settings.solver == "implicit":
        return pbd.Implicit(period=settings.period)
    others = {"direct": pbd.Direct, "jacobi": pbd.Jacobi}
    return pbd.GaussSeidel(settings.order) if settings.solver == "gauss_seidel" else others[settings.solver]()


def _law_of(settings: Settings) -> _pbd_scene.Law:
    return lambda link, w: _law(link, w, settings)


def _law(link: Rods | Springs, w: np.ndarray, settings: Settings) -> Any:
    """The enforcement of a link that the method calls for."""
    import pbd
    from pbd.stiffness import stiffness_of_compliance

    compliance = link.compliances if isinstance(link, Springs) else np.zeros(len(link.lengths))
    if settings.method != "pbd":
        return pbd.Compliance(compliance)
    if settings.k is not None:
        return pbd.Stiffness(settings.k, raw=settings.raw)
    weight = w[link.pairs].sum(axis=1)
    return pbd.Stiffness(stiffness_of_compliance(compliance, weight, settings.dt / settings.substeps), raw=settings.raw)
