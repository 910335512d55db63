"""measurements.yaml: which recordings show which load cases, and where the markers are."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from cfem.core.names import Name
from cfem.core.spec import Spec
from cfem.core.units import Length, Point, Time


class RecordingSpec(Spec):
    """One recording of one load case."""

    file: Path
    """Export of OptiTrack Motive or Vicon Nexus (.csv), .c3d, or a table with columns t_s, NAME_x_mm, NAME_y_mm,
    NAME_z_mm (.csv)."""
    case: Name
    """Name of the load case."""
    session: Name = "1"
    """Session, in which cameras and markers stayed where they were."""
    forces: dict[str, float]
    """Force of each actuator, a number in the unit that cases.yaml states for the column."""
    unit: Annotated[Length, Field(gt=0)] | None = None
    """Size of one unit of the file's numbers, such as '1 m'. The file's own statement unless given."""
    labels: dict[str, str] = {}
    """Names of markers by their labels in the file. By their places unless given."""


class Settle(Spec):
    """What counts as settled."""

    window: Annotated[Time, Field(gt=0)] = 0.5
    """Length of time."""
    within: Annotated[Length, Field(gt=0)] = 0.5
    """Distance that a marker may move from its mean in that time."""


class RegistrationSpec(Spec):
    """How the cameras' frame is laid on the scene's."""

    by: list[Name] | None = None
    """Markers by which it is laid. Those that do not move, or all where the robot is at rest at first, which `rest`
    says. All unless given."""
    tolerance: Annotated[Length, Field(gt=0)] = 5.0
    """Distance by which markers may miss their places (root mean square)."""


class MeasurementsSpec(Spec):
    """Recordings of camera systems to a table of load cases, in the scene's frame."""

    recordings: list[RecordingSpec] = Field(min_length=1)
    """The recordings."""
    out: Path
    """Folder for the table."""
    markers: dict[Name, Point]
    """Place of each marker before the load, in the scene's frame. At least three."""
    rest: bool = True
    """Whether each recording begins with the robot at rest, where the markers are at their places. The last settled
    stretch is the load case."""
    settle: Settle = Settle()
    """What counts as settled."""
    registration: RegistrationSpec = RegistrationSpec()
    """How the cameras' frame is laid on the scene's."""

    def check(self) -> None:
        """Raises ValueError where the markers cannot lay a frame."""
        if len(self.markers) < 3:
            raise ValueError(f"markers: three places at least are needed to lay a frame, got {len(self.markers)}")
        strange = [name for name in self.registration.by or [] if name not in self.markers]
        if strange:
            raise ValueError(f"registration.by: '{strange[0]}' is none of the markers {', '.join(self.markers)}")
        if not self.rest and self.registration.by is None:
            raise ValueError("registration.by: without rest, name the markers that do not move")
