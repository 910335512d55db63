"""A controller that sees markers: what is estimated from them takes the place of measured effectors and actuators.

Each sample is estimated once, with the parameters that an adaptive controller uses at that time and from the commands
of its tick: displacements tell the filter how the actuators have moved, forces how the model yields to them."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cfem.control.closed_loop.estimated_spec import LoopEstimateSpec
from cfem.control.closed_loop.feedback import HISTORY
from cfem.control.closed_loop.run import TickedController
from cfem.control.closed_loop.spec import LoopSpec
from cfem.motion.estimation.marker_filter import MarkerFilter
from cfem.motion.estimation.uncertainty import motion_uncertainty
from cfem.motion.model import MotionModel
from cfem.plant.marker_noise import MarkerNoise
from cfem.plant.protocol import Measurement
from cfem.predict.estimation.answer import Estimate
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.filter import Filter, filter_of
from cfem.predict.estimation.spec import estimator_of
from cfem.predict.protocol import Predictor


@dataclass(frozen=True)
class Estimated(Measurement):
    """Measurement that is estimated. by_loads (n_e,) mm: the share of x_e that the estimated loads make."""

    by_loads: np.ndarray = field(default_factory=lambda: np.zeros(0))


def loop_filter(loop: LoopSpec, model: Predictor, motion: MotionModel | None) -> Filter | MarkerFilter:
    """Filter for a run with `loop.estimate`. motion: of the same model, where the filter is one on the dynamics."""
    spec, rate = loop.estimate, loop.rate / loop.ticks_a_sample
    if motion is None:
        return filter_of(spec, model, rate)
    uncertainty = motion_uncertainty(spec, model, rate)
    return MarkerFilter(estimator_of(spec, model), motion, loop.command.kind, uncertainty, spec.gate)


def camera_of(spec: LoopEstimateSpec | None, seed: int) -> MarkerNoise | None:
    """Camera of a simulated robot, which loses and mistakes markers; None without an estimate."""
    if spec is None:
        return None
    sensors = spec.actuators.displacement, spec.actuators.force
    return MarkerNoise(spec.noise, spec.lost, spec.wrong, spec.astray, sensors, seed)


class EstimatingController:
    """Controller of measured effectors behind an estimator, which takes samples with markers.

    inner: the controller
    estimate: the last estimate, None before the first sample
    sample_tick: tick of its sample"""

    def __init__(
        self,
        inner: TickedController,
        filtered: Filter | MarkerFilter,
        rest_e: np.ndarray,
        by_displacement: bool,
        period: float,
    ):
        """by_displacement: whether commands are displacements; period: s of a tick."""
        self.inner, self._filter, self._rest_e, self._by_displacement = inner, filtered, rest_e, by_displacement
        self._period = period
        self._sent: dict[int, np.ndarray] = {}
        self._tick = self.sample_tick = 0
        self.estimate: Estimate | None = None
        self._last: Estimated | None = None

    @property
    def estimator(self) -> Estimator:
        return self._filter.estimator

    @property
    def belief(self) -> Any:
        return self.inner.belief

    @property
    def aimed(self) -> np.ndarray:
        return self.inner.aimed

    @property
    def feedback(self) -> Any:
        return self.inner.feedback

    def tick(self, goal: ArrayLike, measured: Measurement | None = None, ahead: ArrayLike | None = None) -> Any:
        """Tick of the inner controller, on a sample with markers."""
        self._tick += 1
        belief = self.inner.tick(goal, None if measured is None else self.estimated(measured), ahead)
        self._sent[self._tick] = belief.u
        self._sent.pop(self._tick - HISTORY, None)
        return belief

    def estimated(self, measured: Measurement) -> Measurement:
        """Sample as the inner controller receives it, estimated when it is first asked for."""
        if measured.t > self.sample_tick and measured.markers is not None:
            self._last = self._new(measured)
        return self._last or replace(measured, x_e=np.full(len(self._rest_e), np.nan))

    def _new(self, measured: Measurement) -> Estimated:
        """Estimate of a new sample, as a measurement; NaN where it has not converged."""
        tracker, filtered = getattr(self.inner, "tracker", None), self._filter
        if tracker is not None:
            filtered.estimator = filtered.estimator.at(tracker.used_p)
        self.estimate = estimate = self._filtered(measured)
        self._sent = {tick: u for tick, u in self._sent.items() if tick > measured.t}
        self.sample_tick = measured.t
        nothing = np.full(len(self._rest_e), np.nan)
        x_e, by_loads = nothing, nothing
        if estimate.converged:
            x_e = self._rest_e + estimate.delta_e
            response = filtered.estimator.response(estimate.delta_a)
            by_loads = (response.locked if self._by_displacement else response.held) @ estimate.loads
        delta_a = estimate.delta_a if estimate.converged else np.full(len(estimate.delta_a), np.nan)
        plain = vars(replace(measured, x_e=x_e, delta_a=delta_a))
        return Estimated(**plain, by_loads=by_loads)

    def _filtered(self, measured: Measurement) -> Estimate:
        filtered, sent = self._filter, self._sent.get(measured.t)
        if isinstance(filtered, Filter):
            actuation = {"commanded" if self._by_displacement else "driven": sent}
            return filtered.tick(measured.markers, measured.delta_a, forces=measured.lambda_a, **actuation)
        for tick in range(self.sample_tick + 1, measured.t + 1):
            filtered.predict(self._sent.get(tick), self._period)
        return filtered.correct(measured.markers, measured.delta_a, sent)
