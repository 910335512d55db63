"""Control over time: at every tick the controller turns a goal into a command, and the plant carries it out."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.tick import Belief, MovingBelief, Pilot
from cfem.plant.gains import Gains
from cfem.plant.protocol import Measurement, Plant

_FAR = 500  # ticks that a controller is told of ahead


class TickedController(Protocol):
    """What a run asks of a controller: static, adaptive, predictive, a policy, or one behind an estimator."""

    belief: Belief | MovingBelief
    """What the controller takes the robot's state to be, after the last tick."""

    aimed: np.ndarray
    """Goal (n_e,) mm of that tick as corrected."""

    def tick(
        self, goal: np.ndarray, measured: Measurement | None = None, ahead: np.ndarray | None = None
    ) -> Belief | MovingBelief:
        """Belief after a tick towards goal (n_e,) mm; measured: the latest sample; ahead (k, n_e): goals of this tick
        and of the next ones."""
        ...


@runtime_checkable
class Estimates(Protocol):
    """A controller that sees markers, and estimates the effectors from them."""

    def estimated(self, measured: Measurement) -> Measurement:
        """Sample with what is estimated of the effectors."""
        ...


@dataclass(frozen=True)
class Pace:
    """When the next goal is due.

    ticks_a_goal: after so many ticks; None: as soon as the effectors have been within `radius` (mm) for `hold` ticks,
        or after `at_most` ticks
    budget: ticks in all, None: enough for every goal
    approach: at least so many ticks for the first goal
    run_up: goals that do not count, before those that do"""

    radius: float
    hold: int
    ticks_a_goal: int | None = None
    at_most: int = 1000
    budget: int | None = None
    approach: int = 0
    run_up: int = 0


@dataclass(frozen=True)
class Moment:
    """One tick of a run.

    index: number of the goal
    goal, aimed: (n_e,) mm absolute, as asked and as corrected
    belief: after the tick, with the command u, delta_a and status
    measured: what the sensors had measured by its end
    actual: what the plant really did
    error: mm between that and the goal, over the rows that matter
    cpu: s of processor time that the controller took"""

    tick: int
    index: int
    goal: np.ndarray
    aimed: np.ndarray
    belief: Belief | MovingBelief
    measured: Measurement
    actual: Measurement
    error: float
    cpu: float


def run_closed_loop(
    goals: np.ndarray,
    pilot: Pilot,
    plant: Plant,
    rest_e: np.ndarray,
    pace: Pace,
    gains: Gains | None = None,
    start: np.ndarray | None = None,
    after: Callable[[Moment], None] = lambda moment: None,
    controller: TickedController | None = None,
) -> list[Moment]:
    """Moments of a run along goals (m, n_e) mm absolute, one after the other.

    plant: its `actual`, where it has one, is the truth behind its sensors; goals are then reached or missed by it
    gains: of the correction, None for open loop
    start: (n_a,) mm where the actuators stand, 0 unless given
    after: called with the moment at the end of each tick
    controller: another one than the static one of pilot, gains and start, ticked with the goals that lie ahead"""
    matters = pilot.weights > 0
    controller, measured, moments = controller or Controller(pilot, rest_e, gains, start), None, []
    index = spent = held = 0
    while index < len(goals) and (pace.budget is None or len(moments) < pace.budget):
        goal = goals[index]
        begin = time.thread_time()
        belief = controller.tick(goal, measured, _ahead(goals, index, spent, pace))
        cpu = time.thread_time() - begin
        measured = plant.step(belief.u, pilot.command)
        actual = getattr(plant, "actual", None)
        if actual is None:  # nobody knows better than the sensors, or what is estimated from them
            actual = controller.estimated(measured) if isinstance(controller, Estimates) else measured
        error = float(np.linalg.norm((actual.x_e - goal)[matters]))
        moments.append(Moment(len(moments) + 1, index, goal, controller.aimed, belief, measured, actual, error, cpu))
        after(moments[-1])
        spent += 1
        held = held + 1 if error <= pace.radius else 0
        arrived = held >= pace.hold and pace.ticks_a_goal is None
        most = max(pace.ticks_a_goal or pace.at_most, 0 if index else pace.approach)
        if arrived or spent >= most:
            index, spent, held = index + 1, 0, 0
    return moments


def _ahead(goals: np.ndarray, index: int, spent: int, pace: Pace) -> np.ndarray:
    """Goals (k, n_e) mm of this tick and the next ones, as far as the clock tells."""
    if pace.ticks_a_goal is None:
        return goals[index : index + 1]
    most = max(pace.ticks_a_goal, 0 if index else pace.approach)
    later = np.repeat(goals[index + 1 : index + 1 + _FAR], pace.ticks_a_goal, axis=0)
    return np.concatenate([np.repeat(goals[index : index + 1], most - spent, axis=0), later])[:_FAR]
