"""A square cloth of point masses on massless links, pinned at an edge or its corners, released at rest.

Question: how fast does an engine enforce many links that compete, and how near does it come to the true
motion? Links run along the grid's edges, its diagonals and over two cells, which resists bending. With
``compliance`` 0 they are rigid, and more than the cloth has freedoms; else they are linear springs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from comparisons.scene import PointMasses, Rods, Scene, Springs
from pbd import fields
from pbd.errors import InvalidInput

QUESTION = "How near to its lengths and its true motion does a hanging cloth stay, and at what cost?"

MAX_SIZE = 1024
PINNED = {"corners": "two corners", "edge": "one edge", "none": "nothing"}


@dataclass(frozen=True)
class Parameters:
    """``size`` x ``size`` particles; the compliances of diagonals and two-cell links default to ``compliance``."""

    size: int = fields.whole(16, 2, MAX_SIZE, "particles along a side")
    side: float = fields.real(1.0, "m", 1e-6, 1e6, "side of the cloth at rest")
    density: float = fields.real(0.2, "kg/m^2", 0.0, 1e12, "mass of the cloth over its area at rest", above=True)
    lumping: str = fields.choice("equal", ("equal", "area"), "masses: all equal, or a quarter of each adjacent cell")
    diagonals: bool = fields.flag(True, "both diagonals of each cell, against shear")
    bending: str = fields.choice("two_cell", ("none", "two_cell"), "links over two cells, against bending")
    compliance: float = fields.real(0.0, "m/N", 0.0, 1e6, "of a link along a grid edge; 0 is rigid")
    diagonal_compliance: float | None = fields.real(None, "m/N", 0.0, 1e6, "of a diagonal", optional=True)
    bending_compliance: float | None = fields.real(None, "m/N", 0.0, 1e6, "of a two-cell link", optional=True)
    pinned: str = fields.choice("corners", tuple(PINNED), "what is pinned of the first row")
    start: str = fields.choice("horizontal", ("horizontal", "vertical"), "the cloth's plane at the start")
    stretch: float = fields.real(1.0, "1", 0.1, 10.0, "initial over rest length: of columns; of rows too, if unpinned")
    gravity: float = fields.real(9.81, "m/s^2", 0.0, 1e3, "downward acceleration")
    duration: float = fields.real(1.0, "s", 0.0, 1e5, "simulated time", above=True)
    samples: int = fields.whole(50, 1, 1_000_000, "equally spaced sample times after the start")

    def __post_init__(self) -> None:
        fields.check(self, "scene")
        compliances = [c for _, _, c in self.kinds()]
        if any(compliances) and not all(compliances):
            raise InvalidInput("scene.compliance", compliances, "0 for all kinds of links or > 0 for all")

    @property
    def cell(self) -> float:
        """The grid's spacing at rest [m]."""
        return self.side / (self.size - 1)

    def kinds(self) -> list[tuple[str, float, float]]:
        """(name, rest length [m], compliance [m/N]) of each kind of link, in the order of the scene's links."""
        shear, bend = (self.compliance if c is None else c for c in (self.diagonal_compliance, self.bending_compliance))
        found = [("rows", self.cell, self.compliance), ("columns", self.cell, self.compliance)]
        if self.diagonals:
            found.append(("diagonals", math.sqrt(2.0) * self.cell, shear))
        if self.bending == "two_cell":
            found.append(("two_cell", 2.0 * self.cell, bend))
        return found


def build(parameters: Parameters) -> Scene:
    """The cloth: particle row * size + column at (column, 0, row) or, vertical, (column, -row, 0) cells; y is up.

    All links are one object, in the order of ``Parameters.kinds``: an engine then needs one kind of batch
    whatever is switched on. The pinned particles are at rest distance, so rigid links can be met whatever the
    stretch.
    """
    masses, rigid = _masses(parameters), parameters.compliance == 0.0
    every = _pairs(parameters.size)
    pairs, lengths, compliances = [], [], []
    for kind, length, compliance in parameters.kinds():
        pairs.append(every[kind])
        lengths.append(np.full(len(every[kind]), length))
        compliances.append(np.full(len(every[kind]), compliance))
    joined, rest = np.concatenate(pairs), np.concatenate(lengths)
    size, what = parameters.size, "rigid" if rigid else "compliant"
    return Scene(
        name="hanging_cloth",
        title=f"{size} x {size} {what} cloth pinned at {PINNED[parameters.pinned]}, {parameters.duration:g} s",
        masses=masses,
        links=(Rods(joined, rest) if rigid else Springs(joined, rest, np.concatenate(compliances)),),
        gravity=np.array([0.0, -parameters.gravity, 0.0]),
        duration=parameters.duration,
        samples=parameters.samples,
        metrics=_metrics(parameters),
    )


def _masses(parameters: Parameters) -> PointMasses:
    """Equal masses, or each its share of the area: a half at an edge, a quarter at a corner."""
    size, cell = parameters.size, parameters.cell
    row, column = (index.ravel().astype(float) for index in np.indices((size, size)))
    across = parameters.stretch if parameters.pinned == "none" else 1.0
    x, down, flat = across * cell * column, parameters.stretch * cell * row, np.zeros(size * size)
    horizontal = parameters.start == "horizontal"
    positions = np.column_stack([x, flat, down] if horizontal else [x, -down, flat])
    share = np.ones(size)
    if parameters.lumping == "area":
        share[[0, -1]] = 0.5
    weight = np.outer(share, share).ravel()
    masses = parameters.density * parameters.side**2 * weight / weight.sum()
    pinned = {"corners": (0, size - 1), "edge": tuple(range(size)), "none": ()}[parameters.pinned]
    return PointMasses(positions, np.zeros_like(positions), masses, pinned)


def _pairs(size: int) -> dict[str, np.ndarray]:
    """Kind -> (m, 2) particles that its links join, row by row."""
    grid = np.arange(size * size).reshape(size, size)

    def joined(*ends: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        return np.concatenate([np.column_stack([one.ravel(), other.ravel()]) for one, other in ends])

    return {
        "rows": joined((grid[:, :-1], grid[:, 1:])),
        "columns": joined((grid[:-1], grid[1:])),
        "diagonals": joined((grid[:-1, :-1], grid[1:, 1:]), (grid[:-1, 1:], grid[1:, :-1])),
        "two_cell": joined((grid[:, :-2], grid[:, 2:]), (grid[:-2], grid[2:])),
    }


def _metrics(parameters: Parameters) -> tuple[str, ...]:
    """A rigid cloth has no reference motion, and one that starts stretched no meaningful energy."""
    if parameters.compliance > 0.0:
        return ("position_error", "energy_drift")
    return ("link_violation", "energy_drift") if parameters.stretch == 1.0 else ("link_residual",)
