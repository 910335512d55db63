"""What `loop.estimate` of control.yaml says: the markers that a controller sees instead of the effectors."""

from typing import Annotated

from pydantic import Field

from cfem.core.names import Name
from cfem.core.spec import Spec
from cfem.core.units import Length, Point
from cfem.predict.estimation.gate import GateSpec
from cfem.predict.estimation.spec import ActuatorSensorsSpec, DynamicsSpec, LoadsSpec

Share = Annotated[float, Field(ge=0, lt=1)]


class EstimateSpec(Spec):
    """Controllers know of the robot what is estimated from markers and the actuators' sensors."""

    markers: dict[Name, Point] = Field(min_length=1)
    """Place of each marker on the surface at rest, in the scene's frame."""
    noise: Annotated[Length, Field(gt=0)]
    """Standard deviation of each measured coordinate."""
    lost: Share = 0.0
    """Share of the markers that nobody sees in a sample (plant: fem)."""
    wrong: Share = 0.0
    """Share of the markers that are another point in a sample (plant: fem)."""
    astray: Length = 20.0
    """Distance of such a point, standard deviation of each coordinate (plant: fem)."""
    loads: LoadsSpec | None = None
    """Unknown forces. None unless given."""
    dynamics: DynamicsSpec | None = None
    """A filter on the dynamics that the model has learned. With `moving`, unless given; without, none: the robot is at
    rest at each tick."""
    actuators: ActuatorSensorsSpec = ActuatorSensorsSpec()
    """Sensors of the actuators, with their noise."""
    gate: GateSpec = GateSpec()
    """Frames that the filter rejects."""
