"""The dam break's numerical reference: the front of two methods in the limit of fine particles.

Position based fluids and weakly compressible SPH share particles, walls and the search for neighbours, but neither
equations nor integrator. Each method's front is fitted by Z(T; dx) = Z0 + Z1 dx over its resolutions - a front is where
a particle ends, which is of first order in dx - and Z0 is its limit. The reference is the mean of the two limits, and
their gap its uncertainty.

``python -m comparisons.studies.front_reference`` (`make reference`, minutes) writes what `comparisons.water` reads.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.gather import by_engine, check
from comparisons.isolation import Workers, lent
from comparisons.metrics import Subject, _water
from comparisons.record import Record
from comparisons.studies import _fluids
from comparisons.studies._fluids import ACCURATE, WCSPH, Contender
from comparisons.study import Panel, Series, Study, Table, head, write_atomically
from comparisons.water import REFERENCE
from pbd.errors import InvalidInput

SCENE, METRICS = "dam_break", ("front", "density_error", "density_peak")
SAMPLES = 30
"""To T = 3."""

ACROSS, ACROSS_SPH = (20, 28, 40, 56, 80), (20, 28, 40, 56, 80)
METHODS = (ACCURATE, WCSPH)
SHOWN = (1.0, 2.0, 3.0)


@dataclass(frozen=True)
class Limit:
    """A method's fronts, (levels, s), at spacings (levels,) [a], and their limit (s,)."""

    one: Contender
    spacings: np.ndarray
    fronts: np.ndarray

    @property
    def coefficients(self) -> np.ndarray:
        """(2, s): Z0 and Z1."""
        design = np.column_stack([np.ones(len(self.spacings)), self.spacings])
        return np.linalg.lstsq(design, self.fronts, rcond=None)[0]

    @property
    def values(self) -> np.ndarray:
        """(s,) Z0."""
        return self.coefficients[0]

    @property
    def scatter(self) -> np.ndarray:
        """(s,) rms distance of the fronts from their straight line."""
        line = self.coefficients[0] + self.spacings[:, None] * self.coefficients[1]
        return np.sqrt(np.mean((self.fronts - line) ** 2, axis=0))


def run(
    *,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    across: Sequence[int] = ACROSS,
    across_sph: Sequence[int] = ACROSS_SPH,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Run both methods and extrapolate.

    Parameters
    ----------
    engines, settings : must be left out: the reference needs both methods as they are
    across, across_sph : particles across of PBF and of WCSPH, two at least

    Raises
    ------
    InvalidInput : before anything runs
    """
    if engines or settings:
        raise InvalidInput("engines, settings", [engines, settings], "absent", "the reference needs both methods")
    limits, records = measure([list(across), list(across_sph)], workers, quiet)
    times = np.linspace(0.0, 3.0, SAMPLES + 1)
    rows = table_of(limits)
    at = [round(t * SAMPLES / 3.0) for t in SHOWN]
    return Study(
        kind="front_reference",
        title="The front of the dam break in the limit of fine particles",
        subject="dam break",
        scene=SCENE,
        parameters={},
        head=head(),
        panels=[
            Panel(name="levels", title="front at T = 1, 2, 3 over the spacing", x="dx/a", y="front [a]", linear=True),
            Panel(name="front", title="limits", x="T = t √(2g/a)", y="front [a]", linear=True),
        ],
        series=[s for limit in limits for s in _series(limit, times, at)],
        records=records,
        sentences=[_sentence(limit, at) for limit in limits],
        tables=[
            Table(
                title="Front: reference, uncertainty, and the limits of both methods",
                columns=["T", "Z", "gap", *(limit.one.label for limit in limits)],
                rows=[[f"{value:.4f}" for value in row] for row in rows],
            )
        ],
    )


def measure(sizes: Sequence[Sequence[int]], workers: Workers | None, quiet: bool) -> tuple[list[Limit], list[Record]]:
    """The limits of both methods at their numbers of particles across, and all records."""
    for some in sizes:
        _fluids.counts("across, across_sph", some)
        if len(set(some)) < 2:
            raise InvalidInput("across, across_sph", list(some), "at least two resolutions")
    plans = [(one, n) for one, some in zip(METHODS, sizes, strict=True) for n in some]
    specs = [one.spec(SCENE, {"across": n, "samples": SAMPLES}, METRICS) for one, n in plans]
    check(specs)
    with lent(workers) as pool:
        jobs = [(spec.engine, partial(_fluids.measured, pool, spec, _front)) for spec in specs]
        found = dict(zip(plans, by_engine("front reference", jobs, quiet=quiet), strict=True))
    limits = [_limit(one, {n: found[one, n] for other, n in plans if other is one}) for one in METHODS]
    return limits, [record for record, _ in found.values()]


def _front(subject: Subject) -> np.ndarray:
    return _water.dimensionless(subject)[1]


def _limit(one: Contender, runs: Mapping[int, tuple[Record, np.ndarray | None]]) -> Limit:
    fronts = {n: front for n, (_, front) in runs.items() if front is not None}
    if len(fronts) < 2:
        codes = {n: record.status.code for n, (record, _) in runs.items()}
        raise InvalidInput("across, across_sph", codes, "two runs at least that are ok")
    return Limit(one, 1.0 / np.array(list(fronts)), np.array(list(fronts.values())))


def table_of(limits: Sequence[Limit]) -> np.ndarray:
    """(s, 5) T, mean of both limits, their gap, and each."""
    one, other = (limit.values for limit in limits)
    times = np.linspace(0.0, 3.0, len(one))
    return np.column_stack([times, 0.5 * (one + other), np.abs(one - other), one, other])


def _series(limit: Limit, times: np.ndarray, at: Sequence[int]) -> list[Series]:
    named: Any = {"label": limit.one.label, "engine": limit.one.engine, "preset": limit.one.preset}
    found = [Series(panel="front", x=times.tolist(), y=limit.values.tolist(), kind="curve", **named)]
    for k in at:
        points = sorted(zip(limit.spacings.tolist(), limit.fronts[:, k].tolist(), strict=True))
        xs, ys = [0.0, *(x for x, _ in points)], [float(limit.values[k]), *(y for _, y in points)]
        found.append(Series(panel="levels", x=xs, y=ys, **named))
    return found


def _sentence(limit: Limit, at: Sequence[int]) -> str:
    told = ", ".join(f"{limit.values[k]:.3f} (scatter {limit.scatter[k]:.3f})" for k in at)
    return f"{limit.one.label}: limits of the front at T = 1, 2, 3: {told}, over {len(limit.spacings)} resolutions."


def _main() -> None:
    limits, _ = measure([ACROSS, ACROSS_SPH], None, quiet=False)
    rows = [",".join(f"{value:.4f}" for value in row) for row in table_of(limits)]
    levels = "; ".join(f"{limit.one.label} at {', '.join(f'{1 / s:.0f}' for s in limit.spacings)}" for limit in limits)
    text = [
        "# Front of the dam break, n^2 = 2, in the limit of fine particles: the mean of two methods and their gap.",
        f"# source: python -m comparisons.studies.front_reference; {levels} particles across",
        "# T = t*sqrt(2g/a), Z = front/a",
        "T,Z,gap,Z_pbf,Z_wcsph",
        *rows,
    ]
    path = Path(__file__).resolve().parent.parent / "data" / REFERENCE
    write_atomically(path, ("\n".join(text) + "\n").encode())
    print(path, file=sys.stderr)


if __name__ == "__main__":
    _main()
