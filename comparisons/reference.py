"""High-accuracy references: scipy's DOP853 on the scene's own equations of motion.

Rigid serial chains are integrated in minimal coordinates, the link angles, at O(N) a right-hand side, a free rigid pair
in those of its centre and its angle; everything with springs in Cartesian coordinates. The integration restarts at each
sample time, because DOP853's dense output is only of order 7.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import DOP853, solve_ivp
from scipy.linalg.lapack import dptsv
from scipy.sparse import csr_array

from comparisons.scene import Rods, Scene, Springs
from comparisons.trajectory import Trajectory

RTOL, ATOL = 1e-13, 1e-14
"""The tightest that DOP853 takes in double precision; the error is then about 1e-11 m on short chains."""

EVALUATIONS = 12
"""Right-hand sides in a step of DOP853."""

PERTURBATION = 1e-9
GROWTH_LIMIT = 1e4
"""Past the time at which a small perturbation has grown by this factor, an error says nothing about accuracy."""


class NoReference(ValueError):
    """The scene has no reference; the message says why."""


def solve(scene: Scene, rtol: float = RTOL, atol: float = ATOL) -> Trajectory:
    """The scene's motion at its sample times by DOP853; raises `NoReference` where no form fits."""
    equations = form(scene)
    return _integrate(scene, equations, equations.initial, rtol, atol)


def form(scene: Scene) -> ChainAngles | RigidPair | Cartesian:
    """The scene's equations of motion; raises `NoReference` where no form fits."""
    if scene.fluid is not None:
        raise NoReference("a fluid's particles have no equations of motion that all methods share")
    if not scene.of(Rods):
        return Cartesian(scene)
    return ChainAngles(scene) if scene.masses.pinned else RigidPair(scene)


def horizon(scene: Scene) -> float:
    """The predictability horizon [s]: when a perturbation of PERTURBATION has grown by GROWTH_LIMIT, or inf."""
    equations = form(scene)
    start = equations.initial
    kick = PERTURBATION * np.random.default_rng(0).standard_normal(len(start)) * equations.positions
    loose = 1e-3 * PERTURBATION
    one, other = (_integrate(scene, equations, y, loose, loose).positions for y in (start, start + kick))
    growth = np.sqrt(np.mean(np.sum((one - other) ** 2, axis=2), axis=1)) / PERTURBATION
    late = np.flatnonzero(growth > GROWTH_LIMIT)
    return float(scene.times[late[0]]) if len(late) else np.inf


def _integrate(
    scene: Scene, form: ChainAngles | RigidPair | Cartesian, start: np.ndarray, rtol: float, atol: float
) -> Trajectory:
    times, y, steps = scene.times, start, 0
    positions = np.empty((len(times), *scene.masses.positions.shape))
    velocities = np.empty_like(positions)
    positions[0], velocities[0] = form.cartesian(y)
    guess = np.inf
    for k in range(1, len(times)):
        first = min(guess, times[k] - times[k - 1]) if np.isfinite(guess) else None
        solver = DOP853(form.derivative, times[k - 1], y, times[k], rtol=rtol, atol=atol, first_step=first)
        while solver.status == "running":
            message = solver.step()
            steps += 1
        if solver.status == "failed":
            return Trajectory(times[:k], positions[:k], velocities[:k], steps, diverged=message or "step size")
        y, guess = solver.y, solver.h_abs
        positions[k], velocities[k] = form.cartesian(y)
    return Trajectory(times, positions, velocities, steps)


def integrate_dense(scene: Scene, form: ChainAngles | RigidPair | Cartesian, rtol: float, atol: float) -> Trajectory:
    """As an analyst would: one integration, the samples from the dense output."""
    times = scene.times
    out = solve_ivp(form.derivative, times[[0, -1]], form.initial, "DOP853", times, rtol=rtol, atol=atol)
    samples = [form.cartesian(y) for y in out.y.T]
    x, v = (np.array([sample[k] for sample in samples]) for k in range(2))
    return Trajectory(times[: len(x)], x, v, out.nfev // EVALUATIONS, diverged="" if out.success else "step size")


class ChainAngles:
    """A rigid serial planar chain, anchored at its first particle: y = (theta, theta').

    With u_i = (sin theta_i, -cos theta_i) along link i and t_i = du_i/dtheta, the link tensions solve the
    tridiagonal system that keeps every length, and theta_i'' = t_i . (a_i - a_(i-1)) / L_i.
    """

    def __init__(self, scene: Scene) -> None:
        masses, rods = scene.masses, scene.of(Rods)
        n = len(masses.masses) - 1
        serial = np.column_stack([np.arange(n), np.arange(1, n + 1)])
        if (
            len(scene.links) != 1
            or masses.pinned != (0,)
            or len(scene.gravity) != 2
            or not np.array_equal(rods[0].pairs, serial)
        ):
            raise NoReference("minimal coordinates need one planar serial chain of rods, anchored at particle 0")
        self.lengths, self.anchor, self.gravity = rods[0].lengths, masses.positions[0], scene.gravity
        self.w = 1.0 / masses.masses[1:]
        self.diagonal = self.w + np.concatenate([[0.0], self.w[:-1]])
        links = np.diff(masses.positions, axis=0)
        if not np.allclose(np.linalg.norm(links, axis=1), self.lengths, rtol=1e-12):
            raise NoReference("a rigid chain that starts stretched has no smooth motion")
        theta = np.arctan2(links[:, 0], -links[:, 1])
        rates = np.sum(np.diff(masses.velocities, axis=0) * self._directions(theta)[1], axis=1) / self.lengths
        self.initial = np.concatenate([theta, rates])
        self.positions = np.repeat([1.0, 0.0], n)  # which of y are positions

    @staticmethod
    def _directions(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        s, c = np.sin(theta), np.cos(theta)
        return np.column_stack([s, -c]), np.column_stack([c, s])

    def derivative(self, _: float, y: np.ndarray) -> np.ndarray:
        """y' = (theta', theta'')."""
        n = len(self.lengths)
        rates = y[n:]
        u, t = self._directions(y[:n])
        right = self.lengths * rates**2
        right[0] += self.gravity @ u[0]
        off = -np.sum(u[1:] * u[:-1], axis=1) * self.w[:-1]
        tension = dptsv(self.diagonal, off, right)[2] if n > 1 else right / self.diagonal
        pull = tension[:, None] * u
        force = -pull
        force[:-1] += pull[1:]
        acceleration = self.w[:, None] * force
        relative = acceleration.copy()
        relative[1:] -= acceleration[:-1]
        relative[0] += self.gravity
        return np.concatenate([rates, np.sum(relative * t, axis=1) / self.lengths])

    def cartesian(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (n, d) of all particles."""
        n = len(self.lengths)
        u, t = self._directions(y[:n])
        x = self.anchor + np.vstack([np.zeros(2), np.cumsum(self.lengths[:, None] * u, axis=0)])
        v = np.vstack([np.zeros(2), np.cumsum((self.lengths * y[n:])[:, None] * t, axis=0)])
        return x, v


class RigidPair:
    """Two free masses on one rod in the plane: y = (centre, theta, their rates); the angle turns at a constant rate."""

    positions = np.repeat([1.0, 0.0], 3)

    def __init__(self, scene: Scene) -> None:
        masses = scene.masses
        if len(scene.links) != 1 or masses.positions.shape != (2, 2) or len(scene.links[0].lengths) != 1:
            raise NoReference("free rods need one planar pair of masses")
        x, v, share = masses.positions, masses.velocities, masses.masses / masses.masses.sum()
        arm, rate = x[1] - x[0], v[1] - v[0]
        self.length = float(scene.links[0].lengths[0])
        if not np.isclose(np.linalg.norm(arm), self.length, rtol=1e-12):
            raise NoReference("a rigid pair that starts stretched has no smooth motion")
        self.gravity, self.offsets = scene.gravity, np.array([[-share[1]], [share[0]]])
        spin = (arm[0] * rate[1] - arm[1] * rate[0]) / self.length**2
        self.initial = np.array([*(share @ x), np.arctan2(arm[1], arm[0]), *(share @ v), spin])

    def derivative(self, _: float, y: np.ndarray) -> np.ndarray:
        """y' = (v, theta', g, 0)."""
        return np.concatenate([y[3:], self.gravity, [0.0]])

    def cartesian(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (2, 2) of both particles."""
        along = self.length * np.array([np.cos(y[2]), np.sin(y[2])])
        across = y[5] * np.array([-along[1], along[0]])
        return y[:2] + self.offsets * along, y[3:5] + self.offsets * across


class Cartesian:
    """Free particles under gravity and springs: y = (x, v), forces -C/alpha along each spring."""

    def __init__(self, scene: Scene) -> None:
        if scene.of(Rods):
            raise NoReference("Cartesian coordinates need springs only")
        self.shape = scene.masses.positions.shape
        self.free = scene.masses.free[:, None]
        self.gravity = np.where(self.free, scene.gravity, 0.0)
        self.w = np.where(self.free[:, 0], 1.0 / scene.masses.masses, 0.0)[:, None]
        self.springs: list[Springs] = scene.of(Springs)
        self.ends = [_ends(springs.pairs, len(self.w)) for springs in self.springs]
        self.initial = np.concatenate([scene.masses.positions.ravel(), scene.masses.velocities.ravel()])
        self.positions = np.concatenate(
            [np.repeat(self.free[:, 0], self.shape[1]), np.zeros(self.free.size * self.shape[1])]
        )

    def derivative(self, _: float, y: np.ndarray) -> np.ndarray:
        """y' = (v, g + w f)."""
        x, v = y.reshape(2, *self.shape)
        force = np.zeros(self.shape)
        for springs, ends in zip(self.springs, self.ends):
            i, j = springs.pairs.T
            difference = x[i] - x[j]
            length = np.sqrt(np.sum(difference**2, axis=1))
            pull = ((length - springs.lengths) / (springs.compliances * length))[:, None] * difference
            force -= ends @ pull
        return np.concatenate([v.ravel(), (self.gravity + self.w * force).ravel()])

    def cartesian(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (n, d) of all particles."""
        x, v = y.reshape(2, *self.shape)
        return x, v


def _ends(pairs: np.ndarray, n: int) -> csr_array:
    """(n, m) signs: 1 where a particle is the first of a pair, -1 where it is the second."""
    m = len(pairs)
    signs = np.repeat([1.0, -1.0], m)
    return csr_array((signs, (pairs.T.ravel(), np.tile(np.arange(m), 2))), shape=(n, m))
