"""Errors that a user can act on: one line with the field, the value, the allowed range and the remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class InvalidInput(ValueError):
    """Input that cannot be computed with.

    Attributes
    ----------
    field : where the value came from, as the user spells it, e.g. ``settings.dt``
    value : the offending value
    allowed : the allowed range, in words
    remedy : what to do about it; may be empty
    """

    def __init__(self, field: str, value: object, allowed: str, remedy: str = "") -> None:
        self.field, self.value, self.allowed, self.remedy = field, value, allowed, remedy
        super().__init__(field, value, allowed, remedy)

    def __str__(self) -> str:
        shown = repr(self.value)
        shown = shown if len(shown) <= 80 else shown[:77] + "..."
        line = f"{self.field} = {shown}: must be {self.allowed}"
        line = f"{line}; {self.remedy}" if self.remedy else line
        return " ".join(line.split())


def unknown(field: str, name: str, known: Iterable[str]) -> InvalidInput:
    """The error for a name that is not in a list, with the nearest known name as remedy."""
    known = sorted(known)
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    remedy = f"did you mean {near[0]!r}?" if near else ""
    return InvalidInput(field, name, "one of " + ", ".join(known), remedy)
