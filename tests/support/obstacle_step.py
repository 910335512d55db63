"""Equilibria of a robot whose contact points meet obstacles: a reference of contact anywhere."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.contact.law.problem import Law
from cfem.contact.obstacle import Obstacle
from cfem.contact.step_status import StepStatus
from cfem.equilibrium.contact.points import PlacedRobot, PointsState, points_step
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.problem import Problem


@dataclass(frozen=True)
class Obstacles:
    """`Partner`: one obstacle a point, whose pose is given."""

    of_points: tuple[Obstacle, ...]
    wrench = np.zeros(0)

    def surface(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        alone = [(obstacle, point[None]) for obstacle, point in zip(self.of_points, points, strict=True)]
        distance = np.concatenate([obstacle.distance(point) for obstacle, point in alone])
        return distance, np.concatenate([obstacle.frames(point) for obstacle, point in alone])

    def motion(self, points: np.ndarray) -> np.ndarray:
        return np.zeros((points.size, 0))

    def moved(self, xi: np.ndarray) -> "Obstacles":
        return self

    def now(self, places: np.ndarray) -> np.ndarray:
        return places

    def places(self, points: np.ndarray) -> np.ndarray:
        return points


def obstacle_step(
    problem: Problem,
    actuators: Actuation,
    obstacles: Sequence[Obstacle],
    law: Law = "coulomb",
    mu: float = 0.0,
    before: PointsState | None = None,
    carried: np.ndarray | None = None,
) -> PointsState:
    """Quasi-static step to `actuators`, one obstacle a contact point, from the state `before` (none: nothing touches).

    carried: (k, 3) mm where the points at which friction held before are now, as the obstacles have moved with them
    (where they were unless given). Never raises for numerical failure."""
    robot, around = PlacedRobot(problem, np.eye(3), np.zeros(3)), Obstacles(tuple(obstacles))
    cost = 0
    if before is None:
        free = solve(problem, actuators, settings=NewtonSettings(tolerance=1e-11))
        cost, touched = free.factorizations, robot.points + free.delta_c.reshape(-1, 3)
        status = StepStatus.CONVERGED if free.converged else StepStatus.NO_EQUILIBRIUM
        before = PointsState(status, (free,), (), around, touched if free.converged else robot.points, None, 1, cost)
        if not free.converged:
            return before
    elif carried is not None:
        before = replace(before, stuck=carried)
    state = points_step([robot], [actuators], around, before, law, mu)
    return replace(state, factorizations=state.factorizations + cost)
