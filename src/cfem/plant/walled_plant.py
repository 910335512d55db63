"""An FE robot whose effector meets a wall that the model knows nothing of."""

from dataclasses import dataclass

import numpy as np

from cfem.equilibrium.system.robot import Robot
from cfem.plant.fem_plant import FemPlant, pushed
from cfem.plant.protocol import Command, Measurement

TOLERANCE, ITERATIONS = 1e-6, 30  # mm of the gap; trial forces


@dataclass(frozen=True)
class FrictionlessWall:
    """A plane without friction: point (3,) mm on it, normal (3,) unit out of it, on the side where the effector may
    be."""

    point: np.ndarray
    normal: np.ndarray

    def gap(self, x_e: np.ndarray) -> float:
        """Distance mm from the wall to the first effector, negative inside."""
        return float(self.normal @ (x_e[:3] - self.point))


class WalledPlant:
    """`Plant`. Signorini's law (1933) of one point: gap >= 0, force >= 0, one of them 0. The force on the first
    effector is found by the secant method, every trial a full solve.

    force: (N) that the wall pushes with now"""

    def __init__(self, robot: Robot, wall: FrictionlessWall):
        self._robot, self._wall, self._n_e = robot, wall, robot.rows.n_e
        self._free = FemPlant(robot)
        self._t, self.force, self._softness = 0, 0.0, None

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        """Measurement of the robot alone, or, where that ends inside the wall, under the force that keeps it out."""
        self._t += 1
        measurement, self.force = self._free.step(u, kind), 0.0
        gap = self._wall.gap(measurement.x_e) if measurement.status == "converged" else 0.0
        if gap >= 0:
            return self._numbered(measurement)
        known = (0.0, gap)
        trial = 1e-3 if self._softness is None else -gap / self._softness
        for _ in range(ITERATIONS):
            push = np.zeros(self._n_e)
            push[:3] = trial * self._wall.normal
            measurement = FemPlant(pushed(self._robot, push)).step(u, kind)
            if measurement.status != "converged":
                return self._numbered(measurement)
            gap = self._wall.gap(measurement.x_e)
            if abs(gap) <= TOLERANCE:
                self.force = trial
                return self._numbered(measurement)
            self._softness = (gap - known[1]) / (trial - known[0])
            known, trial = (trial, gap), max(trial - gap / self._softness, 0.0)
        return Measurement.failed(self._n_e, len(u), self._t, "the wall's force is not found")

    def _numbered(self, measurement: Measurement) -> Measurement:
        return Measurement(measurement.x_e, measurement.delta_a, measurement.lambda_a, self._t, measurement.status)
