"""The transition of a moving robot's filter: steps of the condensed dynamics under unknown forces.

A force on a row is like momentum, half of it before a step and half after: the midpoint rule's own way. Forces come and
go as a static filter has them (`cfem.predict.estimation.filter`). Actuators whose displacements are commanded slip
beside, whose forces are commanded move as the model says; forces that nobody knows push both at random (pushes.py)."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from cfem.core.errors import NumericalError
from cfem.motion.clocked import Clocked, ClockedState
from cfem.motion.estimation.pushes import push_covariance, slope_by_force
from cfem.motion.estimation.uncertainty import MotionUncertainty
from cfem.motion.linear import Kind, MaterialShares, places
from cfem.motion.model import MotionModel, MotionTerms
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.kalman import Gaussian

STEPS = 12  # of the first natural period, at least


@dataclass(frozen=True)
class MovingState:
    """The distribution of a moving robot's state.

    distribution: of z (n_z,), the loads (n_w,) N and the logarithm of the stiffness over the model's, in this order
    v: (n_q,) mean velocity of the last step
    u: (n_a,) the command that has been reached
    by_slip: (n_z, n_a) slope of z by the last command
    """

    distribution: Gaussian
    v: np.ndarray
    u: np.ndarray
    by_slip: np.ndarray

    @property
    def z(self) -> np.ndarray:
        """Positions, momenta and the memory of viscous terms (n_z,)."""
        return self.distribution.mean[: len(self.by_slip)]

    @property
    def loads(self) -> np.ndarray:
        """Loads (n_w,) N on the effectors."""
        return self.distribution.mean[len(self.by_slip) : -1]

    @property
    def log(self) -> float:
        """Logarithm of the stiffness over the model's."""
        return float(self.distribution.mean[-1])

    @property
    def covariance(self) -> np.ndarray:
        return self.distribution.covariance


class Transition:
    """The step of a robot with markers from one frame to the next.

    first: Hz, the first natural frequency
    n_z: numbers of a state of the dynamics
    """

    def __init__(self, estimator: Estimator, motion: MotionModel, kind: Kind, uncertainty: MotionUncertainty):
        """Prepares steps of the state. kind: what is commanded."""
        self._estimator, self._motion, self._uncertainty = estimator, motion, uncertainty
        self._held, about = kind == "displacement", estimator.middle[: motion.n_a]
        self._clocked = lru_cache(16)(lambda dt: Clocked(motion, kind, dt, about))
        clocked = self._clocked(1e-3)
        self.first, self.n_z = clocked.frequency, clocked.n_z

    def __call__(self, state: MovingState, u: np.ndarray, time: float) -> MovingState:
        """The state after `time` s in which commands move evenly to u (n_a,). NumericalError where the motion is
        lost."""
        if time <= 0:
            return state
        count, begin, n_a = self.count(time), state.u, self._motion.n_a
        middle = state.z[: self._motion.n_q] + time / 2 * state.v
        if self._held:
            middle[:n_a] = state.z[:n_a] + (u - begin) / 2
        place, by_slip = places(self._motion, middle[None, :n_a]), np.zeros((self.n_z, len(begin)))
        J = self._load_slopes(place, middle)
        for number in range(1, count + 1):
            state, A, B = self._step(state, begin + number / count * (u - begin), time / count, place, J)
            # a displacement grows by as much in each step, a force acts with its mean over the step
            by_slip = A @ by_slip + B * (1 if self._held else number - 0.5) / count
        return replace(state, by_slip=by_slip)

    def count(self, time: float) -> int:
        """Number of steps in `time` s."""
        return max(1, int(np.ceil(time * STEPS * self.first - 1e-9)))

    def _step(
        self, state: MovingState, u: np.ndarray, dt: float, place: MotionTerms, J: np.ndarray
    ) -> tuple[MovingState, np.ndarray, np.ndarray]:
        """The state after one step to the command u, and the slopes of z by the z before and by what acts in the step.

        place: whose inertia is taken; J (n_w, n_q): slopes of the rows with forces by q."""
        n_a, n_q, n_z = self._motion.n_a, self._motion.n_q, self.n_z
        momenta, stiffness, half_push = slice(n_q, 2 * n_q), float(np.exp(state.log)), dt / 2 * state.loads @ J
        pushed = state.z.copy()
        pushed[momenta] += half_push
        target = pushed[:n_a] + u - state.u if self._held else u  # an actuator keeps its distance from its command
        step = self._clocked(round(dt, 9)).step
        after, steps, place = step(ClockedState(pushed, state.v, state.u), target, MaterialShares(stiffness), place)
        A, B = steps.A[0].copy(), steps.B[0]
        if self._held:
            A[:, :n_a] += B
        by_force = slope_by_force(A, n_q, dt)
        keeps = np.exp(-dt / self._uncertainty.lasts)
        loads = slice(n_z, n_z + len(J))
        F = np.eye(n_z + len(J) + 1)
        F[:n_z, :n_z], F[:n_z, loads], F[:n_z, -1] = A, by_force @ J.T, steps.by_material[0][:, 0]
        F[loads, loads] *= keeps
        z = after.z.copy()
        z[momenta] += half_push
        Q = self._noise(by_force, B, place, stiffness, dt)
        mean = np.concatenate([z, keeps * state.loads, [state.log]])
        distribution = self._without_held_momenta(state.distribution.predicted(mean, F, Q))
        if not np.isfinite(z.sum() + distribution.covariance.sum()):
            raise NumericalError("the filter has lost the robot: its estimate is not finite")
        return MovingState(distribution, after.v, u, state.by_slip), A, B

    def _noise(
        self, by_force: np.ndarray, B: np.ndarray, place: MotionTerms, stiffness: float, dt: float
    ) -> np.ndarray:
        """Covariance (n, n) that a step adds: unknown pushes, slip beside the command, new loads, other stiffness.

        by_force (n_z, n_q), B (n_z, n_a): slopes of z by forces and by the command."""
        uncertainty, loads = self._uncertainty, self._estimator.load_covariance
        n_z, n_w = self.n_z, len(loads)
        free = slice(self._motion.n_a if self._held else 0, None)
        Q = np.zeros((n_z + n_w + 1,) * 2)
        push = uncertainty.push * np.sqrt(0.01 / dt)
        Q[:n_z, :n_z] = push_covariance(by_force, place, stiffness, free, push)
        if self._held:
            Q[:n_z, :n_z] += uncertainty.slip**2 * dt * B @ B.T
        Q[n_z:-1, n_z:-1] = (1 - np.exp(-dt / uncertainty.lasts) ** 2) * loads
        Q[-1, -1] = dt * (uncertainty.wander * uncertainty.stiffness) ** 2
        return Q

    def _without_held_momenta(self, distribution: Gaussian) -> Gaussian:
        """The distribution, symmetric, with the model's momenta for what is held: these have no uncertainty."""
        P = (distribution.covariance + distribution.covariance.T) / 2
        if self._held:
            momenta = slice(self._motion.n_q, self._motion.n_q + self._motion.n_a)
            P[momenta], P[:, momenta] = 0.0, 0.0
        return Gaussian(distribution.mean, P)

    def _load_slopes(self, place: MotionTerms, q: np.ndarray) -> np.ndarray:
        """Slopes (n_w, n_q) of the rows with forces by q (n_q,), where the model says `place`."""
        rows, n_a, model = self._estimator.loaded_rows, self._motion.n_a, self._estimator.model
        J, H, dH = place.J[0], place.H[0], place.dH[0]
        if (rows >= len(J)).any():
            H_skin, dH = self._motion.skin(q[:n_a])
            J, H = np.vstack([J, model.skin.gradient(q[:n_a], model.q(None))]), H_skin
        return np.hstack([J[rows] + (dH[:, rows] @ q[n_a:]).T, H[rows]])
