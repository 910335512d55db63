"""Equilibria of one robot after another under given forces, each from the nearest solved before."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.condensed.parameters import Parameter
from cfem.core.errors import NumericalError
from cfem.equilibrium.friction.guides import Shares, has_friction, solve_slipping
from cfem.equilibrium.friction.sticking import Followed, Follower
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Equilibrium, State, Status
from cfem.mechanics.mesh import Mesh
from cfem.robot.spec import SceneSpec
from cfem.sample.family import RobotFamily

_POSES_KEPT = 4000
_HISTORIES_KEPT = 500  # states on the way of histories


@dataclass(frozen=True)
class Pose:
    """Shape of a robot in a case.

    x:     (k, 3) mm places of the effectors
    turn:  (k, 3, 3) their rotations since rest, of those that watch them
    nodes: (n, 3) mm"""

    x: np.ndarray
    turn: np.ndarray
    nodes: np.ndarray


class CaseRobots:
    """The robots of a scene whose numbers at some keys vary.

    robot:  the scene's own
    rest:   (k, 3) mm places of its effectors without load
    solves: number of equilibria so far"""

    def __init__(self, scene: SceneSpec, mesh: Mesh, keys: Sequence[Parameter]):
        """Loads the scene. keys: the numbers of it that vary."""
        self._family = RobotFamily(scene, mesh, keys)
        self.robot = self._family.robot
        self.rest, _ = _effectors(self.robot.rest_e, scene)
        # a rod's cables add nothing to the pattern of its unknowns, wherever they run
        alike = self._family.alike or not any(actuator.cliques for actuator in self.robot.actuators)
        self._scene, self._alike, self._pattern = scene, alike, None
        self._built: tuple[bytes, Problem] | None = None  # the last values, and their problem
        self._near: dict[str, tuple[State, Shares]] = {}  # by case, the state that was solved last
        self._follower: tuple[Problem, Follower] | None = None  # of friction along a path
        self._histories: dict[tuple, tuple[Equilibrium, Followed]] = {}  # by values and commands so far
        self._passed: dict[tuple[str, int], Followed] = {}  # by case and command, as passed last
        self._poses: dict[tuple, Pose] = {}  # by values, forces and commands before
        self.solves = 0

    def at(
        self, p: np.ndarray, forces: np.ndarray, direction: float, case: str, before: np.ndarray | None = None
    ) -> Pose:
        """The robot's equilibrium. NumericalError where there is none.

        p:      (n_keys,) values
        forces: (n_a,) of the actuators
        direction: 1 while loading, -1 while unloading
        case:   a name under which a state nearby is remembered
        before: (j, n_a) commands that led there, in their order, None where the direction alone is known"""
        key = (p.tobytes(), forces.tobytes(), direction, None if before is None else before.tobytes())
        if key not in self._poses:
            if len(self._poses) > _POSES_KEPT:
                self._poses.clear()
            self._poses[key] = self._solve(p, forces, direction, case, before)
        return self._poses[key]

    def _solve(self, p: np.ndarray, forces: np.ndarray, direction: float, case: str, before: np.ndarray | None) -> Pose:
        """The equilibrium from the state of this case that was solved last, else from rest."""
        problem = self._problem(p)
        if before is not None and has_friction(problem.robot):
            return self._pose(problem, self._follow(problem, p, np.vstack([before, forces]), case), p, case)
        start, shares = self._near.get(case, (None, None))
        equilibrium, shares_now = solve_slipping(problem, force(forces), start, shares, direction)
        if equilibrium.status is not Status.CONVERGED and start is not None:
            equilibrium, shares_now = solve_slipping(problem, force(forces), None, None, direction)
        self.solves += 1
        pose = self._pose(problem, equilibrium, p, case)
        self._near[case] = equilibrium.state, shares_now
        return pose

    def _follow(self, problem: Problem, p: np.ndarray, history: np.ndarray, case: str) -> Equilibrium:
        """Equilibrium after a history of commands (j, n_a), or the first one that has not converged."""
        if self._follower is None or self._follower[0] is not problem:
            self._follower = problem, Follower(problem)
        if len(self._histories) > _HISTORIES_KEPT:
            self._histories.clear()
        followed = None
        for count in range(len(history) + 1):
            key = (p.tobytes(), history[:count].tobytes())
            if key not in self._histories:
                self.solves += 1
                self._histories[key] = self._step(history[:count], followed, (case, count))
            equilibrium, followed = self._histories[key]
            if equilibrium.status is not Status.CONVERGED:
                break
        return equilibrium

    def _step(
        self, history: np.ndarray, followed: Followed | None, name: tuple[str, int]
    ) -> tuple[Equilibrium, Followed]:
        """The last command of a history, from where the others led; a state nearby is remembered by its name."""
        follower = self._follower[1]
        if followed is None:
            return follower.rest()
        equilibrium, after = follower.go(history[-1], followed, self._passed.get(name))
        if equilibrium.status is Status.CONVERGED:
            self._passed[name] = after
        return equilibrium, after

    def _pose(self, problem: Problem, equilibrium: Equilibrium, p: np.ndarray, case: str) -> Pose:
        """The pose of an equilibrium. NumericalError where it has not converged."""
        if equilibrium.status is not Status.CONVERGED:
            values = {key.key: float(value) for key, value in zip(self._family.parameters, p, strict=True)}
            raise NumericalError(f"case {case} at {values}: {equilibrium.status.value}", do="narrow the ranges")
        x, turn = _effectors(equilibrium.delta_e + problem.robot.rest_e, self._scene)
        return Pose(x, turn, equilibrium.state.x)

    def _problem(self, p: np.ndarray) -> Problem:
        """The problem of the robot p (n_keys,); that of the last p is kept."""
        key = p.tobytes()
        if self._built is None or self._built[0] != key:
            problem = Problem(self._family.at(p), like=self._pattern if self._alike else None)
            self._pattern = self._pattern or problem
            self._built = key, problem
        return self._built[1]


def _effectors(rows: np.ndarray, scene: SceneSpec) -> tuple[np.ndarray, np.ndarray]:
    """Places (k, 3) mm and rotations (k, 3, 3) of the effectors, unit where none is watched; rows: (n_e,)."""
    x, turn, column = [], [], 0
    for effector in scene.effectors:
        x.append(rows[column : column + 3])
        vector = rows[column + 3 : column + 6] if effector.orientation else np.zeros(3)
        turn.append(Rotation.from_rotvec(vector).as_matrix())
        column += len(effector.axes)
    return np.array(x), np.array(turn)
