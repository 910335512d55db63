"""One tick of control over time: a goal, corrected by what the sensors say of earlier ticks, becomes a command.

Closed, the goal is moved by K_P e + K_I sum(e) (the paper's PI; a sum over samples, no time step), e being what the
robot still owes at the tick of a sample (`cfem.control.closed_loop.feedback`)."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed.far import demand_near
from cfem.condensed.model import PathDependent
from cfem.control.closed_loop.feedback import Feedback
from cfem.control.closed_loop.tick import Belief, Pilot, drive
from cfem.core.errors import InputError, NumericalError, SpecError
from cfem.plant.gains import Gains
from cfem.plant.protocol import Measurement


class Controller:
    """Open or closed loop control of one robot, tick by tick.

    belief: what the controller knows after its last tick
    aimed: (n_e,) mm, the corrected goal of that tick
    feedback: the correction, None in open loop"""

    def __init__(
        self,
        pilot: Pilot,
        rest_e: np.ndarray,
        gains: Gains | None = None,
        start: np.ndarray | None = None,
        far: np.ndarray | None = None,
    ):
        """Starts where the actuators stand.

        rest_e: (n_e,) mm, where the effectors rest
        gains: of the correction, None for open loop
        start: (n_a,) mm where the actuators stand, the model's home or 0 unless given
        far: (n_e,) mm from rest, of `far_of`, beyond which a goal is in another unit and a sample is rejected;
            unchecked unless given"""
        self._pilot, self._rest_e = pilot, rest_e
        self._tick = 0
        self._far = np.full(len(rest_e), np.inf) if far is None else far
        self.feedback = Feedback(gains, pilot.weights > 0, rest_e=rest_e, far=self._far) if gains else None
        home = getattr(pilot.model, "home", np.zeros(len(pilot.ridge)))
        self.belief = Belief.at(pilot, home if start is None else np.asarray(start, float))
        self.aimed = self._rest_e + self.belief.iterate.condensed.delta_e

    def pass_to(self, share: float) -> None:
        """Moves what moves in the model's world to its place at this share of the run. Where the model has no answer,
        it is what the next tick says."""
        model, iterate = self._pilot.model, self.belief.iterate
        if not getattr(model, "passes", False):
            return
        with suppress(NumericalError):
            model.pass_to(share)
            condensed = model.at_displacement(iterate.condensed.delta_a)
            self.belief = replace(self.belief, iterate=replace(iterate, condensed=condensed))

    def tick(
        self,
        goal: ArrayLike,
        measured: Measurement | None = None,
        ahead: ArrayLike | None = None,
        let_go: bool = False,
    ) -> Belief:
        """Belief after one tick towards a goal; its `u` is the command: (n_a,), mm (mm^3) or N (MPa). InputError for a
        goal so far away that it is in another unit, and for a sample that does not say which command it followed.

        goal: (n_e,) mm absolute, rotation vectors in rad
        measured: the latest sample, whose t is the number of the command that it followed, 1 for the first
        ahead: goals to come, which this controller does not use
        let_go: whether the robots put their object down there and open"""
        goal = np.asarray(goal, float)
        if goal.shape != self._rest_e.shape or not np.isfinite(goal).all():
            raise SpecError(f"expected {len(self._rest_e)} finite numbers, got {goal.tolist()}", where="goal")
        demand_near(goal, self._rest_e, self._far)
        if not isinstance(measured, Measurement | None):
            what = f"expected a Measurement, which says what command it followed; got {measured!r:.60}"
            raise InputError(what, where="measured", do="give what plant.step returned, or build a Measurement")
        self._tick += 1
        self.aimed, rejected = goal, False
        if self.feedback:
            if measured is not None:
                self.feedback.sample(measured.t, measured.x_e)
                rejected = self.feedback.rejected
            self.aimed = goal + self.feedback.moved
        pilot = self._pilot
        if self._tick == 1 and pilot.approach is not None:
            pilot = replace(pilot, settings=pilot.approach)
        belief = drive(pilot, self.belief, self.aimed - self._rest_e, measured, let_go)
        self.belief = replace(belief, rejected=rejected)
        if isinstance(pilot.model, PathDependent):
            pilot.model.settle(self.belief.iterate.condensed.delta_a)
        if self.feedback:
            self.feedback.commanded(self._rest_e + self.belief.iterate.condensed.delta_e)
        return self.belief
