"""Where particles must stand so that constraints form unit-stride runs.

A run joins particles i, i + 1, ... to j, j + 1, ...: a loop over it reads and writes whole vectors. Two constraints
of a run share no particle while it is at most j - i long, so its order is free and no colour needs a look-up.

On a grid whose particles are numbered row by row, particles are sorted into a x b classes by column mod a and
row mod b: neighbours then stand in different classes, equal neighbours at an equal distance. The row width and
a, b are those with the lowest cost of all that the differences of the indices suggest; a chain is a grid of one
row. What forms no run - all of an irregular mesh, perhaps - is sorted by greedy colours.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from pbd.constraints.distance import Distance, Pairs
from pbd.constraints.distance_runs import DistanceRuns, UniformRuns
from pbd.vector import One

SHORTEST = 16
"""Constraints: a shorter run costs more to enter than it saves."""

LONG = 48
"""Constraints of one kind that are worth a run of their own."""

WIDEST_GAP = 4
"""Constraints of weight 0 that may fill a gap, for example where a row ends, to keep a run going."""

CLASSES = (1, 2, 3, 4)
RUN_COST, SINGLE_COST = 16.0, 4.0
"""Of entering a run, and of a constraint outside of runs, in constraints inside of runs."""

LANES = 16
"""Classes start at multiples of this many particles: a cache line in single precision."""

FREQUENT = 12
"""So many of the most frequent index differences are tried as row widths."""

SAMPLE, ROWS = 4_096, 16
"""Particles, and row widths, whose constraints decide the layout: a larger grid goes on as it begins."""


class Layout(NamedTuple):
    """slot (n,) : where each particle stands, among ``slots`` places."""

    slot: np.ndarray
    slots: int


class Run(NamedTuple):
    """Constraints ``source`` (m,), -1 where one of weight 0 fills a gap; the first joins particles i and j."""

    i: int
    j: int
    source: np.ndarray


def choose_layout(batches: list[np.ndarray], count: int) -> Layout:
    """The cheapest layout for batches of (m, 2) pairs among ``count`` particles."""
    widths = _widths(np.concatenate(batches), count)
    start = max(SAMPLE, ROWS * max(widths[1:], default=1))
    sample = [pairs[pairs.min(axis=1) < start] for pairs in batches]
    most = int(max(pairs.max(initial=0) for pairs in sample)) + 1
    best, lowest = (count, 1, 1), math.inf
    for width in widths:
        for columns in CLASSES:
            for rows in CLASSES if width < count else (1,):
                slot = _layout(most, width, columns, rows).slot
                cost = float(sum(_cost(slot[pairs]) for pairs in sample))
                if cost < lowest:
                    best, lowest = (width, columns, rows), cost
    return _layout(count, *best)


def _widths(pairs: np.ndarray, count: int) -> list[int]:
    """Row widths that the frequent differences of indices suggest; ``count`` stands for a single row."""
    offsets, times = np.unique(np.abs(pairs[:, 1] - pairs[:, 0]), return_counts=True)
    frequent = offsets[np.argsort(-times, kind="stable")[:FREQUENT]]
    return [count] + sorted({int(width) for width in frequent if 2 < width < count})


def _layout(count: int, width: int, columns: int, rows: int) -> Layout:
    """Particles sorted by class, each class from a multiple of LANES on."""
    index = np.arange(count)
    group = (index // width % rows) * columns + index % width % columns
    sizes = np.bincount(group, minlength=rows * columns)
    starts = np.concatenate([[0], np.cumsum(-(-sizes // LANES) * LANES)])
    slot = np.empty(count, dtype=np.int64)
    slot[np.argsort(group, kind="stable")] = np.concatenate(
        [start + np.arange(size) for start, size in zip(starts, sizes, strict=False)]
    )
    return Layout(slot, int(starts[-1]))


def _sorted(placed: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(order, i, offset) of pairs (m, 2), by offset j - i > 0, then by i."""
    i, offset = placed.min(axis=1), np.abs(placed[:, 1] - placed[:, 0])
    order = np.lexsort((i, offset))
    return order, i[order], offset[order]


def _begins(i: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Where unbroken stretches begin in pairs sorted by (offset, i)."""
    step = np.diff(i)
    new = np.concatenate([[True], (np.diff(offset) != 0) | (step > WIDEST_GAP + 1) | (step == 0)])
    return np.flatnonzero(new)


def _breaks(i: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Where runs begin: as `_begins`, and wherever a run would reach its own second particles."""
    begins: list[int] = _begins(i, offset).tolist()
    found = []
    for begin, end in itertools.pairwise([*begins, len(i)]):
        while begin < end:
            found.append(begin)
            begin = int(np.searchsorted(i[begin:end], i[begin] + offset[begin])) + begin
    return np.array(found, dtype=np.int64)


def _cost(placed: np.ndarray) -> float:
    if len(placed) == 0:
        return 0.0
    _, i, offset = _sorted(placed)
    begins = _begins(i, offset)
    ends = np.concatenate([begins[1:], [len(i)]]) - 1
    lengths, members = i[ends] - i[begins] + 1, ends - begins + 1
    parts = -(-lengths // offset[begins])
    is_long = lengths >= SHORTEST * parts
    return float(np.sum(np.where(is_long, lengths + RUN_COST * parts, SINGLE_COST * members)))


def split(batch: Distance, w: np.ndarray) -> list[Distance | DistanceRuns | UniformRuns]:
    """A bound batch whose particles stand in their slots, of inverse masses ``w``, in its fastest parts.

    They are: runs of equal constraints, other runs, and single pairs by colour.
    """
    pairs = batch.pairs.as_array(batch.size())
    runs, singles = _find_runs(pairs)
    uniform: list[Run] = []
    mixed: list[Run] = []
    if hasattr(batch.law, "of_run"):
        kinds = _kinds(batch, w, pairs)
        for run in runs:
            _sort_pieces(run, kinds, uniform, mixed)
    else:
        mixed = runs
    short = [run.source[run.source >= 0] for run in mixed if len(run.source) < SHORTEST]
    mixed = [run for run in mixed if len(run.source) >= SHORTEST]
    singles = np.sort(np.concatenate([singles, *short]))
    found: list[Any] = []
    if uniform:
        found.append(_in_uniform_runs(batch, w, uniform))
    if mixed:
        found.append(_in_runs(batch, mixed))
    if len(singles):
        singles = singles[np.lexsort((pairs[singles].min(axis=1), greedy_colours(pairs[singles])))]
        i, j = pairs[singles].T.astype(np.uint64)
        found.append(Distance(Pairs(i.copy(), j.copy()), batch.rest[singles], select(batch.law, singles)))
    return found


def _kinds(batch: Distance, w: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """(m,) a number for each constraint, equal for equal ones; -1 where its two particles differ in mass."""
    i, j = pairs.T
    values = [batch.rest, w[i], *(value for value in batch.law if isinstance(value, np.ndarray))]
    kinds = np.unique(np.column_stack(values), axis=0, return_inverse=True)[1].ravel()
    return np.where(w[i] == w[j], kinds, -1)


def _sort_pieces(run: Run, kinds: np.ndarray, uniform: list[Run], mixed: list[Run]) -> None:
    """Cut a run into long pieces of one kind, and what lies between them."""
    kind = np.where(run.source >= 0, kinds[run.source], -1)
    cuts = [0, *(np.flatnonzero(np.diff(kind)) + 1).tolist(), len(kind)]
    rest = 0
    for begin, end in itertools.pairwise(cuts):
        if end - begin >= LONG and kind[begin] >= 0:
            mixed += _trimmed(run, rest, begin)
            uniform += _trimmed(run, begin, end)
            rest = end
    mixed += _trimmed(run, rest, len(kind))


def _trimmed(run: Run, begin: int, end: int) -> list[Run]:
    """A piece of a run without gaps at its ends; none where nothing is left."""
    real = np.flatnonzero(run.source[begin:end] >= 0)
    if len(real) == 0:
        return []
    begin, end = begin + int(real[0]), begin + int(real[-1]) + 1
    return [Run(run.i + begin, run.j + begin, run.source[begin:end])]


def _find_runs(placed: np.ndarray) -> tuple[list[Run], np.ndarray]:
    """(runs, indices of the pairs in none); runs in the order of their first constraints as given."""
    order, i, offset = _sorted(placed)
    begins = _breaks(i, offset)
    runs, rest = [], [np.zeros(0, dtype=np.int64)]
    for begin, end in zip(begins, [*begins[1:], len(i)], strict=True):
        length = int(i[end - 1] - i[begin] + 1)
        if length < SHORTEST:
            rest.append(order[begin:end])
            continue
        source = np.full(length, -1, dtype=np.int64)
        source[i[begin:end] - i[begin]] = order[begin:end]
        runs.append(Run(int(i[begin]), int(i[begin] + offset[begin]), source))
    runs.sort(key=lambda run: int(run.source[0]))
    return runs, np.sort(np.concatenate(rest))


def _joined(runs: list[Run]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(i, j, start, source) of a batch of runs: constraint c of run r joins particles i[r] + c and j[r] + c."""
    source = np.concatenate([run.source for run in runs])
    start = np.concatenate([[0], np.cumsum([len(run.source) for run in runs])])
    first = np.array([(run.i, run.j) for run in runs])
    i, j = (first - start[:-1, None]).T.astype(np.uint64)  # modulo 2^64
    return i.copy(), j.copy(), start.astype(np.uint64), source


def _in_runs(batch: Distance, runs: list[Run]) -> DistanceRuns:
    """The constraints in the order of the runs; those of weight 0 have rest length 1 and factor 0."""
    i, j, start, source = _joined(runs)
    rest = np.where(source >= 0, batch.rest[source], 1.0)
    return DistanceRuns(i, j, start, source, int(np.sum(source >= 0)), rest, select(batch.law, source))


def _in_uniform_runs(batch: Distance, w: np.ndarray, runs: list[Run]) -> UniformRuns:
    """The constraints in the order of the runs, with one number for each run."""
    i, j, start, source = _joined(runs)
    first = np.array([run.source[0] for run in runs])
    law = select(batch.law, first)
    masses: Any = w[np.array([run.i for run in runs])]
    if hasattr(law, "multiplier"):
        law = law._replace(multiplier=np.zeros(len(source)))
    else:
        law, masses = law._replace(factor=law.factor * masses), One(1.0)
    return UniformRuns(i, j, start, source, batch.rest[first], masses, law)


def select(law: Any, source: np.ndarray) -> Any:
    """A kernel's law for the constraints ``source``; where that is -1 all of its arrays are 0."""
    picked = [np.where(source >= 0, value[source], 0.0) if isinstance(value, np.ndarray) else value for value in law]
    return type(law)(*picked)


def greedy_colours(pairs: np.ndarray) -> np.ndarray:
    """(m,) colours of constraints such that no two of a colour share a particle: the lowest free one for each."""
    used: dict[int, int] = {}
    colours = np.empty(len(pairs), dtype=np.int64)
    for c, (i, j) in enumerate(pairs.tolist()):
        taken = used.get(i, 0) | used.get(j, 0)
        free = ~taken & (taken + 1)
        colours[c] = free.bit_length() - 1
        used[i], used[j] = used.get(i, 0) | free, used.get(j, 0) | free
    return colours
