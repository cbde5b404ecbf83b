"""What an engine adapter is: a module in `comparisons.engines` with the names of `Engine`.

An adapter translates the vocabulary of `comparisons.scene`, never scene names. Its conventions
(order of updates, damping defaults, inertia of rods) are calibrated by a test on a closed form.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Protocol

from comparisons import catalog
from comparisons.scene import Scene
from comparisons.trajectory import Trajectory
from pbd import fields
from pbd.errors import InvalidInput, unknown


class Engine(Protocol):
    """The names that an adapter module defines.

    TITLE : as shown in plots
    FOREIGN : True runs it in a child process, so that its crash costs one run
    Settings : frozen dataclass of `pbd.fields`; with ``dt`` if it steps, ``method`` if it has several
    PRESETS : name -> changes to the defaults; "default" is what a user gets, {} at least
    describe(settings) : optional, how the settings are named in plots and tables
    VARIANTS : optional, settings shown by the convergence study; else the default and the matched preset
    calibrate() : optional, list of `record.Finding` that only this engine can show; runs where its runs do
    """

    TITLE: str
    FOREIGN: bool
    Settings: ClassVar[Callable[..., Any]]
    PRESETS: Mapping[str, Mapping[str, Any]]

    def missing(self) -> str:
        """The command that installs what is missing; empty when the engine can run here."""

    def version(self) -> str:
        """Version of the engine, not of the adapter."""

    def sweep(self, scene: Scene) -> list[dict[str, Any]]:
        """Settings that the work-precision study tries on the scene, each over many time steps."""

    def unsupported(self, scene: Scene, settings: Any) -> str:
        """Why the engine cannot run the scene; empty when it can."""

    def prepare(self, scene: Scene, settings: Any) -> Callable[[], Trajectory]:
        """Build everything; the returned function does the run, once, and is what gets timed."""


def load(name: str) -> Any:
    """The adapter of that name."""
    return catalog.load("engines", name)


def make_settings(name: str, preset: str, changes: Mapping[str, Any]) -> Any:
    """The settings of an engine: its defaults, the preset's changes, then ``changes``.

    Raises `InvalidInput` for an unknown preset or setting and for a value out of range.
    """
    engine = load(name)
    if preset not in engine.PRESETS:
        raise unknown(f"{name}.preset", preset, engine.PRESETS)
    for key in changes:
        fields.find(f"{name} setting", key, engine.Settings)
    try:
        return engine.Settings(**{**engine.PRESETS[preset], **changes})
    except InvalidInput as error:
        field = error.field.replace("settings.", f"{name}.", 1)
        raise InvalidInput(field, error.value, error.allowed, error.remedy) from None
