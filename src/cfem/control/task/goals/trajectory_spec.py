"""Trajectories of `control.yaml`: goals on an arc, one by one, or on a curve that the robot can reach."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import ConfigDict, Field, NonNegativeInt, PositiveInt

from cfem.core.spec import Spec
from cfem.core.units import Angle, AngleMatrix, Length, LengthMatrix, LengthVector

About = Literal["origin", "rest"]


class PlacesSpec(Spec):
    """Goals that are places, whether the robot can reach them or not."""

    about: About = "origin"
    """Origin of the places: origin, that of the scene; or rest, where the effector (or object) is at rest,
    so that goals follow a robot of another length."""
    beyond_reach: bool = False
    """True: goals out of reach are meant. The robot goes to the nearest point, and a run that misses them is not
    poor."""


class ArcSpec(PlacesSpec):
    """Goals on an arc of a circle, whether the robot can reach them or not."""

    kind: Literal["arc"]
    """An arc of a circle."""
    centre: LengthVector
    """Centre of the circle."""
    radius: Length = Field(gt=0)
    """Radius of the circle."""
    start: Angle
    """Angle of the first goal."""
    end: Angle
    """Angle of the last goal."""
    plane: Literal["xy", "yz", "zx"]
    """Plane of the circle."""
    goals: PositiveInt
    """Number of goals on the arc."""
    from_rest: NonNegativeInt = 0
    """Number of goals before the arc, on the straight line from where the effector rests."""


class HalfSphereSpec(PlacesSpec):
    """Goals on a spiral over the upper half of a sphere, from its top down to its equator, whether the robot can reach
    them or not."""

    kind: Literal["half-sphere"]
    """A spiral over a half sphere."""
    centre: LengthVector
    """Centre of the sphere."""
    radius: Length = Field(gt=0)
    """Radius of the sphere."""
    turns: float = 3.0
    """Turns about the z axis."""
    goals: PositiveInt
    """Number of goals."""


class GoalsSpec(PlacesSpec):
    """Goals one by one, or on straight lines. Give points or a file."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": ["points"]}, {"required": ["file"]}]})
    kind: Literal["goals"]
    """Stated goals."""
    points: LengthMatrix | None = None
    """Goals of the effectors, one row per goal."""
    file: Path | None = None
    """Table of them instead, .csv, .parquet or .yaml: one row per goal, with a column for each effector row and its
    unit, such as `tip.x [mm]`."""
    goals: int | None = Field(None, ge=2)
    """Number of goals, evenly spaced on the straight lines from each point to the next, both ends included. The points
    themselves unless given."""
    rotation: AngleMatrix | None = None
    """Orientation of the object at the goals: its rotation vector from rest, one row per goal. It is left free unless
    given."""
    let_go: bool = False
    """Whether the last goal is a place of the table, where robots put their object down and let it go: all actuators go
    back to rest. It needs object.table."""

    def check(self) -> None:
        """Checks which keys go together."""
        if (self.points is None) == (self.file is None):
            raise ValueError("give goals by `points` or by `file`, one of both")
        if self.rotation is None:
            return
        if self.points is None or self.goals is not None:
            raise ValueError("rotation goes with points, one row per goal, and not with file or goals")
        if len(self.rotation) != len(self.points):
            raise ValueError(f"{len(self.points)} points, but {len(self.rotation)} rows of rotation: give one per goal")

    def demand_object(self, name: str, turns: bool, table: bool) -> None:
        """ValueError where these goals, of this name, ask for what only an object that turns has, or one on a table."""
        if self.rotation is not None and not turns:
            raise ValueError(f"trajectories.{name}.rotation: only an object has one, with object.turns: true")
        if self.let_go and not table:
            raise ValueError(f"trajectories.{name}.let_go: robots let an object go on its table: give object.table")


class ImageSpec(Spec):
    """The image by FE of a closed curve of pulls, so that every goal is reachable. With two actuators the curve is an
    ellipse in [0, 1]^2."""

    kind: Literal["image"]
    """A curve that the robot can reach."""
    centre: float | list[float] = 0.45
    """Centre of the curve: the share of a full pull, one for all actuators or one per actuator."""
    radii: float | list[float] = 0.3
    """Radii of the curve: the share of a full pull, one for all actuators or one per actuator."""
    goals: PositiveInt
    """Number of goals."""
    shape: Literal["ellipse", "figure-eight"] = "ellipse"
    """ellipse: each pull follows the one before by a quarter turn. figure-eight: all swing together twice while they
    swing against each other once."""

    def check(self) -> None:
        stated = {len(each) for each in (self.centre, self.radii) if isinstance(each, list)}
        if len(stated) > 1:
            raise ValueError("centre and radii need one number for all actuators, or one per actuator")
        pairs = zip(*self.shares(max(stated, default=1)), strict=True)
        if any(c - abs(r) < 0 or c + abs(r) > 1 for c, r in pairs):
            raise ValueError("the curve leaves the range [0, 1] of the shares of reach")

    def shares(self, n_a: int) -> tuple[list[float], list[float]]:
        """Centre and radii (n_a,) of so many actuators. ValueError where they state another number of them."""
        shares = [each if isinstance(each, list) else [each] * n_a for each in (self.centre, self.radii)]
        for key, each in zip(("centre", "radii"), shares, strict=True):
            if len(each) != n_a:
                raise ValueError(f"{key} has {len(each)} numbers, the robot {n_a} actuators")
        return shares[0], shares[1]


def meant_beyond(trajectory: object) -> bool:
    """True where goals of a trajectory may lie out of reach."""
    return isinstance(trajectory, PlacesSpec) and trajectory.beyond_reach


def has_been(trajectory: object) -> bool:
    """True where the goals of a trajectory are states of the robot itself."""
    return isinstance(trajectory, ImageSpec)


TrajectorySpec = Annotated[ArcSpec | HalfSphereSpec | GoalsSpec | ImageSpec, Field(discriminator="kind")]
