"""How much deeper or higher than by Archimedes' law a box floats, in spacings of the particles."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import Refused, Subject, _water

UNIT = "spacing"
TITLE = "error of the floating depth"


def measure(subject: Subject) -> float:
    """abs of the mean over the last quarter of the samples of depth under water less what belongs there.

    The level of the water follows from its volume and that of the box below it: with V of water in a tank of area W, a
    box of area A whose lowest face is at y has a depth s = V/W + s A/W - y.
    """
    scene, x = subject.scene, subject.trajectory.positions
    fluid, known = _water.fluid_of(scene), scene.known
    if not fluid.solids or scene.planes is None or "edge" not in known:
        raise Refused("floating depth in a scene where nothing floats", "ask for other metrics")
    d, count = len(scene.gravity), int(_water.liquid(scene).sum())
    sizes = -scene.planes.offsets[scene.planes.offsets < 0.0]
    area, own = float(np.prod(sizes)), known["edge"] ** (d - 1)
    late = x[-max(1, len(x) // 4) :]
    lowest = late[:, fluid.solids[0], 1].mean(axis=1) - 0.5 * known["edge"]
    depth = (count * fluid.spacing**d / area - lowest) / (1.0 - own / area)
    return float(abs(depth.mean() - known["submerged"]) / fluid.spacing)
