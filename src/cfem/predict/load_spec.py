"""Constant loads on effectors as a user states them: a push, or a payload."""

from collections.abc import Mapping

import numpy as np
from pydantic import Field, model_validator

from cfem.core.spec import Spec
from cfem.core.units import AccelerationVector, ForceVector, Mass


class LoadSpec(Spec):
    """A constant load on one effector that the samples did not carry: a force, or the weight of a payload."""

    force: ForceVector | None = None
    """Force along x, y and z."""
    mass: Mass | None = Field(None, gt=0)
    """Mass of a payload. Its inertia does not matter, as the robot is at rest."""
    gravity: AccelerationVector | None = None
    """Acceleration of gravity along x, y and z, which gives the payload its weight."""

    @model_validator(mode="after")
    def _one_of_two(self) -> "LoadSpec":
        if (self.force is None) == (self.mass is None) or (self.mass is None) != (self.gravity is None):
            raise ValueError(
                "expected force, or mass and gravity, such as {mass: 20 g, gravity: {m/s^2: [0, 0, -9.81]}}"
            )
        return self

    @property
    def newtons(self) -> np.ndarray:
        """(3,) N."""
        return np.array(self.force if self.mass is None else self.mass * self.gravity)


def forces_of(loads: Mapping[str, LoadSpec]) -> dict[str, np.ndarray]:
    """(3,) N by the name of the effector."""
    return {name: load.newtons for name, load in loads.items()}
