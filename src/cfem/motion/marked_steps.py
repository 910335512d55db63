"""What is known of a moving robot, carried forward: steps of the condensed dynamics under unknown forces.

A force on a row is like momentum, half of it before a step and half after: the midpoint rule's own way. Forces come and
go as a static filter has them (`cfem.predict.estimate_filter`). Actuators whose displacements are commanded slip
beside, whose forces are commanded move as the model says; forces that nobody knows push both at random, with a
covariance in proportion to the stiffness, as in observer.py."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cfem.core.errors import InputError, NumericalError
from cfem.motion.clocked import Clocked, State
from cfem.motion.linear import Kind, Material, places
from cfem.motion.model import MotionModel, Place
from cfem.predict.estimate import Estimator
from cfem.predict.estimate_spec import DynamicsSpec

SWING = 0.05  # of the robot's length, where a spec states none
STEPS = 12  # of the first natural period, at least


@dataclass(frozen=True)
class Unknown:
    """Standard deviations. slip: mm by which an actuator moves in a second beside its command (root of); offset: mm, of
    where it stands from the first command; push: mm by which forces that the model does not know move the effectors in
    a hundredth of a second, at rest (root of); swing: mm of a vibration of the effectors at the start; stiffness: of
    its logarithm at the start; wander: by which it changes a second, as a share of that; lasts: s for which a load
    keeps its value."""

    slip: float
    offset: float
    swing: float
    push: float = 0.03
    stiffness: float = 0.1
    wander: float = 0.1
    lasts: float = np.inf

    def __post_init__(self) -> None:
        if min(self.slip, self.offset, self.push, self.swing, self.lasts) <= 0:
            raise InputError("slip, offset, push, swing and the time for which a load lasts must be positive")


def unknown_of(spec: DynamicsSpec | None, slip: float, offset: float, lasts: float, length: float) -> Unknown:
    """slip, offset, lasts as in `Unknown`; length: of the robot, mm."""
    spec = spec or DynamicsSpec()
    swing = SWING * length if spec.swing is None else spec.swing
    return Unknown(slip, offset, swing, spec.push, spec.stiffness, spec.wander, lasts)


@dataclass(frozen=True)
class Known:
    """state; loads (n_w,) N; log: of the stiffness over the model's; covariance (n_z + n_w + 1, ...) of these in this
    order; by_slip (n_z, n_a): what the last command would have done, had it been another."""

    state: State
    loads: np.ndarray
    log: float
    covariance: np.ndarray
    by_slip: np.ndarray


class MarkedSteps:
    """kind: what is commanded. first: Hz, the first natural frequency; n_z: numbers of a state."""

    def __init__(self, estimator: Estimator, motion: MotionModel, kind: Kind, unknown: Unknown):
        self._estimator, self._motion, self._unknown = estimator, motion, unknown
        self._held, about = kind == "displacement", estimator.middle[: motion.n_a]
        self._clocked = lru_cache(16)(lambda dt: Clocked(motion, kind, dt, about))
        one = self._clocked(1e-3)
        self.first, self.n_z = one.frequency, one.n_z

    def __call__(self, known: Known, u: np.ndarray, time: float) -> Known:
        """After `time` s in which commands move evenly to u (n_a,). NumericalError where the motion is lost."""
        if time <= 0:
            return known
        count = self.count(time)
        told, n_a = known.state.u, self._motion.n_a
        middle = known.state.z[: self._motion.n_q] + time / 2 * known.state.v
        if self._held:
            middle[:n_a] = known.state.z[:n_a] + (u - told) / 2
        place, by_slip = places(self._motion, middle[None, :n_a]), np.zeros((self.n_z, len(told)))
        J = self._slopes(place, middle)
        for share in np.arange(1, count + 1) / count:
            known, A, B = self._step(known, told + share * (u - told), time / count, place, J)
            by_slip = A @ by_slip + B / count
        return Known(known.state, known.loads, known.log, known.covariance, by_slip)

    def count(self, time: float) -> int:
        """Steps in `time` s."""
        return max(1, int(np.ceil(time * STEPS * self.first - 1e-9)))

    def _step(
        self, known: Known, u: np.ndarray, dt: float, place: Place, J: np.ndarray
    ) -> tuple[Known, np.ndarray, np.ndarray]:
        """place: whose inertia is taken; J (n_w, n_q): of the rows with forces by q. Also slopes of the state by the
        one before and by the command."""
        n_a, n_q, n_z, n_w = self._motion.n_a, self._motion.n_q, self.n_z, len(known.loads)
        momenta, loads, state = slice(n_q, 2 * n_q), slice(n_z, n_z + n_w), known.state
        stiffness, half_push = float(np.exp(known.log)), dt / 2 * known.loads @ J
        before = state.z.copy()
        before[momenta] += half_push
        goal = before[:n_a] + u - state.u if self._held else u  # an actuator keeps its distance from its command
        pushed = State(before, state.v, state.u)
        after, steps, place = self._clocked(round(dt, 9)).step(pushed, goal, Material(stiffness), place)
        A, B, F = steps.A[0].copy(), steps.B[0], np.eye(n_z + n_w + 1)
        if self._held:
            A[:, :n_a] += B
        half = A[:, momenta].copy()
        half[momenta] += np.eye(n_q)
        half *= dt / 2  # by a force
        keeps = np.exp(-dt / self._unknown.lasts)
        F[:n_z, :n_z], F[:n_z, loads], F[:n_z, -1] = A, half @ J.T, steps.by_material[0][:, 0]
        F[loads, loads] *= keeps
        P = F @ known.covariance @ F.T
        P[:n_z, :n_z] += self._pushes(half, place, stiffness, dt)
        if self._held:
            P[:n_z, :n_z] += self._unknown.slip**2 * dt * B @ B.T
            of = slice(n_q, n_q + n_a)  # momenta of what is held are the model's
            P[of], P[:, of] = 0.0, 0.0
        P[loads, loads] += (1 - keeps**2) * self._estimator.load_covariance
        P[-1, -1] += dt * (self._unknown.wander * self._unknown.stiffness) ** 2
        z = after.z.copy()
        z[momenta] += half_push
        if not np.isfinite(z.sum() + P.sum()):
            raise NumericalError("the filter has lost the robot: its estimate is not finite")
        return Known(State(z, after.v, u), keeps * known.loads, known.log, (P + P.T) / 2, known.by_slip), A, B

    def _slopes(self, place: Place, q: np.ndarray) -> np.ndarray:
        """(n_w, n_q) of the rows with forces by q (n_q,), where the model says `place`."""
        rows, n_a, model = self._estimator.loaded_rows, self._motion.n_a, self._estimator.model
        J, H, dH = place.J[0], place.H[0], place.dH[0]
        if (rows >= len(J)).any():
            Hs, dHs = self._motion.skin(q[:n_a])
            J = np.vstack([J, model.skin.gradient(q[:n_a], model.q(None))])
            H, dH = Hs, dHs
        return np.hstack([J[rows] + (dH[:, rows] @ q[n_a:]).T, H[rows]])

    def _pushes(self, by_force: np.ndarray, place: Place, stiffness: float, dt: float) -> np.ndarray:
        """(n_z, n_z), of forces that nobody knows."""
        free = slice(self._motion.n_a if self._held else 0, None)
        K = stiffness * place.K[0, free, free]
        J = np.concatenate([place.J[0], place.H[0]], axis=1)[:, free]
        moved = np.trace(J @ np.linalg.solve(K, J.T)) / len(J)
        by = by_force[:, free]
        return self._unknown.push**2 / moved * (0.01 / dt) * by @ K @ by.T
