"""Equilibria of one robot after another under given forces, each from the nearest solved before."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.condensed.parameters import Parameter
from cfem.core.errors import NumericalError
from cfem.equilibrium.actuation import force
from cfem.equilibrium.friction import Shares, has_friction, solve_slipping
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.solution import Equilibrium, State, Status
from cfem.equilibrium.sticking import Followed, Follower
from cfem.mechanics.mesh import Mesh
from cfem.robot.spec import SceneSpec
from cfem.sample.family import RobotFamily

_KEPT = 4000  # places of effectors remembered
_KEPT_HISTORIES = 500  # states on the way of histories


@dataclass(frozen=True)
class Posed:
    """x (k, 3) mm: places of the effectors; turn (k, 3, 3): their rotations since rest, of those that watch them;
    nodes (n, 3) mm."""

    x: np.ndarray
    turn: np.ndarray
    nodes: np.ndarray


class CaseRobots:
    """The robots of a scene whose numbers at some keys vary.

    solves: how many equilibria there were"""

    def __init__(self, scene: SceneSpec, mesh: Mesh, keys: Sequence[Parameter]):
        self._family = RobotFamily(scene, mesh, keys)
        self.robot = self._family.robot
        self.rest, _ = _effectors(self.robot.rest_e, scene)
        # a rod's cables add nothing to the pattern of its unknowns, wherever they run
        alike = self._family.alike or not any(one.cliques for one in self.robot.actuators)
        self._scene, self._alike, self._pattern = scene, alike, None
        self._built: tuple[bytes, Problem] | None = None
        self._near: dict[str, tuple[State, Shares]] = {}
        self._follower: tuple[Problem, Follower] | None = None
        self._histories: dict[tuple, tuple[Equilibrium, Followed]] = {}
        self._passed: dict[tuple[str, int], Followed] = {}
        self._known: dict[tuple, Posed] = {}
        self.solves = 0

    def at(self, p: np.ndarray, forces: np.ndarray, way: float, case: str, before: np.ndarray | None = None) -> Posed:
        """p: (n_keys,) values; forces: (n_a,); case: a name under which a state nearby is remembered; before: (j, n_a)
        commands that led there, in their order, None where the way alone is known. NumericalError where there is no
        equilibrium."""
        place = (p.tobytes(), forces.tobytes(), way, None if before is None else before.tobytes())
        if place not in self._known:
            if len(self._known) > _KEPT:
                self._known.clear()
            self._known[place] = self._solve(p, forces, way, case, before)
        return self._known[place]

    def _solve(self, p: np.ndarray, forces: np.ndarray, way: float, case: str, before: np.ndarray | None) -> Posed:
        problem = self._problem(p)
        if before is not None and has_friction(problem.robot):
            return self._posed(problem, self._follow(problem, p, np.vstack([before, forces]), case), p, case)
        start, shares = self._near.get(case, (None, None))
        found, now = solve_slipping(problem, force(forces), start, shares, way)
        if found.status is not Status.CONVERGED and start is not None:
            found, now = solve_slipping(problem, force(forces), None, None, way)
        self.solves += 1
        posed = self._posed(problem, found, p, case)
        self._near[case] = found.state, now
        return posed

    def _follow(self, problem: Problem, p: np.ndarray, history: np.ndarray, case: str) -> Equilibrium:
        """From command to command, or to the first that has no equilibrium."""
        if self._follower is None or self._follower[0] is not problem:
            self._follower = problem, Follower(problem)
        if len(self._histories) > _KEPT_HISTORIES:
            self._histories.clear()
        now = None
        for count in range(len(history) + 1):
            place = (p.tobytes(), history[:count].tobytes())
            if place not in self._histories:
                self.solves += 1
                self._histories[place] = self._go(history[:count], now, (case, count))
            found, now = self._histories[place]
            if found.status is not Status.CONVERGED:
                break
        return found

    def _go(self, history: np.ndarray, now: Followed | None, name: tuple[str, int]) -> tuple[Equilibrium, Followed]:
        """The last command of a history, from where the others led; a state nearby is remembered by its name."""
        follower = self._follower[1]
        if now is None:
            return follower.rest()
        found, to = follower.go(history[-1], now, self._passed.get(name))
        if found.status is Status.CONVERGED:
            self._passed[name] = to
        return found, to

    def _posed(self, problem: Problem, found: Equilibrium, p: np.ndarray, case: str) -> Posed:
        if found.status is not Status.CONVERGED:
            named = {one.key: float(value) for one, value in zip(self._family.parameters, p, strict=True)}
            raise NumericalError(f"case {case} at {named}: {found.status.value}", do="narrow the ranges")
        x, turn = _effectors(found.delta_e + problem.robot.rest_e, self._scene)
        return Posed(x, turn, found.state.x)

    def _problem(self, p: np.ndarray) -> Problem:
        key = p.tobytes()
        if self._built is None or self._built[0] != key:
            robot = self._family.at(p)
            problem = Problem(robot, like=self._pattern if self._alike else None)
            self._pattern = self._pattern or problem
            self._built = key, problem
        return self._built[1]


def _effectors(rows: np.ndarray, scene: SceneSpec) -> tuple[np.ndarray, np.ndarray]:
    """Places (k, 3) mm and rotations (k, 3, 3), unit where none is watched."""
    x, turn, column = [], [], 0
    for one in scene.effectors:
        x.append(rows[column : column + 3])
        turn.append(Rotation.from_rotvec(rows[column + 3 : column + 6]).as_matrix() if one.orientation else np.eye(3))
        column += len(one.axes)
    return np.array(x), np.array(turn)
