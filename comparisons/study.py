"""What a study gives back: records, the series drawn from them, fits and sentences. Round-trips through JSON."""

from __future__ import annotations

import dataclasses
import math
import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msgspec

from comparisons import engine as engines
from comparisons.film import Film
from comparisons.fit import Fit
from comparisons.record import SCHEMA, Record
from pbd.errors import InvalidInput, unknown

PACKAGES = (
    "pbdbench",
    "numpy",
    "scipy",
    "numba",
    "llvmlite",
    "pymunk",
    "pybullet",
    "mujoco-core",
    "pypbd",
    "matplotlib",
)


class Head(msgspec.Struct, frozen=True, kw_only=True):
    """Where records come from."""

    schema: int = SCHEMA
    commit: str = ""
    dirty: bool = False
    machine: str = ""
    python: str = ""
    packages: dict[str, str] = {}


class Panel(msgspec.Struct, frozen=True, kw_only=True):
    """One pair of axes; labels carry the units. Both are logarithmic unless ``linear``; y starts at ``lowest``.

    rows : where there are some, y is the number of a row, which bears that name, and ``lowest`` is where x starts
    """

    name: str
    title: str
    x: str
    y: str
    lowest: float = 0.0
    linear: bool = False
    rows: list[str] = []


class Series(msgspec.Struct, frozen=True, kw_only=True):
    """Points of one engine and setting in one panel, or a closed form (``engine`` empty).

    kind : "measured"; "curve", without markers; "experiment", markers alone; "front", the best of an engine;
        "points", all settings that were tried; "trade", a setting, where less is better on both axes; "lost", where a
        line of an engine ends; "held" and "failed", points of a map; "closed form"; "bound", a limit in closed form
    """

    panel: str
    label: str
    engine: str
    x: list[float]
    y: list[float]
    method: str = ""
    preset: str = ""
    kind: str = "measured"
    fit: Fit | None = None


class Omission(msgspec.Struct, frozen=True):
    """An engine that is not in a plot, why, and what would bring it in."""

    engine: str
    reason: str
    remedy: str


class Winner(msgspec.Struct, frozen=True, kw_only=True):
    """Who reaches an error first: engine "" where none does within the budget.

    seconds : engine -> time of its fastest run that is good enough [s]
    setting : the winner's settings, in words
    unit : of the error that is to be reached; "1" of a relative one
    """

    target: float
    engine: str
    setting: str
    seconds: dict[str, float]
    unit: str = "m"


class Table(msgspec.Struct, frozen=True, kw_only=True):
    """Results in words and numbers: a title, the columns' headings, the rows."""

    title: str
    columns: list[str]
    rows: list[list[str]]

    def text(self) -> str:
        """The table as aligned text under its title."""
        return f"{self.title}\n{aligned([self.columns, *self.rows])}"


class Study(msgspec.Struct, frozen=True, kw_only=True):
    """A finished study; ``subject`` is its scene in a few words."""

    kind: str
    title: str
    subject: str
    scene: str
    parameters: dict
    head: Head
    panels: list[Panel]
    series: list[Series]
    records: list[Record]
    omissions: list[Omission] = []
    sentences: list[str] = []
    winners: list[Winner] = []
    tables: list[Table] = []
    films: list[Film] = []

    def fit(
        self, engine: str, *, panel: str | None = None, method: str | None = None, preset: str | None = None
    ) -> Fit:
        """The fit of the first series of ``engine`` that matches; raises `InvalidInput` where there is none."""
        fits = [s for s in self.series if s.fit is not None]
        wanted = {"panel": panel, "method": method, "preset": preset}
        for series in fits:
            if series.engine == engine and all(v in (None, getattr(series, k)) for k, v in wanted.items()):
                assert series.fit is not None
                return series.fit
        if engine not in {s.engine for s in fits}:
            raise unknown("engine", engine, {s.engine for s in fits})
        given = {k: v for k, v in wanted.items() if v is not None}
        raise InvalidInput("series", given, "one that this study measured")

    def order(self, engine: str, **which: str) -> float:
        """The fitted order of `fit`; nan where too few levels are asymptotic."""
        order = self.fit(engine, **which).order
        return math.nan if order is None else order

    def table(self) -> str:
        """The study's tables, if it has any, or else its records, as aligned text."""
        return "\n\n".join(table.text() for table in self.tables) or self.record_table()

    def record_table(self) -> str:
        """All records as aligned text, one a line."""
        names = sorted({name for record in self.records for name in record.metrics})
        header = ["engine", "variant", "dt [s]", "steps", "status", *names, "time [s]"]
        return aligned([header, *(_row(record, names) for record in self.records)])

    def to_json(self, path: str | Path) -> None:
        """Write the study; an existing file is replaced at once, never rewritten in place."""
        write_atomically(Path(path), msgspec.json.format(msgspec.json.encode(self), indent=1))

    def plot(self, path: str | Path) -> None:
        """Draw the study into ``path``; the ending is the format: .png or .svg, .gif for its films."""
        from reports.figures import draw  # the drawing package is loaded only when a plot is asked for

        draw(self, Path(path))

    def plot_moments(self, path: str | Path) -> None:
        """Draw the moments of the study's films as stills into ``path``, a .png; nothing where they have none."""
        from reports.animation import moments

        if self.films and self.films[0].moments:
            moments(self.films, Path(path))


class Chapter(msgspec.Struct, frozen=True, kw_only=True):
    """Studies that a report shows together: one figure for each panel they share, or one for a single study."""

    heading: str
    caption: str
    studies: list[Study]


def from_json(path: str | Path) -> Study:
    """Read a study that `Study.to_json` wrote; `InvalidInput` for anything else."""
    try:
        study = msgspec.json.decode(Path(path).read_bytes(), type=Study)
    except (OSError, msgspec.DecodeError) as error:
        raise InvalidInput(str(path), type(error).__name__, "a study written by to_json", str(error)) from None
    if study.head.schema != SCHEMA:
        raise InvalidInput(f"{path}: schema", study.head.schema, f"{SCHEMA}", "write it anew with this version")
    return study


def write_atomically(path: Path, content: bytes) -> None:
    """Write beside ``path`` and move into place."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        partial.write_bytes(content)
        partial.replace(path)
    except OSError:
        partial.unlink(missing_ok=True)
        raise


def variant(record: Record) -> str:
    """A record's settings beside dt: in the adapter's words, or the preset and what departs from it."""
    adapter = engines.load(record.engine)
    if hasattr(adapter, "describe"):
        return str(adapter.describe(adapter.Settings(**record.settings)))
    usual = dataclasses.asdict(engines.make_settings(record.engine, record.preset, {}))
    changed = {k: v for k, v in record.settings.items() if k != "dt" and v != usual[k]}
    return " ".join(
        [record.preset, *(f"{k}={v:g}" if isinstance(v, float) else f"{k}={v}" for k, v in changed.items())]
    )


def label(record: Record) -> str:
    """How a line of such records is named: engine and settings."""
    adapter = engines.load(record.engine)
    return variant(record) if hasattr(adapter, "describe") else f"{adapter.TITLE}, {variant(record)}"


def aligned(rows: list[list[str]]) -> str:
    """Rows of equally many cells as text with columns below each other."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)


def duration(seconds: float) -> str:
    """A time in its natural unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def head() -> Head:
    """The present commit, machine and versions."""
    root = Path(__file__).resolve().parent.parent
    packages = {}
    for name in PACKAGES:
        try:
            packages[name] = version(name)
        except PackageNotFoundError:
            packages[name] = "absent"
    machine = f"{_processor()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}"
    commit = _git(root, "rev-parse", "--short", "HEAD")
    return Head(
        commit=commit,
        dirty=bool(commit and _git(root, "status", "--porcelain")),
        machine=machine,
        python=platform.python_version(),
        packages=packages,
    )


def _git(root: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown processor"
    return next(
        (line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown processor"
    )


def _row(record: Record, names: list[str]) -> list[str]:
    dt = "" if record.dt is None else f"{record.dt:.4g}"
    values = [f"{record.metric(name):.3e}" if math.isfinite(record.metric(name)) else "-" for name in names]
    seconds = f"{record.seconds.min:.3e}" if record.seconds else "-"
    return [record.engine, variant(record), dt, str(record.steps), record.status.code, *values, seconds]
