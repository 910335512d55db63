"""A trained policy as the controller of a loop: from the measured effector, the last command and the goal to the next
command, without an inverse step."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cfem.control.design import Bound
from cfem.control.loop import ReachStatus
from cfem.control.tick import Belief, Pilot
from cfem.core.errors import InputError
from cfem.gym.policy import Policy
from cfem.plant.protocol import Measurement


class PolicyController:
    """Has the interface of `cfem.control.controller.Controller`. pilot: its model tells where the robot is before the
    first sample, and limits bound commands; rest_e: (n_e,) mm. InputError for a policy of another robot."""

    def __init__(self, pilot: Pilot, rest_e: np.ndarray, policy: Policy, start: np.ndarray | None = None):
        rows = pilot.model.rows
        policy.demand_robot(rows.effectors, rows.actuators)
        if pilot.command != "displacement":
            raise InputError("policies command displacements", where=str(policy.path), do="set command.kind so")
        self._pilot, self._rest_e, self._policy = pilot, rest_e, policy
        self._told = policy.told(_parameters(pilot.model, policy))
        self.belief = Belief.at(pilot, np.zeros(rows.n_a) if start is None else np.asarray(start, float))
        self.aimed = rest_e + self.belief.iterate.condensed.delta_e
        self._tip = self.aimed - rest_e

    def tick(self, goal: ArrayLike, measured: Measurement | None = None, ahead: ArrayLike | None = None) -> Belief:
        """As of `Controller`; ahead (k, n_e): the goals of this tick and of the next ones, as far as they are known."""
        goal = np.asarray(goal, float)
        if measured is not None and np.isfinite(measured.x_e).all():
            self._tip = measured.x_e - self._rest_e
        goes_on = np.zeros_like(goal) if ahead is None or len(ahead) < 2 else np.asarray(ahead, float)[1] - goal
        u = self._policy.command(self._tip, self.belief.u, goal - self._rest_e, goes_on, self._told)
        rate, (low, high) = self._pilot.rate, self._pilot.limits.delta_a.T
        u = np.clip(np.clip(u, self.belief.u - rate, self.belief.u + rate), low, high)
        self.aimed = goal
        at = self._pilot.model.at_displacement(u)
        self.belief = Belief(self.belief.iterate.moved(at), u, ReachStatus.CONVERGED.value)
        return self.belief


def _parameters(model: Any, policy: Policy) -> np.ndarray:
    """(n_p,) of the robot that the model is of: a design's, or the scene's own. InputError where the model does not
    have those that the policy wants to be told."""
    if not policy.parameters:
        return np.zeros(0)
    predictor = model.predictor if isinstance(model, Bound) else model
    if predictor.parameters != policy.parameters:
        names = ", ".join(one.name for one in policy.parameters)
        what = f"is a policy of other parameters than the model's: {names}, with ranges of their own"
        raise InputError(what, where=str(policy.path), do="train it on this model")
    return model.p if isinstance(model, Bound) else np.array([one.reference for one in policy.parameters])
