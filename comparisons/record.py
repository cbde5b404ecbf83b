"""Plain data of a run: what was asked (`RunSpec`) and what came out (`Record`). Both round-trip through JSON."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import msgspec

SCHEMA = 1

STATUSES = ("ok", "drifting", "diverged", "timeout", "crashed", "refused", "unsupported")


def plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """The same with numpy's numbers and arrays, and tuples, as Python's own numbers and lists."""
    return {key: _plain(value) for key, value in values.items()}


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    return [_plain(part) for part in value] if isinstance(value, list | tuple) else value


class RunSpec(msgspec.Struct, frozen=True, kw_only=True):
    """One run, complete: equal specs give equal results.

    parameters and settings hold only what differs from the scene's defaults and the engine's preset.
    metrics : names; None asks for the scene's own list
    """

    scene: str
    engine: str
    parameters: dict[str, Any] = {}
    preset: str = "default"
    settings: dict[str, Any] = {}
    seed: int = 0
    metrics: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        for name in ("parameters", "settings"):
            msgspec.structs.force_setattr(self, name, plain(getattr(self, name)))

    def key(self) -> str:
        """A digest of all fields, independent of their order."""
        return hashlib.sha256(msgspec.json.encode(self, order="deterministic")).hexdigest()[:32]


class Value(msgspec.Struct, frozen=True):
    """A measured number and its unit."""

    value: float
    unit: str


class Finding(msgspec.Struct, frozen=True, kw_only=True):
    """What calibration found in an engine: what was asked, the closed form's value, the engine's, and in words."""

    what: str
    expected: float
    found: float
    unit: str
    verdict: str


class Status(msgspec.Struct, frozen=True, kw_only=True):
    """How a run ended: a code of STATUSES; when not ok the step, the quantity and what to do."""

    code: str = "ok"
    step: int = 0
    quantity: str = ""
    remedy: str = ""


class Seconds(msgspec.Struct, frozen=True, kw_only=True):
    """Run time [s]: the minimum of ``repeats``, and the part that is the engine's empty-world overhead."""

    min: float
    repeats: int
    overhead: float

    @property
    def net(self) -> float:
        """Time without the empty-world overhead."""
        return max(self.min - self.overhead, 0.0)


class Record(msgspec.Struct, frozen=True, kw_only=True):
    """The result of one run; metrics are empty unless the status is ok.

    ``seconds`` is the measured run time, taken apart from the error run. ``wall`` is what the error run took [s]:
    it only budgets further runs.
    """

    key: str
    scene: str
    parameters: dict[str, Any]
    engine: str
    version: str
    method: str
    preset: str
    settings: dict[str, Any]
    dt: float | None
    steps: int
    seed: int
    metrics: dict[str, Value] = {}
    seconds: Seconds | None = None
    work: dict[str, int] = {}
    wall: float = 0.0
    status: Status = Status()

    def metric(self, name: str) -> float:
        """The value of a metric, nan where the run has none."""
        return self.metrics[name].value if name in self.metrics else float("nan")
