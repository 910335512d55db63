"""The ground under a robot that carries itself, seen from the robot's own base.

The base is the frame. The ground is what moves in it, free as the object of a gripper is
(`cfem.equilibrium.contact.grasp`). It carries the robot's weight, which acts at a point of the base and turns with the
ground."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cfem.equilibrium.contact.grasp import FreeObject
from cfem.equilibrium.system.actuation import Actuation


@dataclass(frozen=True)
class Ground(FreeObject):
    """A `FreeObject` whose load is the weight, (3,) N out of the ground and no moment.

    mass_at: (3,) mm of the base, where the weight acts
    centre: (3,) mm, a point of the ground"""

    mass_at: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @property
    def wrench(self) -> np.ndarray:
        force = self.R @ self.load[:3]
        return np.concatenate([force, np.cross(self.mass_at - self.centre - self.x, force)])

    def base_at(self, points: np.ndarray) -> np.ndarray:
        """(m, 3) mm of the base's frame, where they are on the ground, in its own frame: that of the base at first."""
        return self.places(points)


@dataclass(frozen=True)
class PadState:
    """State of pads, as `Equilibrium` has it: no actuators."""

    delta_c: np.ndarray
    lambda_c: np.ndarray
    delta_a: np.ndarray = field(default_factory=lambda: np.zeros(0))
    lambda_a: np.ndarray = field(default_factory=lambda: np.zeros(0))
    converged: bool = True
    factorizations: int = 0


@dataclass(frozen=True)
class Pads:
    """`PointRobot`: points (k, 3) mm of the base on elastic pads, compliance mm/N each in every direction."""

    points: np.ndarray
    compliance: float
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))

    def respond(
        self, actuators: Actuation, delta_c: np.ndarray, before: Any, tolerance: float = 0.0
    ) -> tuple[PadState, np.ndarray]:
        return PadState(delta_c, delta_c / self.compliance), self.compliance * np.eye(len(delta_c))
