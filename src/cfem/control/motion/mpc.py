"""Model predictive control on the condensed dynamics, by the real-time iteration: at each tick the steps of the horizon
are linearised about the last solution, shifted by a tick, and one quadratic program gives the commands, of which the
first is sent (Diehl, Bock and Schloeder, SIAM J. Control Optim. 43, 2005).

Without measurements it is a feed-forward: the inverse of the condensed dynamics along what lies ahead."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed import Condensed
from cfem.control.closed_loop.tick import MovingBelief
from cfem.control.motion.horizon import (
    Bounds,
    HalfSpace,
    HorizonCommands,
    HorizonCost,
    Predicted,
    best_commands,
    condensed_forces,
    condensed_states,
)
from cfem.control.motion.observer import Doubt, Observer
from cfem.control.search.qp import Backend, QpStatus
from cfem.core.errors import NumericalError
from cfem.motion.clocked import Clocked, ClockedState
from cfem.motion.linear import Guess, MaterialShares, first_of
from cfem.motion.model import MotionTerms
from cfem.motion.mpc_spec import EVERY, blocks
from cfem.plant.protocol import Measurement
from cfem.predict.estimation.gate import SampleVerdict


@dataclass(frozen=True)
class Plan:
    """How a horizon is planned.

    ticks: N
    cost, bounds: see `horizon`
    backend: of the quadratic program
    moves: number of commands that differ, None: all"""

    ticks: int
    cost: HorizonCost
    bounds: Bounds
    backend: Backend = "active_set"
    moves: int | None = None


PATIENCE = 3  # ticks in a row without a plan, after which the command retreats
RETREAT = 0.75  # of the way to the command at home, in a tick
AGAIN = 20  # ticks without a plan, after which the observer begins again once more


class Mpc:
    """Predictive controller, ticked.

    belief: of the last tick
    aimed: (n_e,) mm, the goal of that tick
    observer: None without sensors"""

    def __init__(self, clocked: Clocked, plan: Plan, rest_e: np.ndarray, start: Condensed, doubt: Doubt | None = None):
        """start: where the robot stands still before the first tick; doubt: None for a feed-forward without sensors."""
        self._clocked, self._rest_e = clocked, rest_e
        shifted = [HalfSpace(plane.normal, plane.level - float(plane.normal @ rest_e)) for plane in plan.bounds.planes]
        self._plan = replace(plan, bounds=replace(plan.bounds, planes=tuple(shifted)))
        self._begins = None if plan.moves is None else blocks(plan.ticks, plan.moves)
        state = clocked.at_rest(start)
        self.observer = None if doubt is None else Observer(clocked, state, plan.cost.weights, doubt)
        self._state, self._rest = state, state.u
        self._ahead = np.repeat(state.u[None], plan.ticks, axis=0)
        self._states = np.repeat(state.z[None], plan.ticks + 1, axis=0)
        self._lost = 0  # ticks in a row without a plan about these states
        self.belief = MovingBelief(state.u, QpStatus.OPTIMAL.value, start.delta_a)
        self.aimed = rest_e + start.delta_e

    def tick(
        self, goal: ArrayLike, measured: Measurement | None = None, ahead: ArrayLike | None = None
    ) -> MovingBelief:
        """Belief after a tick.

        goal: (n_e,) mm absolute, where the effectors should be at the end of the tick
        measured: the latest sample
        ahead: (k, n_e) goals at the ends of this tick and the next ones, of which the last holds on"""
        goals = np.atleast_2d(np.asarray(goal if ahead is None else ahead, float))
        goals = goals[np.minimum(np.arange(self._plan.ticks), len(goals) - 1)] - self._rest_e
        self.aimed = goals[0] + self._rest_e
        verdict = None
        try:
            now, verdict = self._present(measured)
            if self._lost:
                self._states = np.repeat(now.z[None], self._plan.ticks + 1, axis=0)
            commands, states, place = self._solve(now, goals)
            why = commands.qp.status
        except (NumericalError, np.linalg.LinAlgError) as error:
            commands, why, place = None, str(error), None
        if commands is None or why is not QpStatus.OPTIMAL:
            status, softened = getattr(why, "value", why), False
            self._lost = self._lost + 1 if np.isfinite(goals).all() else 0
            u = self._without_plan()
        else:
            u, status, softened = commands.U[0], "converged", commands.softened
            self._ahead = np.concatenate([commands.U[1:], commands.U[-1:]])
            self._states, self._lost = states, 0
        self._states = np.concatenate([self._states[-self._plan.ticks :], 2 * self._states[-1:] - self._states[-2:-1]])
        self._sent(u, place)
        astray = self.observer is not None and self.observer.astray
        outcome = verdict is SampleVerdict.REJECTED, verdict is SampleVerdict.RESTART or self._resets
        self.belief = MovingBelief(u, status, self._states[0, : self._clocked.n_a].copy(), softened, astray, *outcome)
        return self.belief

    def _without_plan(self) -> np.ndarray:
        """Command (n_a,) without a plan: what was planned before, taken from within the bounds. After PATIENCE ticks in
        a row it retreats towards that at home, within the rate: where the command led to is perhaps beyond what the
        model knows, and no plan is found as long as it stays."""
        if self._lost <= PATIENCE:
            u = self._ahead[0]
            self._ahead = np.concatenate([self._ahead[1:], self._ahead[-1:]])
            return u
        step = RETREAT * (self._rest - self.belief.u)
        u = self.belief.u + np.clip(step, -self._plan.bounds.rate, self._plan.bounds.rate)
        self._ahead = np.repeat(u[None], self._plan.ticks, axis=0)
        if self._resets:  # what samples cannot tell from the truth may still leave no plan
            self.observer.reset(u)
        return u

    @property
    def _resets(self) -> bool:
        """True if the observer begins again in this tick because there has been no plan for long."""
        return self.observer is not None and self._lost > PATIENCE and (self._lost - PATIENCE) % AGAIN == 1

    def _present(self, measured: Measurement | None) -> tuple[ClockedState, SampleVerdict | None]:
        """State of the robot now, and the verdict on the sample."""
        if self.observer is None:
            return self._state, None
        verdict = self.observer.correct(measured, self._rest_e)
        return self.observer.now(), verdict

    def _sent(self, u: np.ndarray, place: MotionTerms | None) -> None:
        if self.observer is None:
            self._state, _, _ = self._clocked.step(self._state, u, self._material, place)
        else:
            self.observer.command(u, place)

    @property
    def _material(self) -> MaterialShares:
        return MaterialShares() if self.observer is None else self.observer.material

    def _solve(self, now: ClockedState, goals: np.ndarray) -> tuple[HorizonCommands, np.ndarray, MotionTerms]:
        """Commands of the horizon, the states (N, n_z) that they lead to, and what the model says at its first tick."""
        clocked, plan = self._clocked, self._plan
        offset = 0.0 if self.observer is None else self.observer.offset
        z, U = self._states, self._ahead
        acting = clocked.acting(np.concatenate([now.u[None], U[:-1]]), U)
        guess = Guess(z[:-1], np.diff(z[:, : clocked.n_q], axis=0) / clocked.dt, acting)
        steps, near = clocked.linear(guess, self._material, EVERY)
        mean = clocked.kind == "force"
        states = condensed_states(steps, now.z, guess.state, acting, now.u, mean)
        about = states.at(U.ravel())
        e, C = clocked.effectors(about, near)
        slope = C @ states.slope
        effectors = Predicted(e + offset - slope @ U.ravel(), slope)
        if mean:
            course = Predicted(states.value[:, : clocked.n_a], states.slope[:, : clocked.n_a])
        else:
            course = condensed_forces(steps, states, now.z, guess.state, acting)
        commands = best_commands(
            effectors, course, goals, now.u, self._rest, plan.cost, plan.bounds, plan.backend, self._begins
        )
        return commands, states.at(commands.U.ravel()), first_of(near)
