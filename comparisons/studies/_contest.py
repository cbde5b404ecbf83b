"""Who answers which question best, and by how much the subject loses, in sentences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from comparisons import engine
from comparisons.studies._rigid import ACCURATE, OURS, ROUND_OFF


@dataclass(frozen=True)
class Standing:
    """An error of a contender on a question at a rate; ``counts`` is False where a scheme is exact by construction."""

    question: str
    contender: str
    engine: str
    rate: float
    error: float
    counts: bool = True


def sentences(heading: str, standings: Sequence[Standing]) -> list[str]:
    """Who wins what, what the subject loses, and the same without its preset of many sub-steps."""
    counted = [s for s in standings if s.counts and math.isfinite(s.error)]
    if not counted:
        return []
    said = [f"{heading}: {_wins(counted)}."]
    if any(s.engine == OURS for s in counted):
        said.append(f"{heading}, losses of {_title(OURS)}: {losses(counted) or 'none'}.")
        fast = [s for s in counted if s.contender != ACCURATE.label]
        words = f"{_wins(fast)}; losses: {losses(fast) or 'none'}"
        said.append(f"{heading}, without {ACCURATE.label}, which makes 20 sub-steps of each step: {words}.")
    return said


EQUAL = 0.02
"""Errors that differ by less than this part are equal: schemes that do the same."""


def best(standings: Sequence[Standing], question: str) -> dict[str, float]:
    """engine -> its least error on a question; what is round-off counts as ROUND_OFF."""
    found: dict[str, float] = {}
    for s in standings:
        if s.question == question:
            found[s.engine] = min(max(s.error, ROUND_OFF), found.get(s.engine, math.inf))
    return found


def winner(errors: dict[str, float]) -> str:
    """The engine with the least error; "" where several share it."""
    least = min(errors.values())
    first = [name for name, error in errors.items() if error <= (1.0 + EQUAL) * least]
    return first[0] if len(first) == 1 else ""


def _wins(standings: Sequence[Standing]) -> str:
    questions = list(dict.fromkeys(s.question for s in standings))
    won: dict[str, list[str]] = {}
    for question in questions:
        won.setdefault(winner(best(standings, question)), []).append(question)
    shared = won.pop("", [])
    parts = [f"{_title(name)} wins {len(those)}" for name, those in sorted(won.items(), key=lambda i: -len(i[1]))]
    parts += [f"{len(shared)} shared"] if shared else []
    return f"of {len(questions)} questions " + ", ".join(parts)


def losses(standings: Sequence[Standing]) -> str:
    """Every question that another engine answers better than the subject, and by how much."""
    said = []
    for question in dict.fromkeys(s.question for s in standings):
        errors = best(standings, question)
        first = min(errors, key=lambda name: errors[name])
        if OURS in errors and errors[OURS] > (1.0 + EQUAL) * errors[first]:
            ratio = errors[OURS] / errors[first]
            numbers = f"{errors[first]:.1e} against {errors[OURS]:.1e}, {ratio:.{0 if ratio >= 10.0 else 1}f} times"
            said.append(f"{question} ({_title(first)} {numbers})")
    return "; ".join(said)


def _title(name: str) -> str:
    return str(engine.load(name).TITLE)
