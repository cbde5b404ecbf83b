"""Panels with a named row for each question and a marker for each answer, on one logarithmic axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from comparisons.study import Panel, Series, Study
from reports.style import RC, marker

NAMES, WIDTH, ROW = 2.6, 2.75, 0.31
"""Inches: what the rows' names take, the width of a panel, the height of a row."""

ABOVE, BELOW, LEGEND_ROW, LEGEND_COLUMNS = 0.75, 0.6, 0.26, 4
MOST = 10.0
"""Errors beyond are drawn there: an engine that far off has failed."""

SIZE = 6.5


def figure(cells: Sequence[tuple[Study, Panel]], title: str) -> Figure:
    """Panels beside each other, of the same rows; the legend below."""
    rows = cells[0][1].rows
    groups = [[s for s in study.series if s.panel == panel.name] for study, panel in cells]
    labels = list(dict.fromkeys(series.label for group in groups for series in group))
    width = NAMES + WIDTH * len(cells) + 0.15
    below = BELOW + LEGEND_ROW * (-(-len(labels) // LEGEND_COLUMNS))
    height = ABOVE + ROW * len(rows) + below
    with matplotlib.rc_context(RC):
        drawn = Figure(figsize=(width, height))
        axes = drawn.subplots(1, len(cells), sharey=True, squeeze=False)[0]
        drawn.subplots_adjust(
            left=NAMES / width, right=1.0 - 0.15 / width, bottom=below / height, top=1.0 - ABOVE / height, wspace=0.1
        )
        handles: dict[str, Any] = {}
        for ax, (_, panel), group in zip(axes, cells, groups, strict=True):
            handles.update(_panel(ax, panel, group))
        drawn.suptitle(title, fontsize=13, fontweight="bold", x=0.01, ha="left")
        drawn.legend(
            [handles[label] for label in labels],
            labels,
            loc="lower left",
            bbox_to_anchor=(0.01, 0.0),
            ncols=LEGEND_COLUMNS,
            frameon=False,
            columnspacing=1.2,
            handletextpad=0.2,
        )
    return drawn


def _panel(ax: Axes, panel: Panel, group: Sequence[Series]) -> dict[str, Any]:
    """Draw one panel, its first row on top; returns label -> artist for the legend."""
    ax.set(xscale="log", xlim=(panel.lowest / 3.0, 3.0 * MOST), xlabel=panel.x, title=panel.title)
    ax.set_ylim(len(panel.rows) - 0.5, -0.5)
    ax.set_yticks(range(len(panel.rows)), panel.rows, fontsize=10)
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")
    ax.xaxis.set_major_locator(LogLocator(base=1e4, numticks=7))
    ax.xaxis.set_minor_locator(NullLocator())
    for k in range(0, len(panel.rows), 2):
        ax.axhspan(k - 0.5, k + 0.5, color="#f1f1f1", zorder=0)
    found = {}
    for rank, series in enumerate(group):
        xs = [min(max(x, panel.lowest), MOST) for x in series.x]
        (found[series.label],) = ax.plot(xs, series.y, zorder=20 - rank, clip_on=False, **marker(series, SIZE))
    return found
