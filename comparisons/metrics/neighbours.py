"""How many neighbours a particle of a fluid has on average at the end: what a step's cost goes with."""

from __future__ import annotations

from comparisons.metrics import Subject, _water

UNIT = "1"
TITLE = "neighbours"


def measure(subject: Subject) -> float:
    """Particles within 2.5 spacings, in 3D 2, without the particle itself."""
    scene = subject.scene
    reach = _water.SUPPORT[len(scene.gravity)] * _water.fluid_of(scene).spacing
    return _water.neighbours(subject.trajectory.positions[-1], reach)
