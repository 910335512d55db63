"""Estimates over time: an iterated extended Kalman filter (Bell and Cathey, IEEE Trans. Automatic Control 38, 1993).

Each tick is the least-squares problem of `Estimator`, whose prior is the last estimate, predicted to this frame: the
actuators move as they are commanded, and slip a little beside; a load keeps its value for a while and its size for ever
(Gauss-Markov process, Gelb, *Applied Optimal Estimation*, 1974, section 3.8),

    delta_a' = delta_a + (u' - u) + slip     w' = rho w + sqrt(1 - rho^2) largest e     rho = exp(-1 / ticks)

so that directions that no marker sees stay as uncertain as they were at first, and no more. Where forces u are
commanded, actuators move as the model yields to them and to the loads,

    delta_a' = delta_a + W_aa (u' - u) + W_aw (w' - w) + slip

so that a push shows in where they go. The robot is at rest at each tick, to the accuracy of its model: motion faster
than that is not modelled (cfem.motion.estimation.marker_filter).

A frame that does not fit its prior is rejected (`cfem.predict.estimation.gate`). After a run of these, and of frames
without an estimate, the filter begins again."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from cfem.core.errors import InputError
from cfem.predict.estimation.answer import Estimate
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.fit import EstimateStatus, Minimum, Prior
from cfem.predict.estimation.gate import Gate, GateSpec, SampleVerdict
from cfem.predict.estimation.kalman import Gaussian, gated_update
from cfem.predict.estimation.spec import MarkersSpec, estimator_of
from cfem.predict.protocol import Predictor

SLIP, OFFSET = 5e-4, 0.05  # of the reach, where a spec states none
YIELD = 0.1  # of a motion under commanded forces: by how much the model may be wrong


def slip_and_offset(spec: MarkersSpec, model: Predictor) -> tuple[float, float]:
    """Standard deviations (mm) of the actuators' slip from frame to frame, and of their first offset."""
    reach = float(np.abs(model.reach).max())
    return spec.actuators.slip or SLIP * reach, spec.actuators.offset or OFFSET * reach


def filter_of(
    spec: MarkersSpec, model: Predictor, rate: float, ticks: float | None = None, p: np.ndarray | None = None
) -> "Filter":
    """Filter of a spec for `rate` frames a second. ticks: frames for which a load lasts, as the spec says unless given;
    p (n_p,): parameters of the model. InputError where the model cannot tell."""
    slip, offset = slip_and_offset(spec, model)
    ticks = max(min(spec.lasts * rate, 1e9), 0.1) if ticks is None else ticks
    return Filter(estimator_of(spec, model, p), slip, ticks, offset, spec.gate)


@dataclass(frozen=True)
class Commanded:
    """What the actuators are commanded at a frame.

    displacement: (n_a,) mm, None where nobody knows
    force: (n_a,) N, None where nobody knows
    """

    displacement: np.ndarray | None
    force: np.ndarray | None


class Filter:
    """Iterated extended Kalman filter of frames of a robot at rest.

    estimator: markers and sensors, and the model of what they show
    slip: mm by which an actuator moves in a tick beside its command (or at all, without commands), standard deviation
    ticks: ticks for which a load lasts
    offset: mm, distance of the actuators from the first command, standard deviation
    gate: of frames that do not fit
    last: the last estimate that was accepted, None before the first
    """

    def __init__(
        self, estimator: Estimator, slip: float, ticks: float, offset: float = 1.0, gate: GateSpec | None = None
    ):
        """Checks the deviations; the first frame begins the filter."""
        if slip <= 0 or ticks <= 0 or offset <= 0:
            raise InputError("slip, the ticks for which a load lasts and the offset must be positive")
        self.estimator, self.slip, self.ticks, self.offset = estimator, slip, ticks, offset
        self.keeps, self.gate = float(np.exp(-1.0 / ticks)), Gate.of(gate or GateSpec())
        self.last: Estimate | None = None
        self._commanded = Commanded(None, None)  # at the last accepted frame

    def tick(
        self,
        measured: ArrayLike,
        sensed: ArrayLike | None = None,
        commanded: ArrayLike | None = None,
        forces: ArrayLike | None = None,
        driven: ArrayLike | None = None,
    ) -> Estimate:
        """The estimate of the next frame. Never raises for what the numbers are.

        measured, sensed, forces: as for `Estimator.estimate`; commanded (n_a,) mm, or driven (n_a,) N where forces are
        commanded, None where nobody knows. An estimate that was rejected or did not converge is not carried forward."""
        command = Commanded(*(None if given is None else np.asarray(given, float) for given in (commanded, driven)))

        def update(prior: Prior) -> Minimum:
            return self.estimator.minimum(measured, sensed, forces, prior, prior.mean)

        predicted = None if self.last is None else self._predicted(self.last, command)
        minimum, verdict = gated_update(self.gate, predicted, lambda: self._first(command), update)
        estimate = self.estimator.answer(minimum)
        if verdict is SampleVerdict.REJECTED:
            return replace(estimate, status=EstimateStatus.REJECTED) if estimate.converged else estimate
        if verdict is SampleVerdict.RESTART:
            self.last = None
        if estimate.converged and np.isfinite(estimate.covariance).all():
            self.last, self._commanded = estimate, command
        return estimate

    def _first(self, command: Commanded) -> Prior:
        """The prior without a frame before: the actuators are near their command, where that is known."""
        before, u = self.estimator.before, command.displacement
        if u is None:
            return before
        n_a = len(u)
        root = np.vstack([before.root, np.eye(n_a, len(before.mean)) / self.offset])
        return Prior(np.concatenate([u, before.mean[n_a:]]), root)

    def _predicted(self, last: Estimate, command: Commanded) -> Prior:
        """The prior after the frame of `last` and a step to the new command."""
        n_a, n_w, keeps, before = len(last.delta_a), len(last.loads), self.keeps, self._commanded
        moved, compliance = np.zeros(n_a), np.zeros((n_a, n_w))  # of the actuators, by commands and to loads
        if command.displacement is not None and before.displacement is not None:
            moved = command.displacement - before.displacement
        slip = self.slip**2 * np.eye(n_a)
        if command.force is not None and before.force is not None:
            response = self.estimator.response(last.delta_a)
            compliance = response.actuators
            moved = response.state.W_aa @ (command.force - before.force)
            slip += YIELD**2 * np.outer(moved, moved)
        mean = np.concatenate([last.delta_a + moved - (1 - keeps) * compliance @ last.loads, keeps * last.loads])
        F = np.diag(np.r_[np.ones(n_a), np.full(n_w, keeps)])
        F[:n_a, n_a:] = (keeps - 1) * compliance
        by_load = np.vstack([compliance, np.eye(n_w)])
        Q = (1 - keeps**2) * by_load @ self.estimator.load_covariance @ by_load.T
        Q[:n_a, :n_a] += slip
        state = Gaussian(np.concatenate([last.delta_a, last.loads]), last.covariance)
        return state.predicted(mean, F, Q).prior
