"""A trained policy as the controller of a loop: from the measured effector, the last command and the goal to the next
command, without an inverse step."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed.parameters import references
from cfem.control.closed_loop.tick import Belief, MovingBelief, Pilot
from cfem.control.search.goal_search import SearchStatus
from cfem.core.errors import InputError
from cfem.gym.policy import Policy
from cfem.plant.protocol import Measurement
from cfem.predict.at_parameters import AtParameters


class PolicyController:
    """Controller by a policy, with the interface of `cfem.control.closed_loop.controller.Controller`. pilot: its model
    says where the robot is before the first sample, and its limits bound commands; rest_e: (n_e,) mm. InputError for a
    policy of another robot."""

    def __init__(self, pilot: Pilot, rest_e: np.ndarray, policy: Policy, start: np.ndarray | None = None):
        """Starts where the robot stands, at rest unless `start` (n_a,) mm says otherwise."""
        rows = pilot.model.rows
        policy.demand_robot(rows.effectors, rows.actuators)
        _demand_command(pilot, policy)
        self._pilot, self._rest_e, self._policy = pilot, rest_e, policy
        self._shown = policy.told(_parameters(pilot.model, policy))
        self.belief = Belief.at(pilot, np.zeros(rows.n_a) if start is None else np.asarray(start, float))
        self.aimed = rest_e + self.belief.iterate.condensed.delta_e
        self._tip = self.aimed - rest_e

    def tick(self, goal: ArrayLike, measured: Measurement | None = None, ahead: ArrayLike | None = None) -> Belief:
        """Belief after a tick, with the arguments of `Controller.tick`; ahead (k, n_e): the goals of this tick and of
        the next ones, as far as they are known."""
        goal = np.asarray(goal, float)
        if measured is not None and np.isfinite(measured.x_e).all():
            self._tip = measured.x_e - self._rest_e
        goal_step = np.zeros_like(goal) if ahead is None or len(ahead) < 2 else np.asarray(ahead, float)[1] - goal
        u = self._policy.command(self._tip, self.belief.u, goal - self._rest_e, goal_step, self._shown)
        rate, (low, high) = self._pilot.rate, self._pilot.limits.delta_a.T
        u = np.clip(np.clip(u, self.belief.u - rate, self.belief.u + rate), low, high)
        self.aimed = goal
        condensed = self._pilot.model.at_displacement(u)
        self.belief = Belief(self.belief.iterate.moved(condensed), u, SearchStatus.CONVERGED.value)
        return self.belief


class MovingPolicyController:
    """Controller by a policy for robots that move, ticked every dt s, which takes the last few samples and the goals
    ahead. pilot: its limits bound commands; start: where the robot stands, at rest unless given. InputError for a
    policy of another robot or rate."""

    def __init__(self, pilot: Pilot, rest_e: np.ndarray, policy: Policy, start: np.ndarray | None, dt: float):
        """Fills the histories of effectors and commands with the state in which the robot starts."""
        rows, tick = pilot.model.rows, policy.moving["tick"]
        policy.demand_robot(rows.effectors, rows.actuators)
        _demand_command(pilot, policy)
        if abs(dt / tick - 1) > 1e-6:
            what = f"was trained for ticks of {tick:g} s, and the loop has ticks of {dt:g} s"
            raise InputError(what, where=str(policy.path), do=f"set rate: {1 / tick:g} Hz, or train it again")
        standing = Belief.at(pilot, np.zeros(rows.n_a) if start is None else np.asarray(start, float))
        self._pilot, self._rest_e, self._policy = pilot, rest_e, policy
        self.aimed = rest_e + standing.iterate.condensed.delta_e
        self.belief = MovingBelief(standing.u, SearchStatus.CONVERGED.value, standing.delta_a)
        history = policy.moving["history"]
        self._tips = np.tile(standing.iterate.condensed.delta_e, (history, 1))
        self._commands = np.tile(standing.u, (history, 1))

    def tick(
        self, goal: ArrayLike, measured: Measurement | None = None, ahead: ArrayLike | None = None
    ) -> MovingBelief:
        """Belief after a tick, with the arguments of `PolicyController.tick`; without a new sample the last one counts
        again."""
        self.aimed = np.asarray(goal, float)
        if measured is not None:
            tip = measured.x_e - self._rest_e
            tip = tip if np.isfinite(tip).all() else self._tips[0]
            self._tips = np.concatenate([tip[None], self._tips[:-1]])
        goals = self.aimed[None] if ahead is None or not len(ahead) else np.asarray(ahead, float)
        u, last, pilot = (
            self._policy.moving_command(self._tips, self._commands, goals - self._rest_e),
            self._commands[0],
            self._pilot,
        )
        limits = pilot.limits.lambda_a if pilot.command == "force" else pilot.limits.delta_a
        u = np.clip(np.clip(u, last - pilot.rate, last + pilot.rate), *limits.T)
        self._commands = np.concatenate([u[None], self._commands[:-1]])
        self.belief = MovingBelief(
            u, SearchStatus.CONVERGED.value, u if pilot.command == "displacement" else self.belief.delta_a
        )
        return self.belief


def _demand_command(pilot: Pilot, policy: Policy) -> None:
    wanted = policy.facts["command"]
    if pilot.command != wanted:
        raise InputError(
            f"is a policy that commands {wanted}s, and the loop commands {pilot.command}s",
            where=str(policy.path),
            do=f"set command.kind: {wanted}",
        )


def _parameters(model: Any, policy: Policy) -> np.ndarray:
    """Parameters (n_p,) of the robot that the model is of: a design's, or the scene's own. InputError where the model
    does not have those that the policy wants to be told."""
    if not policy.parameters:
        return np.zeros(0)
    predictor = model.predictor if isinstance(model, AtParameters) else model
    if predictor.parameters != policy.parameters:
        names = ", ".join(parameter.name for parameter in policy.parameters)
        what = f"is a policy of other parameters than the model's: {names}, with ranges of their own"
        raise InputError(what, where=str(policy.path), do="train it on this model")
    return model.p if isinstance(model, AtParameters) else references(policy.parameters)
