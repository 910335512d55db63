"""A rigid body that robots of finite elements hold by their surfaces: where contact balances its load.

Each robot meets the body alone, as an obstacle at a trial pose (`cfem.equilibrium.contact.surfaces`); what sticks goes
with it. Newton's method with Broyden's updates, from the stiffness where all that touches sticks, finds the six
numbers of its motion at which the robots' forces and the load balance. All trials of a step begin at the same state, so
that friction counts the way of the step once."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.contact.law.sliding import PARTS
from cfem.contact.obstacle import Obstacle
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.touching_facets import Facets
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene, SurfacesState

BODY = 1  # number of the body among what a robot alone meets: after the robot itself
TRIALS = 40
BALANCED = 1e-4  # of the load: what may be left of forces, and of moments over the body's size
NUDGE = 0.005  # mm: differences from which the stiffness of what sticks is computed
STICKS = 100.0  # coefficient of friction
FARTHEST = 0.5  # mm: the longest correction
SHORTER, WORSE = 0.5, 3  # of a correction after one that leaves more than before; so many until a new stiffness
HALVINGS = 5  # of a step that fails


@dataclass(frozen=True, eq=False)
class Pose:
    """A pose R (3, 3) and t (3,) mm of a body."""

    R: np.ndarray
    t: np.ndarray

    def moved(self, xi: np.ndarray, size: float) -> "Pose":
        """Displaced by xi[:3] mm, and turned about its place by xi[3:] mm at the radius `size` mm."""
        return Pose(Rotation.from_rotvec(xi[3:] / size).as_matrix() @ self.R, self.t + xi[:3])

    def towards(self, end: "Pose", share: float) -> "Pose":
        """A share of the way to another pose."""
        turn = Rotation.from_matrix(end.R @ self.R.T).as_rotvec()
        return Pose(Rotation.from_rotvec(share * turn).as_matrix() @ self.R, self.t + share * (end.t - self.t))

    def way(self, end: "Pose", size: float) -> float:
        """mm that a point at the radius `size` goes, at most, to another pose."""
        turn = Rotation.from_matrix(end.R @ self.R.T).magnitude()
        return float(np.linalg.norm(end.t - self.t) + size * turn)


@dataclass(frozen=True, eq=False)
class _Motion:
    """`PrescribedMotion` of a body from one pose to another, as far as a step's memory needs it."""

    begin: Pose
    end: Pose

    def carried(self, points: np.ndarray, begin: float, end: float) -> np.ndarray:
        return (points - self.begin.t) @ self.begin.R @ self.end.R.T + self.end.t


@dataclass(frozen=True, eq=False)
class BodyState:
    """States of the robots, one scene each, and of the body.

    wrench: (6,) N and N mm of the robots on the body about its place
    forces: (r, 3) N of each robot on it
    imbalance: N, what is left of forces, and of moments over the body's size; None where its pose is prescribed
    solved: quasi-static states of one robot that this took since the start"""

    pose: Pose
    robots: tuple[SurfacesState, ...]
    wrench: np.ndarray
    forces: np.ndarray
    solved: int
    imbalance: float | None = None


class AtNodes(SkinnedRobot):
    """A robot that touches at its nodes alone, as robots that hold objects do."""

    @classmethod
    def of(cls, robot: SkinnedRobot) -> "AtNodes":
        return cls(robot.robot, robot.nodes, robot.triangles, robot.patches, robot.R, robot.t, itself=False)

    @property
    def facets(self) -> Facets:
        return Facets.none(len(self.patches))


class HeldBody:
    """Robots about a body, which begin apart from it.

    state: the last one
    shape, size: of the body; mm, by which rotations count as ways"""

    def __init__(self, robots: Sequence[SkinnedRobot], shape: Obstacle, pose: Pose, size: float, mu: float):
        """Robots at rest, actuators at 0. RuntimeError where they find no state."""
        self._scenes = [SurfaceScene([AtNodes.of(robot)], mu=mu, parts=PARTS) for robot in robots]
        self.shape, self.size, self._stuck, self.mu = shape, size, None, mu
        self.deltas = [np.zeros(robot.robot.rows.n_a) for robot in robots]
        self._solved = 0
        self.state = self._demand(self._tried(pose, self.deltas, None), "at rest")

    def go(self, pose: Pose, deltas: Sequence[np.ndarray]) -> BodyState:
        """State where the body has been moved to a pose, and the actuators to deltas (n_a,) mm of each robot, together
        in steps that are halved where one fails. RuntimeError where the shortest fails."""
        begin, start, share, step = self.state.pose, self.deltas, 0.0, 1.0
        while share < 1.0:
            to = min(1.0, share + step)
            now = [a + to * (np.asarray(b, float) - a) for a, b in zip(start, deltas, strict=True)]
            tried = self._tried(begin.towards(pose, to), now, self.state)
            if tried is None:
                step /= 2
                if step < 0.5**HALVINGS:
                    raise RuntimeError(f"robots about a body find no state at {share:.0%} of a step")
                continue
            self.state, self.deltas, share, step = tried, now, to, 2 * step
        return self.state

    def balance(self, load: np.ndarray, deltas: Sequence[np.ndarray] | None = None) -> BodyState:
        """State in one quasi-static step to deltas, those at hand unless given, where the body is free under a load
        (6,) N and N mm about its place. RuntimeError where no balance is found, LinAlgError
        where nothing holds it."""
        deltas = self.deltas if deltas is None else [np.asarray(delta, float) for delta in deltas]
        before, scale = self.state, np.array([1.0] * 3 + [1 / self.size] * 3)
        allowed = BALANCED * float(np.linalg.norm(load * scale))

        def left(xi: np.ndarray) -> tuple[BodyState | None, np.ndarray]:
            state = self._tried(before.pose.moved(xi, self.size), deltas, before)
            return state, np.full(6, np.inf) if state is None else scale * (state.wrench + load)

        if self._stuck is None:
            self._stuck = self._stiffness(before, before.pose, deltas, STICKS)
        xi, K, worse = np.zeros(6), self._stuck, 0
        state, rest = left(xi)
        self._demand(state, "of a free body")
        for _ in range(TRIALS):
            if np.linalg.norm(rest) <= allowed:
                self.state, self.deltas = replace(state, imbalance=float(np.linalg.norm(rest))), deltas
                return self.state
            change = -np.linalg.solve(K, rest)
            change *= SHORTER**worse * min(1.0, FARTHEST / np.linalg.norm(change))
            tried, now = left(xi + change)
            if tried is not None:
                K = K + np.outer(now - rest - K @ change, change) / (change @ change)
            if np.linalg.norm(now) < np.linalg.norm(rest):
                xi, state, rest, worse = xi + change, tried, now, 0
            else:
                worse += 1
            if worse == WORSE:
                K, worse = self._stiffness(before, state.pose, deltas, self.mu), 0
        raise RuntimeError(f"a free body finds no balance: {np.linalg.norm(rest):.2g} N are left")

    def _stiffness(self, before: BodyState, pose: Pose, deltas: Sequence[np.ndarray], mu: float) -> np.ndarray:
        """(6, 6) N/mm by which the robots hold the body about a pose, with a coefficient of friction, by differences.
        RuntimeError where a robot has no state there."""
        scale, wrenches = np.array([1.0] * 3 + [1 / self.size] * 3), []
        for nudge in (np.zeros(6), *(NUDGE * np.eye(6))):
            tried = self._tried(pose.moved(nudge, self.size), deltas, before, mu)
            wrenches.append(scale * self._demand(tried, "about a free body").wrench)
        return (np.column_stack(wrenches[1:]) - wrenches[0][:, None]) / NUDGE

    def _tried(
        self, pose: Pose, deltas: Sequence[np.ndarray], before: BodyState | None, mu: float | None = None
    ) -> BodyState | None:
        """State at a pose of the body, with another friction where mu is given; None where a robot finds none."""
        obstacles, states = ObstacleSet((self.shape.posed(pose.R, pose.t),)), []
        for i, (scene, delta) in enumerate(zip(self._scenes, deltas, strict=True)):
            begin = None if before is None else before.robots[i]
            if begin is not None:
                motion = {BODY: _Motion(before.pose, pose)}
                begin = replace(begin, memory=begin.memory.carried(begin.pairs, motion, 0.0, 1.0))
            states.append(replace(scene, obstacles=obstacles, mu=self.mu if mu is None else mu).step([delta], begin))
            self._solved += 1
            if not states[-1].converged:
                return None
        forces, wrench = self._on_body(pose, states)
        return BodyState(pose, tuple(states), wrench, forces, self._solved)

    def _on_body(self, pose: Pose, states: Sequence[SurfacesState]) -> tuple[np.ndarray, np.ndarray]:
        """Forces (r, 3) N of the robots on the body, and their wrench (6,) about its place."""
        forces, wrench = [], np.zeros(6)
        for scene, state in zip(self._scenes, states, strict=True):
            robot = scene.robots[0]
            places = robot.patches.mean(robot.surface(state.solved[0].state.x))[state.pairs.points]
            forces.append(-state.push.sum(axis=0))
            wrench[:3] += forces[-1]
            wrench[3:] -= np.cross(places - pose.t, state.push).sum(axis=0)
        return np.array(forces), wrench

    def _demand(self, state: BodyState | None, where: str) -> BodyState:
        if state is None:
            raise RuntimeError(f"robots about a body find no state {where}")
        return state
