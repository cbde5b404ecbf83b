"""Scenes, engines, metrics and studies are found by their file names and imported when asked for."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path
from types import ModuleType
from typing import Any

from pbd.errors import unknown

_ROOT = Path(__file__).resolve().parent


def names(kind: str) -> list[str]:
    """All names of a kind: "scenes", "engines", "metrics" or "studies"; nothing is imported."""
    return sorted(
        module.name for module in pkgutil.iter_modules([str(_ROOT / kind)]) if not module.name.startswith("_")
    )


def load(kind: str, name: str) -> Any:
    """The module of that name; `InvalidInput` with the nearest name where there is none."""
    if name not in names(kind):
        raise unknown(
            kind.removesuffix("ies") + "y" if kind.endswith("ies") else kind.removesuffix("s"), name, names(kind)
        )
    module: ModuleType = importlib.import_module(f"comparisons.{kind}.{name}")
    return module
