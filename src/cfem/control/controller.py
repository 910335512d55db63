"""One tick of control over time: a goal, corrected by what the sensors say of earlier ticks, becomes a command.

Closed, the goal is moved by K_P e + K_I sum(e) (the paper's PI; a sum over samples, no time step), e being what the
robot still owes at the tick of a sample. A sample counts once, when it arrives. Anti-windup is by back-calculation
(Astrom and Hagglund 1995, section 3.5), the model telling what the command could not do: with the effectors x' that the
model expected and the correction c of that tick,

    e = x' - c - sample

which is goal - sample where the model got to the corrected goal, and grows no further where bounds, rates, a robot that
cannot get there, or a search of one step a tick have kept it away."""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed.far import doubt
from cfem.control.tick import Belief, Pilot, drive
from cfem.core.errors import InputError, NumericalError, SpecError
from cfem.plant.protocol import Measurement


@dataclass(frozen=True)
class Gains:
    """proportional, integral: dimensionless; bound: mm, longest that K_I sum(e) may become."""

    proportional: float
    integral: float
    bound: float = np.inf


class Correction:
    """The PI term. total: (n_e,) mm, K_I sum(e)."""

    def __init__(self, gains: Gains, n_e: int):
        self._gains, self.total = gains, np.zeros(n_e)

    def after(self, error: np.ndarray) -> np.ndarray:
        """(n_e,) mm to move the goal by, error (n_e,) being the latest."""
        total = self.total + self._gains.integral * error
        length = float(np.linalg.norm(total))
        self.total = total * min(1.0, self._gains.bound / length) if length > 0 else total
        return self._gains.proportional * error + self.total


class Controller:
    """Open or closed loop control of one robot, tick by tick.

    belief: what the controller knows after its last tick; aimed: (n_e,) mm, the corrected goal of that tick."""

    def __init__(
        self,
        pilot: Pilot,
        rest_e: np.ndarray,
        gains: Gains | None = None,
        start: np.ndarray | None = None,
        far: np.ndarray | None = None,
    ):
        """rest_e: (n_e,) mm, where the effectors rest; gains: None for open loop; start: (n_a,) mm where the actuators
        stand, the model's home or 0 unless given; far: (n_e,) mm from rest, of `far_of`, beyond which goals of others
        are in another unit, unchecked unless given."""
        self._pilot, self._rest_e = pilot, rest_e
        self._correction = Correction(gains, len(rest_e)) if gains else None
        self._far = np.full(len(rest_e), np.inf) if far is None else far
        self._moved, self._expected = np.zeros(len(rest_e)), {}
        self._tick = self._heard = 0
        home = getattr(pilot.model, "home", np.zeros(len(pilot.ridge)))
        self.belief = Belief.at(pilot, home if start is None else np.asarray(start, float))
        self.aimed = self._rest_e + self.belief.iterate.condensed.delta_e

    def pass_to(self, share: float) -> None:
        """What moves in the model's world goes to where it is at this share of the run. Where the model has no answer,
        it is what the next tick says."""
        model, at = self._pilot.model, self.belief.iterate
        if not getattr(model, "passes", False):
            return
        with suppress(NumericalError):
            model.pass_to(share)
            condensed = model.at_displacement(at.condensed.delta_a)
            self.belief = replace(self.belief, iterate=replace(at, condensed=condensed))

    def tick(
        self,
        goal: ArrayLike,
        measured: Measurement | None = None,
        ahead: ArrayLike | None = None,
        let_go: bool = False,
    ) -> Belief:
        """goal: (n_e,) mm absolute, rotation vectors in rad; measured: the latest sample, whose t is the number of the
        command that it followed, 1 for the first; ahead: goals to come, which this controller does not use; let_go: the
        robots put their object down there and open. The command is `u` of the answer: (n_a,), mm (mm^3) or N (MPa).
        InputError for a goal so far away that it is in another unit."""
        goal = np.asarray(goal, float)
        if goal.shape != self._rest_e.shape or not np.isfinite(goal).all():
            raise SpecError(f"expected {len(self._rest_e)} finite numbers, got {goal.tolist()}", where="goal")
        strange = doubt(goal, self._rest_e, self._far)
        if strange:
            raise InputError(f"the goal {goal.tolist()} {strange}", do="give it in mm, in the frame of the scene")
        self._tick += 1
        if self._correction and measured is not None and measured.t > self._heard:
            if measured.t not in self._expected:
                what = f"the sample is of tick {measured.t}, and {self._tick - 1} commands were given"
                raise InputError(what, do="number the samples by the command that they follow, from 1 on")
            self._heard = measured.t
            error = np.where(self._pilot.weights > 0, self._expected[measured.t] - measured.x_e, 0.0)
            self._expected = {tick: x for tick, x in self._expected.items() if tick > measured.t}
            if np.isfinite(error).all():
                self._moved = self._correction.after(error)
        self.aimed = goal + self._moved
        pilot = self._pilot
        if self._tick == 1 and pilot.approach is not None:
            pilot = replace(pilot, settings=pilot.approach)
        self.belief = drive(pilot, self.belief, self.aimed - self._rest_e, measured, let_go)
        if hasattr(pilot.model, "settle"):  # contact depends on the way
            pilot.model.settle(self.belief.iterate.condensed.delta_a)
        if self._correction:
            self._expected[self._tick] = self._rest_e + self.belief.iterate.condensed.delta_e - self._moved
        return self.belief
