"""Open-loop tracking: controllers plan a goal a tick, the plant carries out what they plan, both are recorded."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cfem.control.controller import Controller
from cfem.control.loop import Reach
from cfem.control.tick import Pilot
from cfem.plant.protocol import Measurement, Plant


@dataclass(frozen=True)
class Tracked:
    """One goal, absolute (n_e,) mm, by one pilot: what it planned, what the plant did, whether the plan
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


def follow(
    goals: np.ndarray,
    pilots: Mapping[str, Pilot],
    plant: Plant,
    rest_e: np.ndarray,
    reference: str | None = None,
    after: Callable[[int], None] = lambda index: None,
    let_go: bool = False,
) -> list[Tracked]:
    """Every goal (m, n_e) mm by every pilot, whose command is a displacement; each plan in the plant as it is.

    reference: name of the pilot whose model is the plant itself (FE-based control); it goes first at each goal, so
    that the plant stands near where the learned models send it. Learned ones plan all goals beforehand, undisturbed,
    as their step is timed. let_go: robots let their object go at
    the last goal. after(index): called when the plant has carried out the first plan for that goal."""
    order = sorted(pilots, key=lambda name: name != reference)
    controllers = {name: Controller(pilots[name], rest_e) for name in order}
    shares = np.linspace(0.0, 1.0, len(goals)) if len(goals) > 1 else np.zeros(1)
    plans = {name: _planned(controllers[name], goals, shares, let_go) for name in order if name != reference}
    tracked = []
    for index, (goal, share) in enumerate(zip(goals, shares, strict=True)):
        if hasattr(plant, "pass_to"):
            plant.pass_to(share)
        for place, name in enumerate(order):
            plan = controllers[name].tick(goal).plan if name == reference else plans[name][index]
            measured = plant.step(plan.delta_a, via=plan.via) if plan.via else plant.step(plan.delta_a)
            model, inside, distance = pilots[name].model, True, np.nan
            if hasattr(model, "inside"):
                found = plan.iterate.condensed
                inside, distance = model.inside(found), model.distance(found)
            matters = pilots[name].weights > 0
            if pilots[name].places is not None:
                matters = matters & pilots[name].places
            tracked.append(Tracked(name, index, goal, plan, measured, inside, distance, matters))
            if place == 0:
                after(index)
    return tracked


def _planned(controller: Controller, goals: np.ndarray, shares: np.ndarray, let_go: bool) -> list[Reach]:
    """Every goal, with what moves in the model's world where it is at that share of the run."""
    plans = []
    for index, (goal, share) in enumerate(zip(goals, shares, strict=True)):
        controller.pass_to(share)
        plans.append(controller.tick(goal, let_go=let_go and index == len(goals) - 1).plan)
    return plans
