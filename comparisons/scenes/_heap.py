"""Boxes, and some balls, of random size and angle in the cells of a loose grid, about to fall on a heap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparisons.bodies import Ball, Bodies, Box, at_rest

SPREAD = 0.2
"""Edges are within this fraction of the mean."""

ROOM = 1.05
"""A cell is this much larger than the largest body's diagonal, so none touch at the start."""


@dataclass(frozen=True)
class Heap:
    """``count`` bodies of mean edge ``size`` [m]; one of ``mass`` [kg] has that edge, all have its density."""

    count: int
    dimension: int
    size: float
    mass: float
    columns: int
    balls: float = 0.0
    """The fraction of them that are balls, about."""

    @property
    def cell(self) -> float:
        """Distance of the grid's points [m]."""
        return ROOM * (1.0 + SPREAD) * self.size * np.sqrt(self.dimension)

    @property
    def width(self) -> float:
        """Of the grid [m], in 3D along x and z."""
        return self.columns * self.cell

    def bodies(self, seed: int) -> Bodies:
        """At rest, the lowest row just above y = 0, the grid about the y axis."""
        random = np.random.default_rng(seed)
        shapes = tuple(self._shape(random) for _ in range(self.count))
        masses = np.array([self.mass * _volume(shape) / self.size**self.dimension for shape in shapes])
        return at_rest(shapes, masses, self._places(), orientations=self._orientations(random))

    def _shape(self, random: np.random.Generator) -> Box | Ball:
        edges = self.size * random.uniform(1.0 - SPREAD, 1.0 + SPREAD, self.dimension)
        if random.uniform() < self.balls:
            return Ball(float(edges[0]) / 2.0, self.dimension)
        return Box(tuple(float(edge) for edge in edges))

    def _places(self) -> np.ndarray:
        """(n, d) row by row from below; z varies slower than x, y slowest."""
        index = np.arange(self.count)
        places = np.empty((self.count, self.dimension))
        for along in (0, 2)[: self.dimension - 1]:
            places[:, along] = index % self.columns - (self.columns - 1) / 2.0
            index = index // self.columns
        places[:, 1] = index + 0.5
        return self.cell * places

    def _orientations(self, random: np.random.Generator) -> np.ndarray:
        if self.dimension == 2:
            return random.uniform(-np.pi, np.pi, self.count)
        turns = random.standard_normal((self.count, 4))
        return turns / np.linalg.norm(turns, axis=1)[:, None]


def columns(count: int, dimension: int, height: float = 1.0) -> int:
    """As many as make a grid about ``height`` times as high as it is wide."""
    return int(np.ceil((count / height) ** (1.0 / dimension) - 1e-9))


def _volume(shape: Box | Ball) -> float:
    if isinstance(shape, Box):
        return float(np.prod(shape.size))
    return float(np.pi * shape.radius**2 if shape.dimension == 2 else 4.0 / 3.0 * np.pi * shape.radius**3)
