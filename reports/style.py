"""How everything is drawn: one colour per engine, in every figure (Okabe and Ito's colour-blind safe set)."""

from __future__ import annotations

from typing import Any

from comparisons.study import Series

COLOURS = {
    "pbd": "#0072B2",
    "symplectic_euler": "#E69F00",
    "pybullet": "#009E73",
    "pymunk": "#D55E00",
    "mujoco": "#56B4E9",
    "pypbd": "#CC79A7",
    "shake": "#5D3A9B",
    "dop853": "#444444",
    "rattle": "#000000",
    "particle_boxes": "#882255",
    "pbf": "#004D80",
}
TITLES = {
    "pbd": "PBD",
    "symplectic_euler": "symplectic Euler",
    "pybullet": "pybullet",
    "pymunk": "pymunk",
    "mujoco": "MuJoCo",
    "pypbd": "pyPBD",
    "shake": "SHAKE",
    "dop853": "DOP853",
    "rattle": "RATTLE contacts",
    "particle_boxes": "PBD particle boxes",
    "pbf": "PBF",
    "": "none in the budget",
}
OTHER = "#8C564B"
SHAPES = {"rattle": "D", "particle_boxes": "o", "pybullet": "s", "pymunk": "^", "mujoco": "v", "symplectic_euler": "P"}
"""Markers of the engines of rigid bodies where points of several of them are strewn over one panel."""

CHEAPER = ("default", "fast")
"""Presets whose markers are hollow beside another of the same engine."""

CLOSED_FORM = "#999999"
BY_KIND = {"closed form": CLOSED_FORM, "bound": CLOSED_FORM, "held": "#0072B2", "failed": "#D55E00"}
UNLINED = ("points", "lost", "experiment", "held", "failed")
"""Kinds of series that are markers alone."""

LINES = ("-", "--", ":", "-.")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")

RC: dict[Any, Any] = {
    "font.size": 11,
    "axes.titlesize": 12,
    "axes.labelsize": 11,
    "legend.fontsize": 9.5,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "pbdbench",
    "svg.fonttype": "none",
    "figure.facecolor": "white",
}


def colour(series: Series) -> str:
    """The engine's colour; grey for closed forms, and in a map one for each outcome."""
    return BY_KIND.get(series.kind) or COLOURS.get(series.engine, OTHER)


def looks(group: list[Series]) -> dict[str, dict]:
    """label -> how it is drawn: marker and dashes differ within an engine, width and size between engines.

    Engines drawn later are thinner, so that a line under another one still shows.
    """
    ranks: dict[str, int] = {}
    found: dict[str, dict] = {}
    for series in group:
        if series.label in found or series.kind in UNLINED:
            continue
        rank = ranks[series.engine] = ranks.get(series.engine, -1) + 1
        thickness = max(1.2, 2.4 - 0.3 * list(ranks).index(series.engine))
        found[series.label] = {
            "linestyle": LINES[rank % len(LINES)],
            "marker": MARKERS[rank % len(MARKERS)],
            "linewidth": thickness,
            "markersize": 2.0 + 1.7 * thickness,
        }
        if series.kind == "curve":
            found[series.label].update(marker="none")
        if series.kind == "bound":
            found[series.label] = {"linestyle": "--", "linewidth": 1.5, "zorder": 1}
        if series.kind == "closed form":
            found[series.label] = {"linestyle": "-", "linewidth": 7.0, "alpha": 0.35, "zorder": 1}
    return found


def marker(series: Series, size: float) -> dict[str, Any]:
    """Of a point among those of other engines: a shape and a colour for each, hollow at a cheaper preset."""
    shade = colour(series)
    return {
        "linestyle": "none",
        "marker": SHAPES.get(series.engine, "X"),
        "color": shade,
        "markerfacecolor": "white" if series.preset in CHEAPER else shade,
        "markersize": size,
        "markeredgewidth": 1.3,
    }
