"""Smoothing kernels W(r) with support h, in 2D and 3D.

    Wendland C2    W = s/h^d (1 - q)^4 (1 + 4 q),    grad W = -20 s/h^(d+2) (1 - q)^3 x,    s = 7/pi, 21/(2 pi)
    poly6          W = s/h^d (1 - q^2)^3,                                                  s = 4/pi, 315/(64 pi)
    with spiky     grad W = -3 s/h^(d+1) (1 - q)^2 x/|x|,                                  s = 10/pi, 15/pi

q = |x|/h, the constants s for d = 2, 3. Sources: Wendland 1995; Mueller et al. 2003; Macklin and Mueller 2013. The
integral of W is 1, so its unit is 1/m^d, and W(0) is no number in [0, 1]: 1567 per m^3 at h = 0.1 m. Wendland's needs
neither a division nor a branch, and its gradient is that of its W; poly6 with spiky has a gradient that is not, which
is what is published.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pbd.dispatch import stage
from pbd.fluid.lanes import fused, inverse, positive, square_root
from pbd.vector import like

SMALLEST = 1e-15
"""Added to r^2/h^2 before a division, where x = 0 makes any finite factor right."""


@stage(required=True)
def shape(kernel, squared):
    """(w, g) at lanes of |x|^2: W = ``value`` w, grad W = -``slope`` g x."""


class Wendland(NamedTuple):
    """Wendland C2: ``inverse`` is 1/h [1/m]; see `shape`."""

    inverse: float
    value: float
    slope: float

    def shape(self, squared):
        u = positive(fused(square_root(squared), -self.inverse, like(self.inverse, 1.0)))
        square = u * u
        return square * square * fused(u, like(self.inverse, -4.0), like(self.inverse, 5.0)), square * u


class Poly6Spiky(NamedTuple):
    """Poly6 and the gradient of spiky: ``inverse`` is 1/h [1/m]; see `shape`."""

    inverse: float
    value: float
    slope: float

    def shape(self, squared):
        one = like(self.inverse, 1.0)
        q_squared = squared * (self.inverse * self.inverse)
        q = square_root(q_squared + like(self.inverse, SMALLEST))
        bell, cone = positive(fused(q_squared, -one, one)), positive(fused(q, -one, one))
        return bell * bell * bell, cone * cone * inverse(q)


KERNELS = ("wendland", "poly6_spiky")


def new_kernel(name: str, h: float, dimension: int) -> Wendland | Poly6Spiky:
    """The kernel of that name with support h [m]."""
    plane, unit = dimension == 2, h**-dimension / math.pi
    if name == "wendland":
        value = (7.0 if plane else 10.5) * unit
        return Wendland(1.0 / h, value, 20.0 * value / h**2)
    value, spiky = (4.0 if plane else 315.0 / 64.0) * unit, (10.0 if plane else 15.0) * unit
    return Poly6Spiky(1.0 / h, value, 3.0 * spiky / h**2)


def profile(kernel: Wendland | Poly6Spiky, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(W [1/m^d], -dW/dr [1/m^(d+1)]) at distances r (n,) [m], in double precision."""
    w, g = kernel.shape(np.asarray(r, dtype=np.float64) ** 2)
    return kernel.value * w, kernel.slope * g * r


def lattice_sum(kernel: Wendland | Poly6Spiky, spacing: float, dimension: int) -> float:
    """Sum of W over a square or cubic lattice, times the volume of a particle in it: about 1."""
    return float(profile(kernel, lattice_distances(kernel, spacing, dimension))[0].sum() * spacing**dimension)


def lattice_distances(kernel: Wendland | Poly6Spiky, spacing: float, dimension: int) -> np.ndarray:
    """(n,) from a point of a square or cubic lattice to all within reach along each axis [m], itself among them."""
    reach = np.arange(-(cells := math.ceil(1.0 / (kernel.inverse * spacing))), cells + 1) * spacing
    return np.sqrt(np.ravel(sum(axis**2 for axis in np.meshgrid(*[reach] * dimension))))
