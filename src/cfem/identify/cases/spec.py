"""cases.yaml: which load cases were measured, what is not known of the robot and its rig, which models to compare."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, WithJsonSchema

from cfem.core.names import Name
from cfem.core.spec import Spec
from cfem.core.units import Length, Point
from cfem.sample.spec import ParameterSpec

_SD = {"type": ["string", "number"], "description": "a quantity with its unit, a number, or a share such as '20 %'"}


class ForceColumn(Spec):
    """The column that holds an actuator's force, tension or pressure."""

    column: str
    """Name of the column."""
    unit: str
    """Unit of its numbers, such as N or kPa."""


class TableColumns(Spec):
    """Which columns of the table mean what. It has one row for each marker of each load case; other columns are
    ignored."""

    case: list[str] = Field(min_length=1)
    """Columns that together name a load case."""
    session: list[str] = []
    """Columns that together name the session, in which cameras and markers stayed where they were. Two recordings that
    were laid on the scene apart from each other are two sessions."""
    marker: str = "marker"
    """Column that names the marker."""
    position: list[str] = Field(min_length=3, max_length=3)
    """Columns of the marker's x, y and z. Their unit is `unit`."""
    rest: list[str] | None = Field(None, min_length=3, max_length=3)
    """Columns of its place before the load. With them displacements are compared, and places without."""
    unit: Annotated[Length, Field(gt=0)] = 1.0
    """Size of one unit of these columns, such as '1 mm' or '1 m'."""
    forces: dict[str, ForceColumn] = Field(min_length=1)
    """The column of each actuator of the scene."""
    unloading: str | None = None
    """Column that is 1 where the load had been much larger before, and 0 where not. It matters with friction alone."""
    history: str | None = None
    """Column that names a history: its cases were commanded one after another, as the table has them, the first from
    rest without load. It matters with friction alone. Where the cell is empty, `unloading` tells."""


class Marker(Spec):
    """A marker on the robot."""

    effector: str
    """Effector of the scene that it follows."""
    stand_off: Point | None = None
    """From the effector to the marker, in the axes of the body at rest. It turns with the body there, so the effector
    needs `orientation: true`."""


class Offsets(Spec):
    """How far markers may be from where they are said to be. An unknown of each marker, in the axes that turn with the
    body there."""

    sd: Length = Field(gt=0)
    """Standard deviation of each marker's offset along each axis."""
    session: Annotated[Length, Field(gt=0)] | None = None
    """Standard deviation of how much more it changes from session to session. Not at all unless given."""


class Unknown(ParameterSpec):
    """A number that the measurements shall tell, or that they shall leave within what is known of it."""

    key: str | list[str] = Field(min_length=1)
    """Its path in the scene, such as 'material.young', or several that have the same value; or a number of the rig:
    drive.NAME.scale, offset or limit of an actuator's force, frame.turn.x, frame.shift.x of the cameras' frame."""
    sd: Annotated[Any, AfterValidator(str), WithJsonSchema(_SD)] | None = None
    """Standard deviation of what is known of it, around the scene's value. Nothing unless given."""
    by: Literal["session"] | None = None
    """Whether each session has its own. Only for numbers of the rig."""

    @property
    def keys(self) -> list[str]:
        """Paths of the number."""
        return [self.key] if isinstance(self.key, str) else self.key


class CasesSpec(Spec):
    """Calibration by load cases: markers, cameras and drives of a real robot included."""

    scene: Path
    """The scene."""
    mesh: Path
    """Its mesh."""
    measurements: Path
    """The table of load cases, a .csv file."""
    out: Path
    """Folder for the result."""
    layout: TableColumns
    """Which columns of the table mean what."""
    markers: dict[Name, Marker] = Field(min_length=1)
    """Markers, by their names in the table. Others in the table are ignored."""
    offsets: Offsets | None = None
    """How far markers may be from where they are said to be. Not at all unless given."""
    discrepancy: bool = False
    """Whether to estimate what the model lacks, a smooth function of the forces at each marker. It corrects predictions
    near what was measured and widens intervals elsewhere. It wants three cases an actuator at least."""
    parameters: dict[Name, Unknown] = Field(min_length=1)
    """What is not known of the robot and its rig."""
    find: list[str] | None = Field(None, min_length=1)
    """Parameters of the model to keep. All unless given; the others stay as the scene has them."""
    compare: dict[str, list[str]] = {}
    """Other models, by name: the parameters that each of them finds."""
    scatter: Length = Field(default=1.0, gt=0)
    """First guess of what no model explains in a coordinate. It is estimated from what the fit leaves, and with it how
    it grows with the load."""
    confidence: float = Field(0.95, gt=0, lt=1)
    """Level of the intervals."""
    figure: bool = True
    """Whether to draw a figure."""

    def check(self) -> None:
        """Raises ValueError where fields do not go together."""
        for name, unknown in self.parameters.items():
            scene_keys = [key for key in unknown.keys if not is_of_rig(key)]
            if unknown.by and scene_keys:
                raise ValueError(f"parameters.{name}.by: '{scene_keys[0]}' is of the scene, of which there is one")
            if unknown.by and not self.layout.session:
                raise ValueError(f"parameters.{name}.by: the layout names no column of sessions")
        models = {"find": self.find or []} | {f"compare.{name}": find for name, find in self.compare.items()}
        for where, names in models.items():
            strange = [name for name in names if name not in self.parameters]
            if strange:
                raise ValueError(f"{where}: '{strange[0]}' is none of the parameters {', '.join(self.parameters)}")
        if self.offsets is not None and self.offsets.session is not None and not self.layout.session:
            raise ValueError("offsets.session: the layout names no column of sessions")


def is_of_rig(key: str) -> bool:
    """True where a key names a number of the rig, not of the scene."""
    return key.split(".")[0] in ("drive", "frame")
