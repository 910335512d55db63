"""What a spec says of unknown forces and of the sensors of the actuators, wherever a state is estimated."""

from typing import Annotated

from pydantic import Field

from cfem.core.actuator_units import Displacement, Effort
from cfem.core.spec import Spec
from cfem.core.units import Force, Time


class LoadsSpec(Spec):
    """Unknown forces."""

    rows: list[str] = Field(min_length=1)
    """Rows of the model that they act on: `tip.x` of an effector, `skin.1` of a mode of the surface."""
    largest: Annotated[Force, Field(gt=0)]
    """About how large one becomes, standard deviation."""
    lasts: Annotated[Time, Field(gt=0)] | None = None
    """For how long one keeps its value. The whole recording unless given."""


class ActuatorSensorsSpec(Spec):
    """What is known of the actuators."""

    displacement: Annotated[Displacement, Field(gt=0)] | None = None
    """Standard deviation of measured displacements. Needed where they were recorded."""
    force: Annotated[Effort, Field(gt=0)] | None = None
    """Standard deviation of measured forces. Needed where they were recorded."""
    slip: Annotated[Displacement, Field(gt=0)] | None = None
    """Motion of an actuator from frame to frame beside its command, standard deviation. Without commands: its whole
    motion. 0.05 % of the reach unless given."""
    offset: Annotated[Displacement, Field(gt=0)] | None = None
    """Distance of an actuator from its first command, standard deviation. 5 % of the reach unless given."""
