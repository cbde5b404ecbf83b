"""Links between point masses as sparse linear algebra over the coordinates of what can move.

For a link c with ends i, j: difference e = x_i - x_j, length l = |e|, normal n = e / l. Then grad_i l = n,
grad_j l = -n, and the second derivative of l is (I - n n^T) / l, with the signs of the ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import SuperLU, splu

from comparisons.scene import PointMasses


@dataclass(frozen=True)
class Edges:
    """Lengths (m,) [m] and normals (m, d) of the links in one state."""

    lengths: np.ndarray
    normals: np.ndarray


class Network:
    """Point masses and the pairs (m, 2) of them that are linked; links between two pinned ends are left out.

    Attributes
    ----------
    kept : (m,) mask of the links with an end that can move
    free : (n,) mask of what can move
    inertia : (f d,) the mass of each free coordinate [kg]
    """

    def __init__(self, masses: PointMasses, pairs: np.ndarray) -> None:
        self.free = masses.free
        self.kept = self.free[pairs].any(axis=1)
        self.pairs, self.dimension = pairs[self.kept], masses.positions.shape[1]
        self.inertia = np.repeat(masses.masses[self.free], self.dimension)
        self._index = np.where(self.free, np.cumsum(self.free) - 1, -1)[self.pairs]
        link, end = np.nonzero(self._index >= 0)
        shape = (len(self.pairs), int(self.free.sum()))
        self._incidence = csr_array((1.0 - 2.0 * end, (link, self._index[link, end])), shape=shape)
        self._pattern()

    def edges(self, x: np.ndarray) -> Edges:
        """Lengths and normals of the links at positions (n, d)."""
        difference = x[self.pairs[:, 0]] - x[self.pairs[:, 1]]
        lengths = np.sqrt(np.sum(difference**2, axis=1))
        return Edges(lengths, difference / lengths[:, None])

    def pull(self, edges: Edges, tension: np.ndarray) -> np.ndarray:
        """(f d,) sum of tension_c grad l_c over the links."""
        return (self._incidence.T @ (tension[:, None] * edges.normals)).ravel()

    def moved(self, x: np.ndarray, step: np.ndarray) -> np.ndarray:
        """The positions (n, d) after a step (f d,) of the free coordinates."""
        result = x.copy()
        result[self.free] += step.reshape(-1, self.dimension)
        return result

    def hessian(self, edges: Edges, axial: np.ndarray, transverse: np.ndarray, diagonal: np.ndarray) -> csc_array:
        """sum of axial_c n n^T + transverse_c (I - n n^T) with the signs of the ends, plus a diagonal (f d,)."""
        along = edges.normals[:, :, None] * edges.normals[:, None, :]
        block = (axial - transverse)[:, None, None] * along + transverse[:, None, None] * np.eye(self.dimension)
        values = (np.array([1.0, 1.0, -1.0, -1.0])[:, None, None, None] * block).ravel()[self._within]
        data = np.bincount(self._place, np.concatenate([values, diagonal]), len(self._rows))
        return csc_array((data, self._rows, self._starts), shape=2 * (len(diagonal),))

    def _pattern(self) -> None:
        """Where each entry of the links' blocks, and of the diagonal, goes in the columns of the Hessian."""
        d, count = self.dimension, len(self.inertia)
        one, other = self._index.T
        rows, columns = np.stack([one, other, one, other]), np.stack([one, other, other, one])
        axis = np.arange(d)
        row = np.broadcast_to(rows[:, :, None, None] * d + axis[:, None], (4, len(one), d, d)).ravel()
        column = np.broadcast_to(columns[:, :, None, None] * d + axis, (4, len(one), d, d)).ravel()
        self._within = np.flatnonzero((row >= 0) & (column >= 0))
        key = np.concatenate([column[self._within] * count + row[self._within], np.arange(count) * (count + 1)])
        found, self._place = np.unique(key, return_inverse=True)
        self._rows = found % count
        self._starts = np.searchsorted(found, np.arange(count + 1) * count)


def factorise(matrix: csc_array) -> SuperLU | None:
    """L D L^T of a symmetric matrix, or None unless it is positive definite.

    SuperLU with pivots taken from the diagonal: rows and columns are permuted alike, so U = D L^T and its
    diagonal has the signs of the eigenvalues.
    """
    try:
        factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # exactly singular
        return None
    symmetric = np.array_equal(factor.perm_r, factor.perm_c)
    return factor if symmetric and np.all(factor.U.diagonal() > 0.0) else None
