"""What `estimate.yaml` says: which recording, which markers, what may push."""

from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from cfem.core.actuator_units import Displacement, Effort
from cfem.core.names import Name
from cfem.core.spec import Spec
from cfem.core.units import Force, Length, Point, Time


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


class EstimateSpec(Spec):
    """Where the robot is and who pushes it, frame by frame, from recorded markers."""

    model: Path
    """Folder of a model with a skin."""
    recording: Path
    """Table of the frames, .csv or .parquet: columns `NAME.x [mm]`, `.y`, `.z` of each marker, and where they were
    recorded `time [s]`, `ACTUATOR.displacement [mm]`, `ACTUATOR.force [N]` and `ACTUATOR.command [mm]`."""
    out: Path
    """Folder for the result."""
    markers: dict[Name, Point] = Field(min_length=1)
    """Place of each marker on the surface at rest, in the scene's frame."""
    noise: Annotated[Length, Field(gt=0)]
    """Standard deviation of each measured coordinate."""
    loads: LoadsSpec | None = None
    """Unknown forces. None unless given."""
    actuators: ActuatorSensorsSpec = ActuatorSensorsSpec()
    """What is known of the actuators."""
    each_frame: bool = False
    """Whether each frame is estimated alone. All frames before it count otherwise."""
    truth: Path | None = None
    """Table of true forces and displacements, columns `ROW.force [N]` of the loaded rows and `ACTUATOR.displacement
    [mm]`, to compare with."""

    @model_validator(mode="after")
    def _names_differ(self):
        if "time" in self.markers:
            raise ValueError("markers: 'time' names the column of times; give the marker another name")
        return self
