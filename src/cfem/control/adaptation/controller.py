"""A controller whose model follows the robot: parameters are tracked from the samples of the effectors."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed.model import under_force
from cfem.control.adaptation.tracker import Tracker
from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.estimated import Estimated
from cfem.control.closed_loop.feedback import HISTORY
from cfem.control.closed_loop.tick import Belief, Pilot
from cfem.core.errors import NumericalError
from cfem.plant.gains import Gains
from cfem.plant.protocol import Measurement
from cfem.predict.at_parameters import AtParameters


class AdaptiveController(Controller):
    """Controller that tracks the parameters of its model while it works.

    tracker: the filter of the parameters; the model of the pilot, `AtParameters`, changes with what the tracker lets
        through"""

    def __init__(
        self,
        pilot: Pilot,
        rest_e: np.ndarray,
        tracker: Tracker,
        gains: Gains | None = None,
        start: np.ndarray | None = None,
        far: np.ndarray | None = None,
    ):
        """Starts the controller of a `pilot` whose model is at the tracker's parameters; the rest as for
        `Controller`."""
        super().__init__(pilot, rest_e, gains, start, far)
        self.tracker, self._sent, self._sampled = tracker, {}, 0

    def tick(self, goal: ArrayLike, measured: Measurement | None = None, ahead: ArrayLike | None = None) -> Belief:
        """Command of a tick, with the arguments of `Controller.tick`; a new sample first corrects the parameters."""
        before = self.tracker.rejected
        if measured is not None and measured.t > self._sampled and measured.t in self._sent:
            self._sampled = measured.t
            sent, near = self._sent[measured.t]
            self._sent = {tick: command for tick, command in self._sent.items() if tick > measured.t}
            by_loads = measured.by_loads if isinstance(measured, Estimated) else 0.0  # no parameter makes that
            if self.tracker.sample(sent, measured.x_e - by_loads - self._rest_e, near):
                self._changed()
        if measured is not None:
            measured = replace(measured, x_e=self._rest_e + self.tracker.true(measured.x_e - self._rest_e))
        belief = super().tick(goal, measured, ahead)
        rejected = belief.rejected or self.tracker.rejected > before
        sent = replace(belief, u=self._within(belief.u + self.tracker.used_b), rejected=rejected)
        self._sent[self._tick] = sent.u, belief.iterate.condensed
        self._sent.pop(self._tick - HISTORY, None)
        return sent

    def _changed(self) -> None:
        """Takes the tracker's parameters into the model and solves again for the state under the last command. The
        feedback's sum loses what it held for the faults of the model before, as far as the change accounts for it."""
        model, old = self._pilot.model, self.belief.iterate
        assert isinstance(model, AtParameters)
        before, model.p = model.p, self.tracker.used_p
        try:
            now = model.at_displacement(old.condensed.delta_a)
            if self._pilot.command == "force":
                now = under_force(model, self.belief.u, now)
        except NumericalError:  # a robot that the model does not know: it stays what it was
            model.p = before
            return
        self.belief = replace(self.belief, iterate=replace(old, condensed=now))
        if self.feedback:
            shift = np.where(self._pilot.weights > 0, now.delta_e - old.condensed.delta_e, 0.0)
            total = self.feedback.total
            back = np.where(shift * total < 0, np.sign(shift) * np.minimum(np.abs(shift), np.abs(total)), 0.0)
            self.feedback.take_back(back)

    def _within(self, u: np.ndarray) -> np.ndarray:
        limits = self._pilot.limits
        return np.clip(u, *(limits.delta_a.T if self._pilot.command == "displacement" else limits.lambda_a.T))
