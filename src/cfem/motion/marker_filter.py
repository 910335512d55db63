"""Where a moving robot is, how it moves and who pushes it, from markers on its skin: an iterated extended Kalman filter
on the condensed dynamics (Bell and Cathey, IEEE Trans. Automatic Control 38, 1993).

Unknown are positions q and momenta p of the actuators' displacements and of the inner motions, the memory of viscous
terms, forces w on chosen rows and the logarithm of the stiffness over the model's. What is known of them is carried
forward (marked_steps.py). As markers tell of q, w and the stiffness alone (moving_markers.py), each frame is a
least-squares problem of these (`cfem.predict.estimate_fit`); the rest follows by its covariance with them.

A frame that does not fit what is known before it is rejected (`cfem.predict.gate`). After a run of these, and of frames
without an estimate, everything before is forgotten."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from cfem.core.errors import InputError, NumericalError
from cfem.motion.clocked import State
from cfem.motion.linear import Kind
from cfem.motion.marked_steps import Known, MarkedSteps, Unknown
from cfem.motion.model import MotionModel
from cfem.motion.moving_markers import MovingMarkers
from cfem.predict import estimate_fit as fit
from cfem.predict.estimate import UNSEEN, Estimator
from cfem.predict.estimate_answer import Estimate
from cfem.predict.estimate_fit import EstimateStatus, Minimum, Residuals, Sensor
from cfem.predict.gate import Gate, GateSpec, Verdict

FAR = 8.0  # standard deviations of unknowns within which they are looked for
SAG = 0.5  # of the square of a swing over the length of the robot: how far its arc is from a line
JUMP = 0.05  # of the reach: of an actuator that is not where its command is


class MarkerFilter:
    """kind: what is commanded; where nobody knows commands, displacements that slip.

    known: after the last frame, None before the first; scale (n,), box (n, 2): of what markers tell, and where it is
    looked for; swing: an amplitude of inner motions at the start; last: what markers tell, and its covariance, of the
    last frame"""

    def __init__(
        self,
        estimator: Estimator,
        motion: MotionModel,
        kind: Kind,
        unknown: Unknown,
        gate: GateSpec | None = None,
    ):
        self.gate = Gate.of(gate or GateSpec())
        self.estimator, self.motion, self.kind, self.unknown = estimator, motion, kind, unknown
        self.markers = MovingMarkers(estimator, motion)
        self.forward = MarkedSteps(estimator, motion, kind, unknown)
        n_a, n_q, n_z, n_w = motion.n_a, motion.n_q, self.forward.n_z, len(estimator.loaded)
        self._told = np.r_[0:n_q, n_z : n_z + n_w + 1]  # what markers tell, of all numbers
        self._rest = np.setdiff1d(np.arange(n_z + n_w + 1), self._told)
        H = motion.paths(estimator.middle[:n_a])[0][:3]
        self.swing = unknown.swing / np.sqrt((H**2).sum())  # an amplitude
        swings, soft = np.full(motion.n_r, self.swing), max(unknown.stiffness, 1e-6)
        self.scale = np.r_[estimator.scale[:n_a], swings, estimator.scale[n_a:], soft]
        far = FAR * np.r_[swings, soft]
        low, high = (
            np.r_[box[:n_a], sign * far[:-1], box[n_a:], sign * far[-1]]
            for sign, box in zip((-1, 1), estimator.box.T, strict=True)
        )
        self.box = np.stack([low, high], axis=1)
        self.known: Known | None = None
        self.last: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def unknowns(self) -> tuple[str, ...]:
        """(n,) names of what markers tell."""
        n_a, swings = self.motion.n_a, (f"swing.{number}" for number in range(1, self.motion.n_r + 1))
        return (*self.estimator.unknowns[:n_a], *swings, *self.estimator.loaded, "stiffness")

    def tick(
        self,
        measured: ArrayLike,
        sensed: ArrayLike | None = None,
        commanded: ArrayLike | None = None,
        after: float = 0.0,
    ) -> Estimate:
        """A frame, `after` seconds behind the last one. measured (m, 3) mm, nan for a marker that is missing; sensed
        (n_a,) mm of the actuators; commanded (n_a,): reached now, evenly from what was before; None where nobody
        knows. Never raises for what the numbers are."""
        self.advance(commanded, after)
        return self.see(measured, sensed, commanded)

    def advance(self, commanded: ArrayLike | None, time: float) -> None:
        """To `time` s later, without a frame. A motion that is lost is forgotten."""
        if self.known is None:
            return
        u = self.known.state.u if commanded is None else np.asarray(commanded, float)
        try:
            self.known = self.forward(self.known, u, time)
        except (NumericalError, np.linalg.LinAlgError):
            self.known = None

    def see(self, measured: ArrayLike, sensed: ArrayLike | None = None, commanded: ArrayLike | None = None) -> Estimate:
        """Corrects by a frame of now."""
        where, there = self.estimator.from_rest(np.asarray(measured, float))
        begins = self.known is None
        if self.known is None:
            self.known = self._first(measured, sensed, commanded)
            self.gate.restart()
        known, sensors = self.known, self._sensors(sensed)
        noise, mean = self._noise(), self._mean(known)

        def missing(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            value, by_y = self.markers.seen(y)
            return (value.reshape(-1, 3) - where) / noise, by_y.reshape(*where.shape, -1) / noise

        def fitted(covariance: np.ndarray) -> Minimum:
            before = fit.Known(mean, _root(covariance[np.ix_(self._told, self._told)]))
            problem = Residuals(missing, there, before, sensors)
            return fit.minimise(problem, mean, self.scale, self.box, lambda: mean)

        covariance = known.covariance
        found = fitted(covariance)
        if not _good(found) or (there & ~found.kept).any() or not self._likely(found):
            wider = self._jumped(known)
            other = fitted(wider)
            better = other.kept.sum() > found.kept.sum() or (self._likely(other) and not self._likely(found))
            if _good(other) and (not _good(found) or better):
                found, covariance = other, wider
        verdict = Verdict.ACCEPTED if begins else self.gate.judge(*_judged(found))
        if verdict is Verdict.RESTART:
            self.known = None
            return self.see(measured, sensed, commanded)
        P = covariance[np.ix_(self._told, self._told)]
        if _good(found) and verdict is Verdict.REJECTED:
            found = replace(found, status=EstimateStatus.REJECTED)
        if _good(found):
            scaled = found.J * self.scale
            P = np.linalg.inv(scaled.T @ scaled) * np.outer(self.scale, self.scale)
            self.known = self._corrected(replace(known, covariance=covariance), found.x, mean, P)
        return self._answer(found, self._mean(self.known), P, there)

    def _likely(self, found: Minimum) -> bool:
        """Whether the gate would hear a frame."""
        square, numbers = _judged(found)
        return numbers < 1 or self.gate.deviate(square, numbers) <= self.gate.sigmas

    def _sensors(self, sensed: ArrayLike | None) -> tuple[Sensor, ...]:
        if sensed is None or not np.isfinite(sensed).any():
            return ()
        numbers, n_a = np.asarray(sensed, float), self.motion.n_a
        unit = np.eye(n_a, len(self.scale))
        return (Sensor(lambda y: (y[:n_a], unit), numbers, self.estimator.sensor, np.isfinite(numbers)),)

    def _mean(self, known: Known) -> np.ndarray:
        """Of what markers tell."""
        return np.r_[known.state.z[: self.motion.n_q], known.loads, known.log]

    def _first(self, measured: ArrayLike, sensed: ArrayLike | None, commanded: ArrayLike | None) -> Known:
        """Before the first frame: about where it is told, or where a robot at rest would be."""
        n_a, n_q, n_z, unknown = self.motion.n_a, self.motion.n_q, self.forward.n_z, self.unknown
        u, n_w = None if commanded is None else np.asarray(commanded, float), len(self.estimator.loaded)
        if u is None and self.kind == "force":
            raise InputError("commanded forces are missing", do="give them in each frame")
        told = u is not None and self.kind == "displacement"
        delta_a = u if told else self.estimator.estimate(measured, sensed).delta_a
        P = np.zeros((n_z + n_w + 1,) * 2)
        P[range(n_a), range(n_a)] = np.square(unknown.offset if told else 3.0 * self.estimator.scale[:n_a])
        P[range(n_a, n_q), range(n_a, n_q)] = self.swing**2
        still = self.motion.at(delta_a).M[n_a:, n_a:]
        P[n_q + n_a : 2 * n_q, n_q + n_a : 2 * n_q] = self.swing**2 * self.motion.stiffness * still
        P[n_z:-1, n_z:-1] = self.estimator.load_covariance
        P[-1, -1] = unknown.stiffness**2
        state = State(np.r_[delta_a, np.zeros(n_z - n_a)], np.zeros(n_q), delta_a if u is None else u)
        return Known(state, np.zeros(n_w), 0.0, P, np.zeros((n_z, n_a)))

    def _noise(self) -> float:
        """mm of a marker's coordinate: the camera's, and the sag u^2 / (2 length) of an arc on which the effectors
        swing by u, which the skin's model does not have."""
        eta, known = slice(self.motion.n_a, self.motion.n_q), self.known
        H = self.motion.paths(known.state.z[: self.motion.n_a])[0][:3]
        square = ((H @ known.state.z[eta]) ** 2).sum() + np.trace(H @ known.covariance[eta, eta] @ H.T)
        return float(np.hypot(self.estimator.noise, SAG * square / self.estimator.model.length))

    def _jumped(self, known: Known) -> np.ndarray:
        """The covariance if actuators were not where their commands are: cables that are slack for a moment."""
        found, by_jump = known.covariance.copy(), JUMP * known.by_slip * self.estimator.scale[: self.motion.n_a]
        found[: len(by_jump), : len(by_jump)] += by_jump @ by_jump.T
        return found

    def _corrected(self, known: Known, y: np.ndarray, mean: np.ndarray, P: np.ndarray) -> Known:
        """y: what markers tell of, P: its covariance, both after the frame."""
        told, rest, n_q = self._told, self._rest, self.motion.n_q
        new, before = known.covariance.copy(), known.covariance[np.ix_(told, told)]
        gain = new[np.ix_(rest, told)] @ _inverse(before)
        new[np.ix_(told, told)] = P
        new[np.ix_(rest, told)] = gain @ P
        new[np.ix_(told, rest)] = new[np.ix_(rest, told)].T
        new[np.ix_(rest, rest)] += gain @ (P - before) @ gain.T
        z = known.state.z.copy()
        z[rest] += gain @ (y - mean)
        z[:n_q] = y[:n_q]
        state = State(z, known.state.v, known.state.u)
        return Known(state, y[n_q:-1], float(y[-1]), (new + new.T) / 2, known.by_slip)

    def _answer(self, found: Minimum, y: np.ndarray, P: np.ndarray, there: np.ndarray) -> Estimate:
        n_a, n_q = self.motion.n_a, self.motion.n_q
        s, _ = self.markers.modes(y)
        own, marker, self.last = np.r_[0:n_a, n_q : len(y) - 1], found.r[: 3 * int(found.kept.sum())], (y, P)
        weak = np.sqrt(np.diag(P)) > UNSEEN * self.scale
        return Estimate(
            found.status,
            y[:n_a],
            y[n_q:-1],
            P[np.ix_(own, own)],
            s,
            self._effectors(y),
            tuple(int(number) for number in np.flatnonzero(there & ~found.kept)),
            tuple(name for name, one in zip(self.unknowns, weak, strict=True) if one),
            float(np.sqrt(np.mean(marker**2))) if len(marker) else 0.0,
            found.iterations,
            found.innovation,
        )

    def _effectors(self, y: np.ndarray) -> np.ndarray:
        n_a, n_q, estimator = self.motion.n_a, self.motion.n_q, self.estimator
        part, (H, E) = self.motion.static.parts(y[:n_a], y[:0]), self.motion.paths(y[:n_a])
        w, eta = y[n_q:-1] * np.exp(-y[-1]), y[n_a:n_q]
        found = part["effector"] + H @ eta + (0.0 if E is None else E @ eta @ eta / 2)
        if not len(w):
            return found
        rows, n_e = estimator.loaded_rows, len(H)
        locked, paths = part["effector_compliance"], H
        if (rows >= n_e).any():
            locked = np.hstack([locked, estimator.model.skin.compliance(y[:n_a], estimator.material[0])[0]])
            paths = self.motion.skin(y[:n_a])[0]
        return found + (locked[:, rows] - H @ paths[rows].T / self.motion.stiffness) @ w


def _good(found: Minimum) -> bool:
    return found.status is EstimateStatus.CONVERGED and bool(np.isfinite(found.J).all())


def _judged(found: Minimum) -> tuple[float, int]:
    """Square of the innovation, and of how many numbers, as a gate is told it."""
    if found.status is EstimateStatus.TOO_FEW:
        return 0.0, 0
    return found.innovation if _good(found) else (np.inf, 1)


def _root(P: np.ndarray) -> np.ndarray:
    """(n, n) whose product with an error of covariance P has unit covariance; scaled, so that units do not matter."""
    size = np.sqrt(np.maximum(np.diag(P), 1e-18))
    lower = np.linalg.cholesky(P / np.outer(size, size) + 1e-12 * np.eye(len(P)))
    return np.linalg.solve(lower, np.diag(1 / size))


def _inverse(P: np.ndarray) -> np.ndarray:
    root = _root(P)
    return root.T @ root
