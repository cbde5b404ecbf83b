"""The heap that falling boxes leave: side by side as a film, and over many seeds in numbers.

Which heap it is nobody can tell: after a few impacts any difference has grown to the size of a box. So heaps are
compared by what they have in common, as means over seeds with the spread between them. In 2D seed 0 is filmed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import msgspec
import numpy as np

from comparisons.film import Film, film
from comparisons.gather import by_engine, check, with_motion
from comparisons.isolation import Workers, lent
from comparisons.record import Record, RunSpec
from comparisons.run import build_scene
from comparisons.studies import _rigid
from comparisons.studies._rigid import ACCURATE, EULER, FAST, PARTICLES, Contender, chosen
from comparisons.study import Omission, Study, Table, head
from comparisons.trajectory import Trajectory

SCENE, RATE, DURATION = "falling_boxes", 240.0, 3.0
COUNT, SEEDS = 60, 5
CAP = 60.0
FRAMES = 24
"""A second of film, and samples a second of the run."""

METRICS = ("heap_height", "settled_penetration", "penetration", "residual_kinetic_energy", "energy_rise")
FORCE = "contact_force_error"
COLUMNS = {
    "height [m]": ("heap_height", ".2f"),
    "overlap at the end [m]": ("settled_penetration", ".0e"),
    "deepest overlap on the way [m]": ("penetration", ".0e"),
    "kinetic energy at the end [J/kg]": ("residual_kinetic_energy", ".0e"),
    "energy rise [m g L]": ("energy_rise", ".0e"),
    "planes' force less weight, over weight": (FORCE, ".0e"),
}
RISES = 1e-3
"""Of m g L: energy that an engine makes from nothing."""

FILMED = (
    ACCURATE,
    PARTICLES,
    Contender("pybullet, matched", "pybullet", ("matched",)),
    Contender("pymunk, matched", "pymunk", ("matched",)),
    Contender("MuJoCo, matched", "mujoco", ("matched",)),
    EULER,
)
CONTENDERS = (ACCURATE, FAST, *FILMED[1:])
BOXES_ONLY = ("particle_boxes",)
"""Engines that know no balls: they get boxes of the same sizes at the same places."""


@dataclass(frozen=True)
class Plan:
    """A contender's heaps of one dimension."""

    contender: Contender
    dimension: int
    specs: Sequence[RunSpec]


@dataclass(frozen=True)
class Heaps:
    """What came of a plan: records, one of each seed, and in 2D the film of the first."""

    plan: Plan
    records: Sequence[Record]
    film: Film | None

    def values(self, metric: str) -> list[float]:
        """Of the seeds that have one."""
        return [value for record in self.records if math.isfinite(value := record.metric(metric))]


def run(
    *,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    count: int = COUNT,
    seeds: int = SEEDS,
    solids: int = COUNT,
    solid_seeds: int = SEEDS,
    cap: float = CAP,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Let boxes and a few balls fall on a heap.

    Parameters
    ----------
    engines : names; default all that move rigid bodies
    settings : must be empty
    count, seeds : bodies of a heap in 2D, and heaps of each engine
    solids, solid_seeds : the same in 3D; 0 seeds leave it out
    cap : seconds that an engine's heaps of one dimension may take; further seeds are left out

    Raises
    ------
    InvalidInput : before anything runs
    """
    contenders = chosen(engines, settings, CONTENDERS)
    _rigid.positive(count=[count], seeds=[seeds], solids=[solids], cap=[cap])
    sizes = [(2, count, seeds), (3, solids, solid_seeds)]
    plans = [
        Plan(one, d, [_spec(one, d, n, seed) for seed in range(many)])
        for d, n, many in sizes
        if many
        for one in contenders
    ]
    check(spec for plan in plans for spec in plan.specs)
    with lent(workers) as pool:
        jobs = [(plan.contender.engine, partial(_heaps, pool, plan, cap)) for plan in plans]
        found = by_engine("falling boxes", jobs, quiet=quiet)
    shown = {d: [heaps for heaps in found if heaps.plan.dimension == d] for d, _, many in sizes if many}
    return Study(
        kind="falling",
        title=f"{count} boxes and balls that fall, at {RATE:g} Hz",
        subject="falling boxes",
        scene=SCENE,
        parameters={"count": count},
        head=head(),
        panels=[],
        series=[],
        records=[record for heaps in found for record in heaps.records],
        omissions=_omissions(found) + _rigid.others_left_out(),
        sentences=[said for d, some in shown.items() if (said := _sentence(f"{d}D", some))],
        tables=[_table(d, n, shown[d]) for d, n, many in sizes if many],
        films=[heaps.film for heaps in found if heaps.film is not None],
    )


def _spec(one: Contender, dimension: int, count: int, seed: int) -> RunSpec:
    given = {
        "count": count,
        "dimension": dimension,
        "seed": seed,
        "duration": DURATION,
        "samples": round(FRAMES * DURATION),
    }
    if one.engine in BOXES_ONLY:
        given["balls"] = 0.0
    return one.spec(SCENE, given, one.presets[0], 1.0 / RATE, METRICS)


def _heaps(pool: Workers, plan: Plan, cap: float) -> Heaps:
    """Run a plan; only an engine that tells the planes' forces is asked for their error."""
    records: list[Record] = []
    shot: Film | None = None
    metrics: tuple[str, ...] = (*METRICS, FORCE)
    for spec in plan.specs:
        record, trajectory = with_motion(pool, msgspec.structs.replace(spec, metrics=metrics))
        if record.status.code == "refused" and trajectory is not None:
            metrics = METRICS
            record, _ = with_motion(pool, spec, trajectory)
        if not records and trajectory is not None and plan.dimension == 2 and plan.contender in FILMED:
            shot = _film(plan, record, trajectory)
        records.append(record)
        spent = sum(record.wall for record in records)
        if record.status.code == "unsupported" or spent + record.wall > cap:
            break
    return Heaps(plan, records, shot)


def _film(plan: Plan, record: Record, trajectory: Trajectory) -> Film:
    name, depth = plan.contender.engine, record.metric("penetration")
    return film(
        build_scene(record.scene, record.parameters),
        trajectory,
        engine=name,
        label=plan.contender.label + (", boxes only" if name in BOXES_ONLY else ""),
        note=f"overlap up to {1e3 * depth:.2g} mm" if math.isfinite(depth) else record.status.code,
    )


# ------------------------------------------------------------------ in words


def _omissions(found: Sequence[Heaps]) -> list[Omission]:
    """Engines of which no run in the plane has a result."""
    flat = [heaps for heaps in found if heaps.plan.dimension == 2]
    lost = {heaps.plan.contender.engine: heaps.records[0].status for heaps in flat if not heaps.values(METRICS[0])}
    return [Omission(name, status.quantity or status.code, status.remedy) for name, status in lost.items()]


def _table(dimension: int, count: int, found: Sequence[Heaps]) -> Table:
    """A row for each contender: mean and spread over the seeds."""
    rows = []
    for heaps in found:
        status = heaps.records[0].status
        label = heaps.plan.contender.label + (" (boxes only)" if heaps.plan.contender.engine in BOXES_ONLY else "")
        cells = [_spread(heaps.values(metric), form) for metric, form in COLUMNS.values()]
        note = status.code if status.code in ("unsupported", "crashed") else str(len(heaps.values(METRICS[0])))
        rows.append([label, note, *cells])
    title = f"Heaps of {count} bodies in {dimension}D after {DURATION:g} s at {RATE:g} Hz"
    return Table(
        title=f"{title}, mean ± standard deviation over seeds; {_rigid.PENALTY}",
        columns=["engine", "seeds", *COLUMNS],
        rows=rows,
    )


def _spread(values: Sequence[float], form: str) -> str:
    """Mean and, of several values, their standard deviation."""
    if not values:
        return "-"
    mean = format(float(np.mean(values)), form)
    return mean if len(values) == 1 else f"{mean} ± {format(float(np.std(values, ddof=1)), form)}"


def _sentence(place: str, found: Sequence[Heaps]) -> str:
    """How alike the heaps are, who overlaps least, who is most at rest, whose energy rises."""
    means = {
        metric: {h.plan.contender.label: float(np.mean(h.values(metric))) for h in found if h.values(metric)}
        for metric in METRICS
    }
    heights = means["heap_height"].values()
    if not heights:
        return ""
    tight, still = (
        min(means[m].items(), key=lambda item: item[1]) for m in ("settled_penetration", "residual_kinetic_energy")
    )
    said = (
        f"{place}: mean heights of the heaps from {min(heights):.2f} to {max(heights):.2f} m; {tight[0]} overlaps least"
    )
    said += f" at the end, {tight[1]:.1e} m; {still[0]} is most at rest, {still[1]:.1e} J/kg"
    rising = [f"{label} ({rise:.1e})" for label, rise in means["energy_rise"].items() if rise > RISES]
    return f"{said}; energy rises with {', '.join(rising) or 'nobody'}."
