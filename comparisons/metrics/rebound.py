"""Relative error of the height of the first rebound."""

from __future__ import annotations

from comparisons.metrics import Subject, _flight

UNIT = "1"
TITLE = "error of the first rebound"


def measure(subject: Subject) -> float:
    """|apex / known - 1|, the apex from the sample nearest to it in time; `Refused` where the scene knows none."""
    return _flight.apex_error(subject, _flight.known(subject, "rebound"))
