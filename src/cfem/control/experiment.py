"""Open-loop tracking: controllers plan with their model, the plant carries out what they command, both are
recorded."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cfem.condensed.model import Model
from cfem.control.inverse import Aim, Limits
from cfem.control.loop import Iterate, Reach, Settings, reach
from cfem.plant.protocol import Measurement, Plant


@dataclass(frozen=True)
class Controller:
    """One way to find actuations: a model, how hard to search with it, and how hard for the first goal, which
    may be far from where the robot starts."""

    name: str
    model: Model
    settings: Settings
    approach: Settings


@dataclass(frozen=True)
class Tracked:
    """One goal, absolute (n_e,) mm, by one controller: what it planned, what the plant did, whether the plan
    stayed inside the model's domain and how far from the training states it is (NaN where nothing was learned); which
    rows (n_e,) matter."""

    controller: str
    index: int
    goal: np.ndarray
    plan: Reach
    measured: Measurement
    inside: bool
    distance: float
    matters: np.ndarray

    @property
    def error(self) -> float:
        """mm between the effectors that the plant reached and the goal, over the rows that matter; NaN where the plant
        failed."""
        return float(np.linalg.norm((self.measured.x_e - self.goal)[self.matters]))


class Tracker:
    """A controller on its way along a trajectory: each goal is searched from where the last one ended."""

    def __init__(
        self,
        controller: Controller,
        limits: Limits,
        weights: np.ndarray,
        ridge: np.ndarray,
        rest_e: np.ndarray,
        preload: float = 0.0,
        damping: np.ndarray | float = 0.0,
    ):
        self._controller, self._limits, self.weights, self._ridge = controller, limits, weights, ridge
        self._rest_e, self._preload, self._settings = rest_e, preload, controller.approach
        self._damping = damping
        home = getattr(controller.model, "home", np.zeros(len(ridge)))
        self._at = Iterate.at(controller.model.at_displacement(home))

    def towards(self, goal: np.ndarray) -> Reach:
        """goal: (n_e,) mm, absolute."""
        aim = Aim(goal - self._rest_e, self.weights, self._ridge, self._preload, self._damping)
        found = reach(self._controller.model, aim, self._limits, self._at, self._settings)
        self._at, self._settings = found.iterate, self._controller.settings
        return found


def follow(
    goals: np.ndarray,
    reference: Controller | None,
    learned: Sequence[Controller],
    plant: Plant,
    tracker: Callable[[Controller], Tracker],
    after: Callable[[int], None] = lambda index: None,
) -> list[Tracked]:
    """Every goal (m, n_e) mm by every controller, each command in the plant.

    reference: a controller whose model is the plant itself (FE-based control); it goes first at each goal, so
    that the plant stands near where the learned controllers send it. Learned controllers plan all goals
    beforehand, undisturbed, as their step is timed. after(index): called when the plant has carried out the
    first controller's command for that goal."""
    plans, tracker_of = {}, {}
    for controller in learned:
        way = tracker_of[controller.name] = tracker(controller)
        plans[controller.name] = [way.towards(goal) for goal in goals]
    if reference:
        way = tracker_of[reference.name] = tracker(reference)
    tracked = []
    for index, goal in enumerate(goals):
        turn = [(reference, way.towards(goal))] if reference else []
        turn += [(controller, plans[controller.name][index]) for controller in learned]
        for place, (controller, plan) in enumerate(turn):
            measured = plant.step(plan.delta_a)
            inside, distance = True, np.nan
            if hasattr(controller.model, "inside"):
                found = plan.iterate.condensed
                inside, distance = controller.model.inside(found), controller.model.distance(found)
            matters = tracker_of[controller.name].weights > 0
            tracked.append(Tracked(controller.name, index, goal, plan, measured, inside, distance, matters))
            if place == 0:
                after(index)
    return tracked
