"""Open-loop tracking: controllers plan a goal a tick, the plant carries out what they plan, both are recorded."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from cfem.condensed.model import KnowsDomain, Timed
from cfem.condensed.model_error import KnowsError
from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.tick import Pilot
from cfem.control.search.goal_search import SearchResult
from cfem.plant.protocol import Measurement, Plant


@dataclass(frozen=True)
class Tracked:
    """One goal by one pilot.

    controller: name of the pilot
    goal: (n_e,) mm absolute
    plan: what the pilot planned
    measured: what the plant did
    inside: whether the plan stayed inside the model's domain
    distance: of the plan from the training states, NaN where nothing was learned
    matters, turning: (n_e,) the rows that matter as places, and as rotations"""

    controller: str
    index: int
    goal: np.ndarray
    plan: SearchResult
    measured: Measurement
    inside: bool
    distance: float
    matters: np.ndarray
    turning: np.ndarray

    @property
    def error(self) -> float:
        """Error (mm) between the effectors that the plant reached and the goal, over the rows that matter; NaN where
        the plant failed."""
        return float(np.linalg.norm((self.measured.x_e - self.goal)[self.matters]))

    @property
    def rotation_error(self) -> float | None:
        """Error (rad) between the rotation vectors that the plant reached and the goal's, over the rows that matter;
        None where none does."""
        if not self.turning.any():
            return None
        return float(np.linalg.norm((self.measured.x_e - self.goal)[self.turning]))


def follow(
    goals: np.ndarray,
    pilots: Mapping[str, Pilot],
    plant: Plant,
    rest_e: np.ndarray,
    judge: tuple[str, Controller] | None = None,
    after: Callable[[int], None] = lambda index: None,
    let_go: bool = False,
    first: int = 0,
) -> Iterator[list[Tracked]]:
    """Every goal (m, n_e) mm by every pilot, whose command is a displacement; each plan in the plant as it is.

    judge: name of the pilot whose model is the plant itself (FE-based control), and its controller; it goes first at
    each goal, so that the plant stands near where the learned models send it. Learned ones plan all goals beforehand,
    undisturbed, as their step is timed. let_go: robots let their object go at the last goal. first: index of the first
    goal that the plant takes. after(index): called when the plant has carried out the first plan for that goal."""
    reference, controller = judge or (None, None)
    order = sorted(pilots, key=lambda name: name != reference)
    shares = np.linspace(0.0, 1.0, len(goals)) if len(goals) > 1 else np.zeros(1)
    controllers = {name: Controller(pilots[name], rest_e) for name in order if name != reference}
    plans = {name: _planned(planner, goals, shares, let_go) for name, planner in controllers.items()}
    for index, goal in enumerate(goals[first:], first):
        tracked = []
        if isinstance(plant, Timed):
            plant.pass_to(shares[index])
        for place, name in enumerate(order):
            plan = controller.tick(goal).plan if name == reference else plans[name][index]
            measured = plant.step(plan.delta_a, via=plan.via) if plan.via else plant.step(plan.delta_a)
            model, inside, distance = pilots[name].model, True, np.nan
            if isinstance(model, KnowsDomain):
                condensed = plan.iterate.condensed
                inside, distance = model.inside(condensed), model.distance(condensed)
            if isinstance(model, KnowsError) and (stated := model.error(plan.iterate.condensed)) is not None:
                plan = replace(plan, model_error=float(stated.tip))
            matters = pilots[name].weights > 0
            turning = matters & plan.iterate.condensed.rows.turns
            if pilots[name].places is not None:
                matters = matters & pilots[name].places
            tracked.append(Tracked(name, index, goal, plan, measured, inside, distance, matters, turning))
            if place == 0:
                after(index)
        yield tracked


def _planned(controller: Controller, goals: np.ndarray, shares: np.ndarray, let_go: bool) -> list[SearchResult]:
    """Every goal, with what moves in the model's world where it is at that share of the run."""
    plans = []
    for index, (goal, share) in enumerate(zip(goals, shares, strict=True)):
        controller.pass_to(share)
        plans.append(controller.tick(goal, let_go=let_go and index == len(goals) - 1).plan)
    return plans
