"""Validated fields of frozen settings: each carries its unit, its range and its meaning.

A settings class is a frozen dataclass whose fields are made by `real`, `whole`, `choice` or `flag`
and whose ``__post_init__`` calls `check`. The same metadata serves ``--help``, the error line and
the conversion of text from a command line (`parse`).
"""

from __future__ import annotations

import dataclasses
import math
import numbers
from typing import Any

from pbd.errors import InvalidInput, unknown


@dataclasses.dataclass(frozen=True)
class Rule:
    """What a field may hold. ``low`` and ``high`` bound numbers; ``open_low`` excludes ``low`` itself."""

    kind: str
    unit: str = "1"
    low: float = -math.inf
    high: float = math.inf
    open_low: bool = False
    names: tuple[str, ...] = ()
    optional: bool = False
    many: bool = False
    doc: str = ""

    def allowed(self) -> str:
        """The allowed range in words, with the unit."""
        if self.kind == "choice":
            return "one of " + ", ".join(self.names)
        if self.kind == "flag":
            return "true or false"
        noun = "a whole number" if self.kind == "whole" else "a finite number"
        unit = "" if self.unit == "1" else f" {self.unit}"
        left = f"{'>' if self.open_low else '>='} {self.low:g}" if self.low > -math.inf else ""
        right = f"<= {self.high:g}" if self.high < math.inf else ""
        bounds = " and ".join(part for part in (left, right) if part)
        plural = ", or a list of such" if self.many else ""
        return f"{noun} {bounds}{unit}".strip() + plural + (" or none" if self.optional else "")

    def holds(self, value: Any) -> bool:
        """True when ``value`` is of the right type and in range."""
        if self.many and isinstance(value, list | tuple):
            return len(value) > 0 and all(dataclasses.replace(self, many=False, optional=False).holds(v) for v in value)
        if value is None:
            return self.optional
        if self.kind == "choice":
            return value in self.names
        if self.kind == "flag":
            return isinstance(value, bool)
        wanted = numbers.Integral if self.kind == "whole" else numbers.Real
        if isinstance(value, bool) or not isinstance(value, wanted):
            return False
        try:
            number = float(value)
        except OverflowError:  # a whole number beyond any float
            return False
        return math.isfinite(number) and self.low <= number <= self.high and not (self.open_low and number == self.low)


def _field(default: Any, rule: Rule) -> Any:
    return dataclasses.field(default=default, metadata={"rule": rule})


def real(
    default: Any, unit: str, low: float, high: float, doc: str, *, above: bool = False, optional: bool = False
) -> Any:
    """A finite real number in [low, high], or (low, high] with ``above``; None too with ``optional``."""
    return _field(default, Rule("real", unit, low, high, above, optional=optional, doc=doc))


def reals(
    default: Any, unit: str, low: float, high: float, doc: str, *, above: bool = False, optional: bool = False
) -> Any:
    """As `real`, or a list of such numbers."""
    return _field(default, Rule("real", unit, low, high, above, optional=optional, many=True, doc=doc))


def whole(default: Any, low: int, high: int, doc: str) -> Any:
    """A whole number in [low, high]."""
    return _field(default, Rule("whole", "1", low, high, doc=doc))


def choice(default: str, names: tuple[str, ...], doc: str) -> Any:
    """One of a few names."""
    return _field(default, Rule("choice", names=names, doc=doc))


def flag(default: bool, doc: str) -> Any:
    """True or false."""
    return _field(default, Rule("flag", doc=doc))


def rules(settings: Any) -> dict[str, Rule]:
    """The rules of a settings class or instance, by field name."""
    return {f.name: f.metadata["rule"] for f in dataclasses.fields(settings) if "rule" in f.metadata}


def find(field: str, name: str, settings: Any) -> Rule:
    """The rule of the field of that name; `InvalidInput` for ``field`` with the nearest name where there is none."""
    known = rules(settings)
    if name not in known:
        raise unknown(field, name, known)
    return known[name]


def check(settings: Any, prefix: str) -> None:
    """Raise `InvalidInput` for the first field whose value its rule does not allow."""
    for name, rule in rules(settings).items():
        value = getattr(settings, name)
        if rule.kind == "choice" and isinstance(value, str) and value not in rule.names:
            raise unknown(f"{prefix}.{name}", value, rule.names)
        if not rule.holds(value):
            raise InvalidInput(f"{prefix}.{name}", value, rule.allowed())


def parse(field: str, rule: Rule, text: str) -> Any:
    """The value that command-line ``text`` stands for under ``rule``."""
    lowered = text.strip().lower()
    if rule.optional and lowered in ("none", ""):
        return None
    if rule.many and "," in text:
        return [parse(field, dataclasses.replace(rule, many=False), part) for part in text.split(",")]
    if rule.kind == "choice":
        return text
    if rule.kind == "flag":
        if lowered not in ("true", "false", "1", "0", "yes", "no"):
            raise InvalidInput(field, text, rule.allowed())
        return lowered in ("true", "1", "yes")
    try:
        number = float(lowered)
        if rule.kind == "whole":
            if number != int(number):
                raise ValueError
            return int(lowered) if lowered.lstrip("+-").isdigit() else int(number)
        return number
    except (ValueError, OverflowError):
        raise InvalidInput(field, text, rule.allowed()) from None
