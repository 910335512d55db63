"""Where a robot rests whose cables rub in their guides, along a history of commanded tensions.

At guide j a cable loses F_j = T_(j-1) - T_j, whose bounds are those of a capstan,

    T_(j-1) (1 - exp(mu theta_j))  <=  F_j  <=  T_(j-1) (1 - exp(-mu theta_j))

theta_j the angle that it turns there. The cable does not stretch, so what passes guide j since the last command is what
its segments beyond have become shorter, s_j = sum_(k>=j) (delta_k - delta_k,before). It slips inwards (s_j > 0) at the
upper bound, outwards at the lower, and between them it sticks (s_j = 0). With the compliance W of the segments, s
changes by -U W U^T dF (U sums over the segments beyond), so that F is the least of a quadratic function in a box, as in
rate-independent plasticity. Box and compliance follow the shape, in turns."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from cfem.constraint.cable import Cable
from cfem.constraint.protocol import Constraint
from cfem.constraint.rod_cable import RodCable
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.evaluation import SolveCost
from cfem.equilibrium.system.problem import Evaluation, Problem
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import Equilibrium, State, Status

_TURNS = 60
_ENOUGH = 1e-7  # of the largest command: change of any tension
_SOFT = 1e-10  # of the compliance: what makes it definite where guides slip as one


@dataclass(frozen=True)
class Followed:
    """State to which a history has led. delta and tension (s,) mm and N: of the segments of all cables that rub."""

    state: State
    delta: np.ndarray
    tension: np.ndarray


class Follower:
    """Follows commands of a robot some of whose cables have friction."""

    def __init__(self, problem: Problem):
        """Splits the cables that rub into their segments, each an actuator of its own."""
        self._whole, robot = problem, problem.robot
        self._rubbing = [j for j, actuator in enumerate(robot.actuators) if _has_friction(actuator)]
        self._cables = [robot.actuators[j] for j in self._rubbing]
        parts = [actuator.segments if _has_friction(actuator) else (actuator,) for actuator in robot.actuators]
        self._actuator = np.repeat(np.arange(len(parts)), [len(mine) for mine in parts])
        self._here = np.flatnonzero(np.isin(self._actuator, self._rubbing))
        self._cable = np.unique(self._actuator[self._here], return_inverse=True)[1]
        self._split = Problem(_split(robot, parts), like=problem)

    def rest(self) -> tuple[Equilibrium, Followed]:
        """Equilibrium without tension, under the constant loads."""
        equilibrium = self._solve(np.zeros(len(self._whole.robot.actuators)), np.zeros(len(self._cable)), None)
        delta = self._evaluate(equilibrium.state).delta[self._here]
        return equilibrium, Followed(equilibrium.state, delta, np.zeros(len(self._cable)))

    def go(self, forces: np.ndarray, before: Followed, near: Followed | None = None) -> tuple[Equilibrium, Followed]:
        """Goes straight from where the history has led to commands (n_a,) N or MPa. near: where a robot like this one
        got to by them, to search from. Status INACCURATE where tensions do not settle."""
        forces = np.asarray(forces, float)
        commands = forces[self._rubbing]
        tension, state = (before if near is None else near).tension.copy(), (near or before).state
        for j, command in enumerate(commands):
            mine = self._cable == j
            if near is None or not tension[mine][0] > 0:
                tension[mine] = command * (tension[mine] / tension[mine][0] if tension[mine][0] > 0 else 1.0)
        for _ in range(_TURNS):
            equilibrium = self._solve(forces, tension, state)
            if equilibrium.status is not Status.CONVERGED:
                return equilibrium, before
            state, evaluation = equilibrium.state, self._evaluate(equilibrium.state)
            wanted = self._lawful_tensions(evaluation, evaluation.delta[self._here] - before.delta, tension, forces)
            change, tension = np.abs(wanted - tension).max(), wanted
            if change <= _ENOUGH * np.abs(commands).max():
                return equilibrium, Followed(state, evaluation.delta[self._here], tension)
        return replace(equilibrium, status=Status.INACCURATE), before

    def _solve(self, forces: np.ndarray, tension: np.ndarray, start: State | None) -> Equilibrium:
        """Equilibrium with these tensions held."""
        robot = self._whole.robot
        actuators = list(robot.actuators)
        for j, (number, cable) in enumerate(zip(self._rubbing, self._cables, strict=True)):
            mine, command = tension[self._cable == j], forces[number]
            shares = mine / command if command > 0 else np.ones(len(mine))
            actuators[number] = replace(cable, shares=shares, friction=0.0)
        held = Problem(replace(robot, actuators=tuple(actuators)), like=self._whole)
        return solve(held, force(forces), start, wanted=Wanted(condense=False))

    def _evaluate(self, state: State) -> Evaluation:
        return self._split.evaluate(state.x, state.pressure, state.load)

    def _lawful_tensions(
        self, evaluation: Evaluation, moved: np.ndarray, tension: np.ndarray, forces: np.ndarray
    ) -> np.ndarray:
        """Tensions (s,) N of the segments that obey the law of friction, if shape and compliance are those at hand."""
        command = forces[self._rubbing][self._cable]
        if not command.any():
            return tension
        lam = forces[self._actuator]
        lam[self._here] = tension
        G = evaluation.H[:, self._here]
        W = G.T @ self._split.factor(evaluation, lam, SolveCost()).factor.solve(G)
        ahead = np.where(np.diff(self._cable, prepend=-1) > 0, command, np.roll(tension, 1))
        angle = np.concatenate([cable.friction * cable.turned(evaluation.x) for cable in self._cables]) * (command > 0)
        low, high = ahead * (1 - np.exp(angle)), ahead * (1 - np.exp(-angle))
        beyond = np.triu(self._cable[:, None] == self._cable).astype(float)
        F = _drops(beyond @ W @ beyond.T, beyond @ moved, ahead - tension, low, high)
        each = [self._cable == j for j in range(len(self._cables))]
        return np.concatenate([_along(command[m][0], F[m], low[m], high[m], angle[m]) for m in each])


def _drops(D: np.ndarray, s: np.ndarray, F: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(g,) N: the F' in the box with s - D (F' - F) in the normal cone there, the least of F' D F' / 2 - (s + D F) F'.
    A straight guide takes nothing."""
    drops = np.zeros(len(F))
    free = high - low > 1e-14 * np.abs(high).max()
    if not free.any():
        return drops
    values, vectors = np.linalg.eigh((D + D.T)[np.ix_(free, free)] / 2)
    root = np.sqrt(np.maximum(values, _SOFT * values[-1]))
    start = F[free].clip(low[free], high[free])
    left = s[free] + D[np.ix_(free, free)] @ (F[free] - start)
    A, b = root[:, None] * vectors.T, vectors.T @ left / root
    box = low[free] - start, high[free] - start
    drops[free] = start + lsq_linear(A, b, box, method="bvls", tol=1e-14).x
    return drops


def _along(first: float, F: np.ndarray, low: np.ndarray, high: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Tensions (s,) N behind each guide: of one that slips by its share, of one that sticks by its drop."""
    near = 1e-9 * (high - low)
    direction = np.where(high - near <= F, 1.0, np.where(low + near >= F, -1.0, 0.0))
    tension, now = np.empty(len(F)), first
    for j, drop in enumerate(F):
        least, most = now * np.exp(-angle[j]), now * np.exp(angle[j])
        now = least if direction[j] > 0 else most if direction[j] < 0 else min(max(now - drop, least), most)
        tension[j] = now
    return tension


def _has_friction(constraint: Constraint) -> bool:
    return isinstance(constraint, Cable | RodCable) and constraint.friction > 0


def _split(robot: Robot, parts: Sequence[tuple[Constraint, ...]]) -> Robot:
    """Every part an actuator of its own."""
    names = tuple(str(i) for i in range(sum(map(len, parts))))
    actuators = tuple(segment for mine in parts for segment in mine)
    return replace(robot, actuators=actuators, rows=replace(robot.rows, actuators=names), forces=None)
