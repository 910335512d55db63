"""Robots that meet a rigid body with any point of their surface: of its many points, those near the body are contact
points of a step (`cfem.equilibrium.contact.points`), and others join them where they turn out to come into it."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from cfem.contact.law.modes import Mode
from cfem.equilibrium.contact.patch_compliance import with_patches
from cfem.equilibrium.contact.points import PlacedRobot, PointRobot, PointsState
from cfem.equilibrium.contact.posed import Partner
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Equilibrium

NEAR = 0.002  # of the robot's length from the body: nearer points are contact points
SHARE = 0.5  # of that distance: where contact points are no longer those within it, they are chosen again
LEAST = 3  # contact points of a robot: the nearest ones, however far away they are
WITHIN = 1e-6  # of the length: how far in other points may be

NOTHING = np.zeros(0, dtype=np.int64)


class SurfaceRobot(ABC):
    """A `ForcePointRobot` whose contact points are some of the points (N,) of its surface.

    numbers: (k,) of these, ascending"""

    numbers: np.ndarray
    turn: np.ndarray

    @property
    @abstractmethod
    def points(self) -> np.ndarray:
        """Contact points (k, 3) mm at rest, in the scene."""

    @property
    @abstractmethod
    def length(self) -> float:
        """mm"""

    @abstractmethod
    def touching(self, numbers: np.ndarray) -> Self:
        """The robot with these contact points (k,)."""

    @abstractmethod
    def surface(self, state: Any) -> np.ndarray:
        """(N, 3) mm in the scene, all points in a state, None: at rest; of others than contact points, a learned robot
        leaves out what is local."""

    @abstractmethod
    def seen(self, state: Any, of: Self) -> Any:
        """The state of this robot that `state` is of another choice of its contact points, `of`."""


def chosen(
    robots: Sequence[PointRobot], before: PointsState | None, around: Partner
) -> tuple[list[PointRobot], PointsState | None]:
    """Robots whose contact points are those near the body, where their surface has a choice, and the state `before` of
    these."""
    choices: dict[int, np.ndarray] = {}
    for i, robot in enumerate(robots):
        if not isinstance(robot, SurfaceRobot):
            continue
        state = None if before is None else before.solved[i]
        distance = around.surface(robot.surface(state))[0]
        pressed = NOTHING if state is None else robot.numbers[state.lambda_c.reshape(-1, 3).any(axis=1)]
        kept = np.union1d(np.argsort(distance)[:LEAST], pressed)
        within = [np.union1d(np.flatnonzero(distance < share * NEAR * robot.length), kept) for share in (SHARE, 1.0)]
        if not np.isin(within[0], robot.numbers).all() or SHARE * len(robot.numbers) > len(within[1]):
            choices[i] = within[1]
    return _with_choices(robots, before, choices)


def joined(
    robots: Sequence[PointRobot], before: PointsState | None, state: PointsState
) -> tuple[list[PointRobot], PointsState | None] | None:
    """Robots with those further contact points that are in the body in a state of them, and the state `before` of
    these; None where none is."""
    choices: dict[int, np.ndarray] = {}
    for i, robot in enumerate(robots):
        if not isinstance(robot, SurfaceRobot):
            continue
        distance = state.around.surface(robot.surface(state.solved[i]))[0]
        near = np.setdiff1d(np.flatnonzero(distance < NEAR * robot.length), robot.numbers)
        if not len(near):
            continue
        with_near = robot.touching(np.union1d(robot.numbers, near))
        moved = with_near.seen(state.solved[i], robot).delta_c.reshape(-1, 3) @ robot.turn.T
        distance = state.around.surface(with_near.points + moved)[0]
        entered = with_near.numbers[distance < -WITHIN * robot.length]
        if len(np.setdiff1d(entered, robot.numbers)):
            choices[i] = np.union1d(robot.numbers, entered)
    return _with_choices(robots, before, choices) if choices else None


def _with_choices(
    robots: Sequence[PointRobot], before: PointsState | None, choices: dict[int, np.ndarray]
) -> tuple[list[PointRobot], PointsState | None]:
    """Robots with other contact points, by their numbers among `robots`, and the state `before` of these: points that
    were no contact points before are open, and would stick where they are."""
    others = [robot.touching(choices[i]) if i in choices else robot for i, robot in enumerate(robots)]
    if before is None or not choices:
        return others, before
    solved, modes, stuck = [], [], []
    ends = np.cumsum([0, *(len(robot.points) for robot in robots)])
    for i, (robot, other) in enumerate(zip(robots, others, strict=True)):
        mine = slice(*ends[i : i + 2])
        state, its_modes, its_stuck = before.solved[i], list(before.modes[mine]), before.stuck[mine]
        if i in choices:
            kept = dict(zip(robot.numbers.tolist(), range(len(robot.numbers)), strict=True))
            its_stuck = before.around.places(robot.surface(state)[other.numbers])
            places = [(k, kept[number]) for k, number in enumerate(other.numbers.tolist()) if number in kept]
            for k, old in places:
                its_stuck[k] = before.stuck[ends[i] + old]
            known = dict(places)
            its_modes = [its_modes[known[k]] if k in known else Mode.OPEN for k in range(len(other.numbers))]
            state = other.seen(state, robot)
        solved.append(state)
        modes += its_modes
        stuck.append(its_stuck)
    return others, replace(before, solved=tuple(solved), modes=tuple(modes), stuck=np.concatenate(stuck))


@dataclass(frozen=True)
class PlacedSurface(PlacedRobot, SurfaceRobot):
    """`SurfaceRobot` of finite elements; of: the robot where it stands."""

    of: SkinnedRobot = field(kw_only=True)
    numbers: np.ndarray = field(kw_only=True)

    @classmethod
    def at_rest(cls, of: SkinnedRobot) -> "PlacedSurface":
        """The robot without contact points."""
        return cls(of.problem, of.R, of.t, of=of, numbers=NOTHING)

    @property
    def length(self) -> float:
        return self.of.robot.length

    def touching(self, numbers: np.ndarray) -> "PlacedSurface":
        robot = self.of.problem.robot
        problem = Problem(with_patches(robot, self.of.nodes, self.of.patches, numbers), like=self.of.problem)
        return PlacedSurface(problem, self.turn, self.shift, of=self.of, numbers=numbers)

    def surface(self, state: Equilibrium | None) -> np.ndarray:
        x = self.problem.rest if state is None else state.state.x
        return self.of.patches.mean(self.of.surface(x))

    def under(
        self, actuators: Actuation, forces: np.ndarray, before: Equilibrium | None, tolerance: float
    ) -> tuple[Equilibrium, np.ndarray]:
        free = np.zeros((len(actuators.C), len(forces)))
        C, offset = np.hstack([actuators.C, free]), np.concatenate([actuators.offset, forces])
        return self.solved(actuators, Actuation(C, actuators.target, offset, actuators.load), before, tolerance)

    def seen(self, state: Equilibrium, of: "PlacedSurface") -> Equilibrium:
        forces = np.zeros((len(self.of.patches), 3))
        forces[of.numbers] = state.lambda_c.reshape(-1, 3)
        moved = self.of.patches.mean(state.state.x[self.of.nodes])[self.numbers] - self.of.patches.rest[self.numbers]
        delta = np.concatenate([state.delta_a, moved.ravel()])
        lam = np.concatenate([state.lambda_a, forces[self.numbers].ravel()])
        return replace(state, delta=delta, state=replace(state.state, lam=lam), condensed=None)
