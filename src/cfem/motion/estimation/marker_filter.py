"""Where a moving robot is, how it moves and who pushes it, from markers on its skin: an iterated extended Kalman filter
on the condensed dynamics (Bell and Cathey, IEEE Trans. Automatic Control 38, 1993).

Unknown are positions q and momenta p of the actuators' displacements and of the inner motions, the memory of viscous
terms, forces w on chosen rows and the logarithm of the stiffness over the model's. Their transition is transition.py.
As markers show q, w and the stiffness alone (moving_markers.py), each frame is a least-squares problem of these
(`cfem.predict.estimation.fit`); the rest follows by its covariance with them.

A frame that does not fit its prior is rejected (`cfem.predict.estimation.gate`). After a run of these, and of frames
without an estimate, the filter begins again. It also begins again where the predicted robot is far out of its range, as
innovations of such a state rise and fall and so may never make a run. A commanded displacement far out of the range is
no command."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from cfem.core.errors import InputError, NumericalError
from cfem.motion.estimation.moving_markers import MovingMarkers
from cfem.motion.estimation.transition import MovingState, Transition
from cfem.motion.estimation.uncertainty import MotionUncertainty
from cfem.motion.linear import Kind
from cfem.motion.model import MotionModel
from cfem.predict.estimation.answer import Estimate
from cfem.predict.estimation.estimate import UNSEEN, Estimator
from cfem.predict.estimation.fit import EstimateStatus, FitResiduals, Markers, Minimum, Search, minimise
from cfem.predict.estimation.gate import Gate, GateSpec, SampleVerdict
from cfem.predict.estimation.kalman import Gaussian, gated_update

FAR = 8.0  # standard deviations of unknowns within which they are looked for
SAG = 0.5  # of the square of a swing over the length of the robot: how far its arc is from a line
JUMP = 0.05  # of the reach: of an actuator that is not where its command is


@dataclass(frozen=True)
class MarkerFrame:
    """Measurements at one time.

    measured: (m, 3) mm, the markers
    sensed: (n_a,) mm of the actuators, or None
    commanded: (n_a,) reached at the frame, or None
    """

    measured: np.ndarray
    sensed: ArrayLike | None
    commanded: ArrayLike | None


@dataclass(frozen=True)
class MarkerCorrection:
    """The update by one frame.

    predicted: the state before the frame
    prior: the distribution that the update began with; wider than `predicted` where an actuator has jumped
    minimum: of the numbers that markers show
    """

    predicted: MovingState
    prior: Gaussian
    minimum: Minimum

    @property
    def innovation(self) -> tuple[float, int]:
        return self.minimum.innovation


class MarkerFilter:
    """Filter of frames of a moving robot.

    kind: what is commanded; where nobody knows commands, displacements that slip
    forward: the transition; markers: the rows of measurement
    known: the state after the last frame, None before the first
    scale (n,), box (n, 2): size of the numbers that markers show, and where they are looked for
    swing: amplitude of inner motions at the start
    jump (n_a,): mm that an actuator may be off its command, or the N that hold so many where forces are commanded
    last: mean and covariance of what markers show, after the last frame
    """

    def __init__(
        self,
        estimator: Estimator,
        motion: MotionModel,
        kind: Kind,
        uncertainty: MotionUncertainty,
        gate: GateSpec | None = None,
    ):
        """Filter of markers on the learned dynamics of `motion`; kind: of the commands."""
        self.gate = Gate.of(gate or GateSpec())
        self.estimator, self.motion, self.kind, self.uncertainty = estimator, motion, kind, uncertainty
        self.markers = MovingMarkers(estimator, motion)
        self.forward = Transition(estimator, motion, kind, uncertainty)
        n_a, n_q, n_z, n_w = motion.n_a, motion.n_q, self.forward.n_z, len(estimator.loaded)
        self._shown = np.r_[0:n_q, n_z : n_z + n_w + 1]  # of the numbers of the state
        H = motion.paths(estimator.middle[:n_a])[0][:3]
        self.swing = uncertainty.swing / np.sqrt((H**2).sum())  # an amplitude
        self.jump = JUMP * estimator.scale[:n_a]
        if kind == "force":
            self.jump = self.jump * np.abs(np.diag(motion.forces(estimator.middle[:n_a])[1]))
        swings, soft = np.full(motion.n_r, self.swing), max(uncertainty.stiffness, 1e-6)
        self.scale = np.r_[estimator.scale[:n_a], swings, estimator.scale[n_a:], soft]
        far = FAR * np.r_[swings, soft]
        low, high = (
            np.r_[box[:n_a], sign * far[:-1], box[n_a:], sign * far[-1]]
            for sign, box in zip((-1, 1), estimator.box.T, strict=True)
        )
        self.box = np.stack([low, high], axis=1)
        self.known: MovingState | None = None
        self.last: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names (n,) of the numbers that markers show."""
        n_a, swings = self.motion.n_a, (f"swing.{number}" for number in range(1, self.motion.n_r + 1))
        return (*self.estimator.unknowns[:n_a], *swings, *self.estimator.loaded, "stiffness")

    def tick(
        self,
        measured: ArrayLike,
        sensed: ArrayLike | None = None,
        commanded: ArrayLike | None = None,
        after: float = 0.0,
    ) -> Estimate:
        """The estimate of a frame, `after` seconds behind the last one. Never raises for what the numbers are.

        measured (m, 3) mm, nan for a marker that is missing; sensed (n_a,) mm of the actuators; commanded (n_a,):
        reached now, evenly from what was before; None where nobody knows."""
        self.predict(commanded, after)
        return self.correct(measured, sensed, commanded)

    def predict(self, commanded: ArrayLike | None, time: float) -> None:
        """Moves the state `time` s on, without a frame; a motion that is lost begins again at the next frame."""
        if self.known is None:
            return
        u = self._reachable(commanded)
        try:
            self.known = self.forward(self.known, self.known.u if u is None else u, time)
        except (NumericalError, np.linalg.LinAlgError):
            self.known = None
            return
        if not _near(self.known.z[: self.motion.n_q], self.box[: self.motion.n_q]):
            self.known = None

    def correct(
        self, measured: ArrayLike, sensed: ArrayLike | None = None, commanded: ArrayLike | None = None
    ) -> Estimate:
        """The estimate with a frame of the present time; arguments as in `tick`."""
        frame = MarkerFrame(np.asarray(measured, float), sensed, commanded)
        correction, verdict = gated_update(
            self.gate, self.known, lambda: self._first(frame), lambda state: self._update(state, frame)
        )
        self.known, minimum = correction.predicted, correction.minimum
        if verdict is SampleVerdict.REJECTED and minimum.converged:
            minimum = replace(minimum, status=EstimateStatus.REJECTED)
        shown = Gaussian(self._mean(self.known), self._covariance(correction.prior.covariance))
        if minimum.converged:
            shown = Gaussian(minimum.x, minimum.covariance(self.scale))
            self.known = replace(self.known, distribution=correction.prior.with_part(self._shown, shown))
        self.last = shown.mean, shown.covariance
        return self._answer(minimum, shown)

    def _reachable(self, commanded: ArrayLike | None) -> np.ndarray | None:
        """The command (n_a,); None where it is missing, or a displacement far out of the robot's range."""
        if commanded is None:
            return None
        u = np.asarray(commanded, float)
        return u if self.kind == "force" or _near(u, self.box[: self.motion.n_a]) else None

    def _update(self, state: MovingState, frame: MarkerFrame) -> MarkerCorrection:
        """The update of a predicted state; with a wider prior where that fits better and an actuator may have
        jumped."""
        correction = self._fitted(state, state.distribution, frame)
        minimum = correction.minimum
        if minimum.converged and not minimum.outliers and self._likely(minimum):
            return correction
        wider = self._fitted(state, self._jumped(state), frame)
        more = wider.minimum.kept.sum() > minimum.kept.sum()
        better = more or (self._likely(wider.minimum) and not self._likely(minimum))
        return wider if wider.minimum.converged and (not minimum.converged or better) else correction

    def _fitted(self, state: MovingState, prior: Gaussian, frame: MarkerFrame) -> MarkerCorrection:
        """The minimum of a frame's residuals with a prior; state: gives the noise of the markers."""
        moved, seen = self.estimator.from_rest(frame.measured)
        noise, mean = self._noise(state), self._mean(state)

        def residual(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            value, by_y = self.markers.seen(y)
            return (value.reshape(-1, 3) - moved) / noise, by_y.reshape(*moved.shape, -1) / noise

        sensor = self.estimator.actuator_sensor(frame.sensed, self._displacement_rows, self.estimator.sensor)
        shown = Gaussian(mean, self._covariance(prior.covariance))
        problem = FitResiduals(Markers(residual, seen), shown.prior, () if sensor is None else (sensor,))
        minimum = minimise(problem, mean, Search(self.scale, self.box), lambda: mean)
        return MarkerCorrection(state, prior, minimum)

    def _likely(self, minimum: Minimum) -> bool:
        """True if the gate would accept the frame."""
        return self.gate.accepts(*minimum.innovation)

    def _displacement_rows(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n_a = self.motion.n_a
        return y[:n_a], np.eye(n_a, len(self.scale))

    def _mean(self, state: MovingState) -> np.ndarray:
        """Means (n,) of the numbers that markers show."""
        return state.distribution.mean[self._shown]

    def _covariance(self, covariance: np.ndarray) -> np.ndarray:
        """Covariance (n, n) of the numbers that markers show."""
        return covariance[np.ix_(self._shown, self._shown)]

    def _first(self, frame: MarkerFrame) -> MovingState:
        """The state before the first frame: near the command, or where the frame shows a robot at rest."""
        n_a, n_q, n_z, uncertainty = self.motion.n_a, self.motion.n_q, self.forward.n_z, self.uncertainty
        u, n_w = self._reachable(frame.commanded), len(self.estimator.loaded)
        if u is None and self.kind == "force":
            raise InputError("commanded forces are missing", do="give them in each frame")
        if u is not None and self.kind == "displacement":
            delta_a, deviation = u, uncertainty.offset
        else:
            delta_a = self.estimator.estimate(frame.measured, frame.sensed).delta_a
            deviation = 3.0 * self.estimator.scale[:n_a]
        P = np.zeros((n_z + n_w + 1,) * 2)
        P[range(n_a), range(n_a)] = np.square(deviation)
        P[range(n_a, n_q), range(n_a, n_q)] = self.swing**2
        inertia = self.motion.at(delta_a).M[n_a:, n_a:]
        P[n_q + n_a : 2 * n_q, n_q + n_a : 2 * n_q] = self.swing**2 * self.motion.stiffness * inertia
        P[n_z:-1, n_z:-1] = self.estimator.load_covariance
        P[-1, -1] = uncertainty.stiffness**2
        mean = np.r_[delta_a, np.zeros(n_z - n_a + n_w + 1)]
        reached = delta_a if u is None else u
        return MovingState(Gaussian(mean, P), np.zeros(n_q), reached, np.zeros((n_z, n_a)))

    def _noise(self, state: MovingState) -> float:
        """Noise mm of a marker's coordinate: the camera's, and the sag u^2 / (2 length) of an arc on which the
        effectors swing by u, which the skin's model does not have."""
        eta = slice(self.motion.n_a, self.motion.n_q)
        H = self.motion.paths(state.z[: self.motion.n_a])[0][:3]
        square = ((H @ state.z[eta]) ** 2).sum() + np.trace(H @ state.covariance[eta, eta] @ H.T)
        return float(np.hypot(self.estimator.noise, SAG * square / self.estimator.model.length))

    def _jumped(self, state: MovingState) -> Gaussian:
        """The distribution if actuators were not where their commands are: cables that are slack for a moment."""
        covariance, n_z = state.covariance.copy(), len(state.by_slip)
        by_jump = state.by_slip * self.jump
        covariance[:n_z, :n_z] += by_jump @ by_jump.T
        return Gaussian(state.distribution.mean, covariance)

    def _answer(self, minimum: Minimum, shown: Gaussian) -> Estimate:
        """The estimate of the whole robot, from the distribution of the numbers that markers show."""
        n_a, n_q, y, P = self.motion.n_a, self.motion.n_q, shown.mean, shown.covariance
        reported = np.r_[0:n_a, n_q : len(y) - 1]
        unseen = np.sqrt(np.diag(P)) > UNSEEN * self.scale
        return Estimate(
            minimum.status,
            y[:n_a],
            y[n_q:-1],
            P[np.ix_(reported, reported)],
            self.markers.modes(y)[0],
            self.effectors(y),
            minimum.outliers,
            tuple(name for name, weak in zip(self.unknowns, unseen, strict=True) if weak),
            minimum.noise,
            minimum.iterations,
            minimum.misfit,
        )

    def effectors(self, y: np.ndarray) -> np.ndarray:
        """Displacements (n_e,) mm of the effectors, with inner motions and loads, at the numbers y (n,) that markers
        show."""
        n_a, n_q, estimator = self.motion.n_a, self.motion.n_q, self.estimator
        part, (H, E) = self.motion.static.parts(y[:n_a], y[:0]), self.motion.paths(y[:n_a])
        w, eta = y[n_q:-1] * np.exp(-y[-1]), y[n_a:n_q]
        delta_e = part["effector"] + H @ eta + (0.0 if E is None else E @ eta @ eta / 2)
        if not len(w):
            return delta_e
        rows, n_e = estimator.loaded_rows, len(H)
        locked, paths = part["effector_compliance"], H
        if (rows >= n_e).any():
            locked = np.hstack([locked, estimator.model.skin.compliance(y[:n_a], estimator.material[0])[0]])
            paths = self.motion.skin(y[:n_a])[0]
        return delta_e + (locked[:, rows] - H @ paths[rows].T / self.motion.stiffness) @ w


def _near(values: np.ndarray, box: np.ndarray) -> bool:
    """True where values (n,) are finite and at most the width of the box (n, 2) away from it."""
    low, high = box.T
    return bool(((values > 2 * low - high) & (values < 2 * high - low)).all())
