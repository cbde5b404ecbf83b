"""The passes over a fluid's particles, by number, as `pbd.team` asks for them; see `pbd.fluid.density.Density.work`.

Each needs the one before finished, and writes nothing that another piece of it reads.
"""

from __future__ import annotations

HOLD, PLACE, GATHER, LIST, MULTIPLIERS, PUSHES, MOVES, FETCH, DRAG, CURL, SPIN = range(11)
"""Out of walls, to the cells, positions in sorted order, who is near walls and what is kept by particle; an iteration's
three; positions and velocities after the step in sorted order, viscosity, and confinement's two."""
