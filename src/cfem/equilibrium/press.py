"""Equilibria of a robot whose contact points meet obstacles that move as they are told."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.contact.obstacle import Obstacle
from cfem.contact.problem import Law
from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.newton import Settings
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.solve import solve
from cfem.equilibrium.touch import PlacedRobot, Touch, TouchStatus, touch


@dataclass(frozen=True)
class Obstacles:
    """`Around`: one obstacle a point, whose pose is given."""

    of_points: tuple[Obstacle, ...]
    wrench = np.zeros(0)

    def surface(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        alone = [(one, x[None]) for one, x in zip(self.of_points, at, strict=True)]
        distance = np.concatenate([one.distance(x) for one, x in alone])
        return distance, np.concatenate([one.frames(x) for one, x in alone])

    def motion(self, at: np.ndarray) -> np.ndarray:
        return np.zeros((at.size, 0))

    def moved(self, xi: np.ndarray) -> "Obstacles":
        return self

    def now(self, places: np.ndarray) -> np.ndarray:
        return places

    def places(self, at: np.ndarray) -> np.ndarray:
        return at


def press(
    problem: Problem,
    actuators: Actuation,
    obstacles: Sequence[Obstacle],
    law: Law = "coulomb",
    mu: float = 0.0,
    before: Touch | None = None,
    carried: np.ndarray | None = None,
    cone: str = "exact",
    tolerance: float = 1e-8,
    iterations: int = 30,
) -> Touch:
    """Quasi-static step to `actuators`, one obstacle a contact point, from the state `before` (none: nothing touches).

    carried: (k, 3) mm where the points at which friction held before are now, as the obstacles have moved with them
    (where they were unless given). tolerance: of the law, relative, at the state itself. Never raises for numerical
    failure."""
    robot, around = PlacedRobot(problem, np.eye(3), np.zeros(3)), Obstacles(tuple(obstacles))
    cost = 0
    if before is None:
        free = solve(problem, actuators, settings=Settings(tolerance=1e-11))
        cost, touched = free.factorizations, robot.points + free.delta_c.reshape(-1, 3)
        status = TouchStatus.CONVERGED if free.converged else TouchStatus.NO_EQUILIBRIUM
        before = Touch(status, (free,), (), around, touched if free.converged else robot.points, None, 1, cost)
        if not free.converged:
            return before
    elif carried is not None:
        before = replace(before, stuck=carried)
    found = touch([robot], [actuators], around, before, law, mu, cone, tolerance, iterations)
    return replace(found, factorizations=found.factorizations + cost)
