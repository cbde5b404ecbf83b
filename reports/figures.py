"""Figures of studies: log-log panels on shared axes, slope triangles, one legend."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator, ScalarFormatter

from comparisons.study import Panel, Series, Study
from pbd.errors import InvalidInput
from reports import animation, dots
from reports.style import MARKERS, RC, colour, looks, marker

FORMATS = ("png", "svg")
DPI = 130

PANEL = (4.3, 3.3)
"""Width and height [inches] that one pair of axes takes."""

MANY_DECADES = 1e5
"""Ratio of the ends of an axis beyond which minor ticks are only noise."""

ROOM = 30.0
"""Ratio of the ends of a horizontal axis on which labels at 1, 2 and 5 still stand apart."""

LEGEND = 2.4
"""Width [inches] of the legend."""

LETTERS = 26
"""Of the legend, that fit into a line of it."""

LOST: dict[str, Any] = {"marker": "x", "markersize": 7, "markeredgewidth": 2.2, "zorder": 5}
EXPERIMENT: dict[str, Any] = {
    "linestyle": "none", "color": "black", "markerfacecolor": "white", "markersize": 6, "zorder": 6
}  # fmt: skip
MAP: dict[str, dict[str, Any]] = {
    "held": {"linestyle": "none", "marker": "o", "markersize": 6},
    "failed": {"linestyle": "none", "marker": "x", "markersize": 7, "markeredgewidth": 2.0},
}
"""Of points of a map."""

TRADE = 8.0
"""Size of a marker that stands alone."""

Cell = tuple[Study, str, str]
"""A study, the name of its panel, the heading."""


def draw(study: Study, path: Path) -> None:
    """All panels of one study into ``path``, whose ending is the format; .gif is for its films."""
    if path.suffix == ".gif":
        animation.write(study.films, path)
        return
    if path.suffix.lstrip(".") not in FORMATS:
        raise InvalidInput("path", str(path), "a file name that ends in " + " or ".join("." + f for f in FORMATS))
    cells = [(study, panel.name, panel.title) for panel in study.panels]
    save(grid(cells, study.title, columns=min(2, len(cells))), path)


def save(figure: Figure, path: Path) -> None:
    """Write a figure; the path's ending is the format."""
    path.parent.mkdir(parents=True, exist_ok=True)
    undated = {"Date": None} if path.suffix == ".svg" else {}
    with matplotlib.rc_context(RC):
        figure.savefig(path, dpi=DPI, metadata=undated)


def grid(cells: Sequence[Cell], title: str, columns: int) -> Figure:
    """Panels in rows of ``columns``.

    Panels with the same axis labels share their ranges. One legend stands on the right, unless each panel
    is about one engine's settings: then each has its own. Panels with named rows stand beside each other.
    """
    if cells and all(_panel_of(cell).rows for cell in cells):
        return dots.figure([(cell[0], _panel_of(cell)) for cell in cells], title)
    rows = math.ceil(len(cells) / columns)
    own_legends = all(study.kind == "settings" for study, _, _ in cells)
    groups = [_group(cell) for cell in cells]
    with matplotlib.rc_context(RC):
        figure, axes = _canvas(rows, columns, *((0.0, 1.6) if own_legends else (LEGEND, 0.0)))
        handles: dict[str, Any] = {}
        styles = looks([series for group in groups for series in group])
        for ax, cell, group in zip(axes, cells, groups, strict=False):
            if own_legends:
                styles = looks(group)
            artists = _panel(ax, _panel_of(cell), group, styles, cell[2])
            handles |= {label: artist for label, artist in artists.items() if label not in handles}
            if own_legends and artists:
                corner = (-0.05, -0.2)
                ax.legend(
                    artists.values(), artists.keys(), frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=corner
                )
        _share_ranges(axes, cells)
        for ax, group in zip(axes, groups, strict=False):
            _triangles(ax, group)
        for ax in axes[len(cells) :]:
            ax.remove()
        figure.suptitle(title, fontsize=13, fontweight="bold", x=0.01, ha="left")
        if not own_legends:
            handles = dict(sorted(handles.items(), key=lambda item: item[1].get_linestyle() == "None"))
            place = (1.0 - LEGEND / figure.get_figwidth(), 1.0 - 0.5 / figure.get_figheight())
            labels = [textwrap.fill(label, LETTERS) for label in handles]
            figure.legend(handles.values(), labels, loc="upper left", bbox_to_anchor=place, frameon=False)
    return figure


def _canvas(rows: int, columns: int, right: float, below: float) -> tuple[Figure, Any]:
    """Axes on margins fixed in inches, which takes no time to lay out.

    ``right`` is left free beside all axes, ``below`` under each.
    """
    width, height = PANEL[0] * columns + right, (PANEL[1] + below) * rows + 0.4
    figure = Figure(figsize=(width, height))
    figure.subplots_adjust(
        left=0.85 / width,
        right=1.0 - (right + 0.1) / width,
        bottom=(0.55 + below) / height,
        top=1.0 - 0.7 / height,
        wspace=0.3,
        hspace=0.38 + below / (PANEL[1] - 0.9),
    )
    return figure, figure.subplots(rows, columns, squeeze=False).flatten()


def _group(cell: Cell) -> list[Series]:
    study, name, _ = cell
    return [series for series in study.series if series.panel == name]


def _panel_of(cell: Cell) -> Panel:
    return next(panel for panel in cell[0].panels if panel.name == cell[1])


def _panel(ax: Axes, panel: Panel, group: list[Series], styles: dict[str, dict], heading: str) -> dict[str, Any]:
    """Draw the series of one panel; returns label -> artist for the legend."""
    scale = "linear" if panel.linear else "log"
    ax.set(xscale=scale, yscale=scale, xlabel=panel.x, ylabel=panel.y, title=heading)
    handles: dict[str, Any] = {}
    lost: dict[str, Any] = {}
    shapes = iter(MARKERS)
    for series in group:
        if series.kind == "points":
            ax.plot(series.x, series.y, ".", color=colour(series), alpha=0.3, markersize=4, zorder=1)
        elif series.kind == "lost":
            ax.plot(series.x, series.y, color=colour(series), linestyle=":", markevery=[-1], **LOST)
            shade = "#666666" if series.x[1:] else colour(series)
            lost[series.label] = Line2D([], [], color=shade, linestyle="none", **LOST)
        elif series.kind == "experiment":
            (handles[series.label],) = ax.plot(series.x, series.y, marker=next(shapes), **EXPERIMENT)
        elif series.kind in MAP:
            (handles[series.label],) = ax.plot(series.x, series.y, color=colour(series), **MAP[series.kind])
        elif series.kind == "trade":
            (handles[series.label],) = ax.plot(series.x, series.y, **marker(series, TRADE))
        elif series.x:
            (handles[series.label],) = ax.plot(series.x, series.y, color=colour(series), **styles[series.label])
    if any(series.kind in ("front", "trade") for series in group):
        arrow = {"arrowstyle": "->", "color": "#666666"}
        ax.annotate("better", (0.03, 0.03), (0.2, 0.14), xycoords="axes fraction", color="#666666", arrowprops=arrow)
    return handles | lost


def _share_ranges(axes: Iterable[Axes], cells: Sequence[Cell]) -> None:
    """Give panels with equal axis labels equal ranges, so that the eye may compare them."""
    drawn = [(ax, _panel_of(cell)) for ax, cell in zip(axes, cells, strict=False) if ax.lines]
    placed = [(ax, panel) for ax, panel in drawn if not panel.linear]
    for axis in ("x", "y"):
        for label in {getattr(panel, axis) for _, panel in placed}:
            alike = [(ax, panel) for ax, panel in placed if getattr(panel, axis) == label]
            limits = [getattr(ax, f"get_{axis}lim")() for ax, _ in alike]
            floor = max(panel.lowest for _, panel in alike) if axis == "y" else 0.0
            low, high = max(floor, min(limit[0] for limit in limits)), max(limit[1] for limit in limits)
            for ax, _ in alike:
                getattr(ax, f"set_{axis}lim")(low, high)
                _ticks(getattr(ax, f"{axis}axis"), high / low)


def _ticks(axis: Any, ratio: float) -> None:
    """Decades where there are several, else 1, 2, 5, or equal distances, as plain numbers."""
    if ratio > (ROOM if axis.axis_name == "x" else 100.0):
        axis.set_major_locator(LogLocator(numticks=7))
        axis.set_minor_locator(NullLocator() if ratio > MANY_DECADES else LogLocator(subs="auto"))
    elif ratio > 5.0:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    else:
        axis.set_major_locator(MaxNLocator(5))
        axis.set_major_formatter(ScalarFormatter())
    axis.set_minor_formatter(NullFormatter())


def _triangles(ax: Axes, group: list[Series]) -> None:
    """A slope triangle for each whole order that was fitted, in the lower corner that the lines leave free."""
    fitted = [series for series in group if series.fit and series.fit.order]
    orders = sorted({round(s.fit.order) for s in fitted if s.fit and s.fit.order and s.fit.order > 0.5})
    if not orders:
        return
    falls = dict(zip(fitted[0].x, fitted[0].y, strict=True))
    is_falling = falls[max(falls)] < falls[min(falls)]
    decades = math.log10(ax.get_xlim()[1] / ax.get_xlim()[0]) / math.log10(ax.get_ylim()[1] / ax.get_ylim()[0])
    width, low = 0.1, 0.1
    for place, order in enumerate(reversed(orders)):
        left = 0.05 + 0.16 * place if is_falling else 0.87 - 0.16 * place
        height = order * width * decades
        tip = left if is_falling else left + width
        corners = [(left, low), (left + width, low), (tip, low + height), (left, low)]
        ax.plot(*zip(*corners, strict=True), color="black", linewidth=1.0, transform=ax.transAxes)
        ax.text(
            left + width / 2, low - 0.02, f"order {order}", ha="center", va="top", fontsize=8, transform=ax.transAxes
        )
