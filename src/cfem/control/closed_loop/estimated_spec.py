"""Spec of `loop.estimate`: the markers that a controller sees instead of the effectors."""

from typing import Annotated

from pydantic import Field

from cfem.core.units import Length
from cfem.predict.estimation.spec import DynamicsSpec, MarkersSpec

Share = Annotated[float, Field(ge=0, lt=1)]


class LoopEstimateSpec(MarkersSpec):
    """Controllers know of the robot what is estimated from markers and the actuators' sensors."""

    lost: Share = 0.0
    """Share of the markers that nobody sees in a sample (plant: fem)."""
    wrong: Share = 0.0
    """Share of the markers that are another point in a sample (plant: fem)."""
    astray: Length = Field(20.0, gt=0)
    """Distance of such a point, standard deviation of each coordinate (plant: fem)."""
    dynamics: DynamicsSpec | None = None
    """A filter on the dynamics that the model has learned. With `moving`, unless given; without, none: the robot is at
    rest at each tick."""
