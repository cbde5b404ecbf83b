"""Time of a particle's step with one sweep against the number of particles, and the cache that ends the plateau."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.gather import ROUNDS, Gatherer, check, through
from comparisons.isolation import Workers
from comparisons.studies._sweeping import (
    Contender,
    Sized,
    chosen,
    contenders,
    in_range,
    left_out,
    sized,
    step_pair,
    step_time,
)
from comparisons.study import Panel, Series, Study, Table, head
from pbd.errors import InvalidInput

PARTICLES = (1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
WORK = 1_000_000
"""Particle-steps of the shorter of the two runs whose difference is the time, at least."""

STEADY = 1.5
"""Times of a particle's step within this factor of each other are a plateau."""

CACHES = Path("/sys/devices/system/cpu/cpu0/cache")
UNITS = {"K": 2**10, "M": 2**20, "G": 2**30}
TIME = "time of a particle's step [ns]"
PANELS = (
    Panel(name="particles", title="one sweep a step, by size", x="particles", y=TIME),
    Panel(name="memory", title="the same, by memory in use", x="working set [bytes]", y=TIME),
)


def run(
    scene_name: str,
    *,
    scene: Mapping[str, Any] | None = None,
    engines: Sequence[str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    particles: Sequence[int] = PARTICLES,
    rounds: int = ROUNDS,
    workers: Workers | None = None,
    quiet: bool = False,
) -> Study:
    """Measure how the cost of a particle depends on how many there are.

    Parameters
    ----------
    scene_name : a scene with links that can start stretched: "pendulum_chain" or "hanging_cloth"
    scene : parameters that differ
    engines : of "pbd" and "pypbd"; default both
    settings : must be empty
    particles : sizes; those beyond the scene's range are left out
    rounds : interleaved timings of each run, of which the minimum counts

    Raises
    ------
    InvalidInput : before anything runs
    """
    names = chosen(engines, settings, rounds)
    counts = in_range(scene_name, particles)
    if not counts:
        raise InvalidInput("particles", list(particles), "at least one size that the scene can have")
    sizes = [sized(scene_name, scene or {}, count) for count in counts]
    lines = [one for one in contenders("pbd", precisions=("float64",)) if one.engine in names]
    plan = [(one, size) for one in lines for size in sizes]
    check(step_pair(*plan[0], _steps(sizes[0])))
    with Gatherer(names, f"scaling, {scene_name}", workers=workers, quiet=quiet) as gatherer:
        groups = gatherer.groups([(one.engine, through(step_pair(one, size, _steps(size)))) for one, size in plan])
        timed = iter(gatherer.times([record for group in groups for record in group], rounds))
        pairs = [[next(timed) for _ in group] for group in groups]
    times = [step_time(pair, size, _steps(size)) for (_, size), pair in zip(plan, pairs, strict=True)]
    measured = [(one, size, ns) for (one, size), ns in zip(plan, times, strict=True) if ns > 0.0]
    curves = [Curve(one, [(size, ns) for each, size, ns in measured if each is one]) for one in lines]
    curves, caches = [curve for curve in curves if curve.points], cache_sizes()
    series = [*_series(curves), *_cache_lines(curves, caches)]
    return Study(
        kind="scaling",
        title=f"Scaling on a {scene_name.replace('_', ' ')}",
        subject=scene_name.replace("_", " "),
        scene=scene_name,
        parameters=dict(scene or {}),
        head=head(),
        panels=[panel for panel in PANELS if panel.name in {one.panel for one in series}],
        series=series,
        records=[record for pair in pairs for record in pair],
        omissions=left_out([(one, pair) for (one, _), pair in zip(plan, pairs, strict=True)]),
        sentences=[_sentence(curve, caches) for curve in curves],
        tables=[_table(curves, sizes)],
    )


def _steps(size: Sized) -> int:
    return max(1, -(-WORK // size.particles))


@dataclass(frozen=True)
class Curve:
    """One contender: the sizes at which it was measured, ascending, and its times [ns]."""

    one: Contender
    points: list[tuple[Sized, float]]

    @property
    def plateau(self) -> int:
        """How many of the points, from the first on, lie within STEADY of each other."""
        times = [ns for _, ns in self.points]
        spread = [max(times[:n]) / min(times[:n]) for n in range(1, len(times) + 1)]
        return sum(ratio <= STEADY for ratio in spread)


def working_set(one: Contender, size: Sized) -> int:
    """Bytes that a step of our solver in double precision reads and writes; 0 for another engine's.

    Per particle x, p, v and w; per link its rest length and its factor k'/W, and in natural order the indices of its
    particles, unless the links are one chain.
    """
    if one.engine != "pbd":
        return 0
    dimensions = size.built.masses.positions.shape[1]
    pairs = np.concatenate([link.pairs for link in size.built.links])
    is_chain = np.array_equal(pairs, np.column_stack([np.arange(len(pairs)), np.arange(len(pairs)) + 1]))
    indices = 0 if is_chain or one.settings["order"] == "coloured" else 2
    return 8 * (size.particles * (3 * dimensions + 1) + size.links * (2 + indices))


def cache_sizes(place: Path = CACHES) -> dict[str, int]:
    """Name -> bytes of the data caches of a core, ascending, as Linux tells them; empty elsewhere."""
    found = {}
    for folder in sorted(place.glob("index*")):
        try:
            level, kind, size = ((folder / name).read_text().strip() for name in ("level", "type", "size"))
            if kind != "Instruction":
                found[f"L{level}"] = int(size[:-1]) * UNITS[size[-1]] if size[-1] in UNITS else int(size)
        except (OSError, ValueError, IndexError):
            continue
    return dict(sorted(found.items(), key=lambda item: item[1]))


# ------------------------------------------------------------------ drawn and in words


def _series(curves: list[Curve]) -> list[Series]:
    """Each curve over particles and, where it is known, over the working set."""
    found = []
    for curve in curves:
        one, ys = curve.one, [ns for _, ns in curve.points]
        counts = [float(size.particles) for size, _ in curve.points]
        bytes_used = [float(working_set(one, size)) for size, _ in curve.points]
        for panel, xs in (("particles", counts), ("memory", bytes_used)):
            if min(xs) > 0.0:
                found.append(Series(panel=panel, label=one.label, engine=one.engine, method=one.method, x=xs, y=ys))
    return found


def _cache_lines(curves: list[Curve], caches: dict[str, int]) -> list[Series]:
    """Upright lines at the sizes of the caches that the measured working sets go beyond."""
    used = [working_set(curve.one, size) for curve in curves for size, _ in curve.points if curve.one.engine == "pbd"]
    within = {name: held for name, held in caches.items() if used and min(used) <= held <= max(used)}
    times = [ns for curve in curves if curve.one.engine == "pbd" for _, ns in curve.points]
    return [
        Series(
            panel="memory",
            label="size of a cache: " + ", ".join(f"{name} {_bytes(size)}" for name, size in within.items()),
            engine="",
            x=[float(held)] * 2,
            y=[min(times), max(times)],
            kind="closed form",
        )
        for held in within.values()
    ]


def _sentence(curve: Curve, caches: dict[str, int]) -> str:
    """How far the plateau goes, and what ends it."""
    steady, beyond = curve.points[: curve.plateau], curve.points[curve.plateau :]
    first, last = steady[0][0].particles, steady[-1][0].particles
    low, high = min(ns for _, ns in steady), max(ns for _, ns in steady)
    said = f"{curve.one.label}: {low:.3g} ns a particle's step at {first} particles"
    if len(steady) > 1:
        said = f"{curve.one.label}: {low:.3g} to {high:.3g} ns a particle's step from {first} to {last} particles"
    if not beyond:
        return f"{said}, within x{STEADY:g}."
    size, ns = beyond[0]
    cause = f", where {_cause(working_set(curve.one, size), caches)}" if ns > high else ""
    return f"{said}, within x{STEADY:g}; then {ns:.3g} ns at {size.particles}{cause}."


def _cause(needed: int, caches: dict[str, int]) -> str:
    """The largest cache that a working set [bytes] does not fit into."""
    if not needed:
        return "its working set is not known"
    left = [f"is beyond the {name} cache of {_bytes(held)}" for name, held in caches.items() if held < needed]
    inside = "fits into every cache" if caches else "may be beyond a cache, which this machine does not tell"
    return f"the working set of {_bytes(needed)} {left[-1] if left else inside}"


def _table(curves: list[Curve], sizes: list[Sized]) -> Table:
    """Times and working sets, a row for each size."""
    rows = []
    for size in sizes:
        row = [str(size.particles)]
        for curve in curves:
            ns = next((ns for each, ns in curve.points if each is size), None)
            needed = working_set(curve.one, size)
            row += ["-" if ns is None else f"{ns:.3g}" + (f" ({_bytes(needed)})" if needed else "")]
        rows.append(row)
    columns = ["particles", *(curve.one.label for curve in curves)]
    return Table(title="Time of a particle's step with one sweep [ns] (and working set)", columns=columns, rows=rows)


def _bytes(count: float) -> str:
    """A size in its natural unit."""
    for unit, size in (("MB", 2**20), ("kB", 2**10)):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count:.0f} B"
