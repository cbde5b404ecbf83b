"""What is known of the dam break: measured fronts and heights, and the front's numerical reference.

Sources stand in the files themselves, `comparisons/data`. Fronts are Z = front/a over T = t sqrt(n^2 g/a), heights
H = height/(n^2 a) over tau = t sqrt(g/a), with the column's width a and height n^2 a, for n^2 = 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib import resources

import numpy as np

TABLE_2 = "martin_moyce_n2_2_table2.csv"
"""The file of the fronts to which fits are made."""

FRONTS = {
    "Martin and Moyce, table 2": TABLE_2,
    "Martin and Moyce, fig. 3": "martin_moyce_n2_2_fig3_a2250.csv",
    "Koshizuka and Oka": "koshizuka_oka_1996.csv",
}
"""Experiment -> its file."""

HEIGHTS = {"Martin and Moyce, table 6": "martin_moyce_n2_2_height_table6.csv"}
REFERENCE = "dam_break_front.csv"


@dataclass(frozen=True)
class FrontReference:
    """Front over time in the limit of fine particles, (m,) each: T, Z, and the gap between the limits of two methods.

    The values are their mean; ``uncertainty`` is the gap.
    """

    times: np.ndarray
    values: np.ndarray
    uncertainty: np.ndarray


@lru_cache
def experiment(file: str) -> np.ndarray:
    """(m, 2) measured times and values of a file of `FRONTS` or `HEIGHTS`."""
    return _table(file)


@lru_cache
def front_reference() -> FrontReference:
    """The numerical reference; ``pbdbench front_reference`` computes it anew."""
    times, values, uncertainty = _table(REFERENCE)[:, :3].T
    return FrontReference(times, values, uncertainty)


def ritter(times: np.ndarray) -> np.ndarray:
    """Z of the front on a dry bed by shallow water theory, x = a + 2 sqrt(g H) t: an upper bound (Ritter 1892)."""
    return 1.0 + 2.0 * np.asarray(times)


def _table(file: str) -> np.ndarray:
    text = (resources.files("comparisons") / "data" / file).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
