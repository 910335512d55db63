"""Control over time: at every tick a goal, corrected by what the sensors say of the last ones, becomes a command.

Closed, the goal is moved by K_P e + K_I sum(e) (the paper's PI; a sum over samples, no time step), e being what the
robot still owes at the tick of a sample. A sample counts once, when it arrives. Anti-windup is by back-calculation
(Astrom and Hagglund 1995, section 3.5), the model telling what the command could not do: with the effectors x' that the
model expected and the correction c of that tick,

    e = x' - c - sample

which is goal - sample where the model got to the corrected goal, and grows no further where bounds, rates, a robot that
cannot get there, or a search of one step a tick have kept it away."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cfem.control.plant import Measurement, Plant
from cfem.control.tick import Belief, Pilot, drive


@dataclass(frozen=True)
class Gains:
    """proportional, integral: dimensionless; bound: mm, longest that K_I sum(e) may become."""

    proportional: float
    integral: float
    bound: float = np.inf


@dataclass(frozen=True)
class Pace:
    """When the next goal is due. ticks_a_goal: after so many ticks, None: as soon as the effectors have been within
    radius (mm) for `hold` ticks, or after at_most ticks; budget: ticks in all, None: enough for every goal; approach:
    at least so many for the first."""

    radius: float
    hold: int
    ticks_a_goal: int | None = None
    at_most: int = 1000
    budget: int | None = None
    approach: int = 0


@dataclass(frozen=True)
class Moment:
    """One tick. index: of the goal; goal, aimed: (n_e,) mm absolute, as asked and as corrected; belief: after the
    tick, with the command; measured: what the sensors had said by its end; actual: what the plant really did; error:
    mm between that and the goal, over the rows that matter; cpu: s of processor time that the controller took."""

    tick: int
    index: int
    goal: np.ndarray
    aimed: np.ndarray
    belief: Belief
    measured: Measurement
    actual: Measurement
    error: float
    cpu: float


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


def run_loop(
    goals: np.ndarray,
    pilot: Pilot,
    plant: Plant,
    rest_e: np.ndarray,
    pace: Pace,
    gains: Gains | None = None,
    start: np.ndarray | None = None,
    after: Callable[[int], None] = lambda index: None,
) -> list[Moment]:
    """goals (m, n_e) mm absolute, one after the other; gains: None for open loop; start: (n_a,) mm where the actuators
    stand, 0 unless given. plant.actual, where a plant has it, is the truth behind its sensors; goals are then reached
    or missed by it. after(index): called with the goal of each tick."""
    matters = pilot.weights > 0
    belief = Belief.at(pilot, np.zeros(len(pilot.ridge)) if start is None else start)
    correction = Correction(gains, len(rest_e)) if gains else None
    moved = np.zeros(len(rest_e))
    measured, expected, moments = None, {}, []
    index = spent = held = heard = 0
    while index < len(goals) and (pace.budget is None or len(moments) < pace.budget):
        tick, goal = len(moments) + 1, goals[index]
        begin = time.thread_time()
        if correction and measured is not None and measured.t > heard:
            heard = measured.t
            error = np.where(matters, expected[heard] - measured.x_e, 0.0)
            if np.isfinite(error).all():
                moved = correction.after(error)
        belief = drive(pilot, belief, goal + moved - rest_e, measured)
        cpu = time.thread_time() - begin
        expected[tick] = rest_e + belief.iterate.condensed.delta_e - moved
        measured = plant.step(belief.u, pilot.command)
        actual = getattr(plant, "actual", measured)
        error = float(np.linalg.norm((actual.x_e - goal)[matters]))
        moments.append(Moment(tick, index, goal, goal + moved, belief, measured, actual, error, cpu))
        after(index)
        spent += 1
        held = held + 1 if error <= pace.radius else 0
        arrived = held >= pace.hold and pace.ticks_a_goal is None
        most = max(pace.ticks_a_goal or pace.at_most, 0 if index else pace.approach)
        if arrived or spent >= most:
            index, spent, held = index + 1, 0, 0
    return moments
