"""Largest relative error of the heights of the first rebounds."""

from __future__ import annotations

from comparisons.metrics import Subject, _flight

UNIT = "1"
TITLE = "error of the first apexes"


def measure(subject: Subject) -> float:
    """max |apex / known - 1|, each from the sample nearest to it in time; `Refused` where the scene knows none."""
    return _flight.apex_error(subject, _flight.known(subject, "apexes"))
