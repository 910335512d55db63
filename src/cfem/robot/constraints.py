"""Spec of what drives, touches, loads and watches the robot."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, PositiveInt

from cfem.core.names import Name
from cfem.core.spec import Spec
from cfem.core.units import ForceVector, Length, LengthRange, Point, Points, StressRange, VolumeRange
from cfem.robot.selection import Direction


def _either(*keys: str) -> ConfigDict:
    """Tells editors that exactly one of these keys is due."""
    return ConfigDict(json_schema_extra={"oneOf": [{"required": [key]} for key in keys]})


class Route(Spec):
    """A path along a body of the catalogue, whose points follow its lengths. Give x and y in a soft finger, a side of a
    bar, a trunk or a diamond."""

    x: Length | None = None
    """Coordinate x of a cable through the segments of a soft finger."""
    y: Length | None = None
    """Coordinate y of a cable through the segments of a soft finger."""
    side: Literal["x+", "x-", "y+", "y-", "z+", "z-"] | None = None
    """Side of the body along which the cable runs. It states the pull point too, unless there is one."""
    disks: PositiveInt | None = None
    """Number of disks of a trunk that the cable passes, counted from the base. All unless given."""


class Shift(Spec):
    """How far a cable's channel lies from where its points say, such as a calibration finds."""

    y: Length = 0.0
    """Along y."""
    z: Length = 0.0
    """Along z."""
    outward: Length = 0.0
    """Away from the x axis, of a taper."""


class Cable(Spec):
    """A cable through points of the body. Give its points or, in a body of the catalogue, a route."""

    model_config = _either("points", "route")
    kind: Literal["cable"]
    """A cable."""
    name: Name
    """Name of the cable."""
    points: Points | None = None
    """Points of the body that the cable runs through, from the pull point on."""
    route: Route | None = None
    """Path along a body of the catalogue. Its points move with the design."""
    pull_point: Point | None = None
    """Fixed point outside the body from which the cable is pulled."""
    radius: Length = Field(default=2.0, ge=0)
    """Radius of the region through which each point acts; 0 for a mathematical point."""
    shift: Shift | None = None
    """How far the cable lies from its points."""
    friction: float = Field(default=0.0, ge=0)
    """Coefficient of friction between cable and guides. The tension falls by exp(-friction times the angle turned)."""
    reach: LengthRange
    """Smallest and largest shortening."""
    unilateral: bool = True
    """Whether the cable can only pull and not push."""
    body: str | None = None
    """Part, or named group of cells, that all points belong to."""
    through_air: bool = Field(default=False, exclude=True)
    """Whether the cable may leave the body between its points. It changes nothing else."""

    def check(self) -> None:
        _demand_one(f"cable '{self.name}'", points=self.points, route=self.route)
        _demand_ranges(f"cable '{self.name}'", "pulls", self.unilateral, reach=self.reach)


class Push(Spec):
    """A force in a fixed direction, such as that of a weight, driven by its size."""

    kind: Literal["push"]
    """A force in a fixed direction."""
    name: Name
    """Name of the force."""
    points: Points
    """Points of the body that share the force equally."""
    direction: Direction
    """Direction of the force, x, y and z."""
    radius: Length = Field(default=2.0, ge=0)
    """Radius of the region through which each point acts; 0 for a mathematical point."""
    reach: LengthRange
    """Smallest and largest way of the points along the force."""
    unilateral: bool = False
    """Whether the force never points the other way."""
    body: str | None = None
    """Part, or named group of cells, that all points belong to."""

    def check(self) -> None:
        _demand_ranges(f"push '{self.name}'", "pushes", self.unilateral, reach=self.reach)


class Cavity(Spec):
    """A chamber, driven by the growth of its volume against a pressure. Give a point inside or a surface."""

    model_config = _either("inside", "surface")
    kind: Literal["cavity"]
    """A chamber with walls that deform."""
    name: Name
    """Name of the chamber."""
    inside: Point | None = None
    """A point in the void. The void must be closed on all sides."""
    surface: str | None = None
    """Name of a facet set of the mesh file."""
    reach: VolumeRange
    """Smallest and largest growth of the volume."""
    pressure: StressRange | None = None
    """Smallest and largest pressure, between which sample.yaml can draw."""
    unilateral: bool = False
    """Whether the chamber can only push and not suck."""

    def check(self) -> None:
        _demand_one(f"cavity '{self.name}'", inside=self.inside, surface=self.surface)
        _demand_ranges(f"cavity '{self.name}'", "pushes", self.unilateral, reach=self.reach, pressure=self.pressure)


class Chambers(Spec):
    """Chambers of one module of a stiff-flop that share a pressure, driven by the growth of their volume."""

    kind: Literal["chambers"]
    """Chambers of a stiff-flop."""
    name: Name
    """Name of this group of chambers."""
    module: PositiveInt
    """Number of the module, 1 at the base."""
    chambers: list[Annotated[int, Field(ge=0, le=5)]] = Field(min_length=1)
    """Numbers of the chambers, 0 to 5."""
    reach: VolumeRange
    """Smallest and largest growth of the volume."""
    pressure: StressRange | None = None
    """Smallest and largest pressure, between which sample.yaml can draw."""
    unilateral: bool = True
    """Whether the chambers can only push and not suck."""

    def check(self) -> None:
        if len(set(self.chambers)) < len(self.chambers):
            raise ValueError(f"chambers '{self.name}': a chamber is named twice, of {self.chambers}")
        _demand_ranges(f"chambers '{self.name}'", "push", self.unilateral, reach=self.reach, pressure=self.pressure)


Actuator = Annotated[Cable | Push | Cavity | Chambers, Field(discriminator="kind")]


class Contact(Spec):
    """A point of the body that something may touch. It has three rows: x, y and z."""

    name: Name
    """Name of the point."""
    point: Point
    """Place of the point."""
    radius: Length = Field(default=2.0, ge=0)
    """Radius of the region through which it acts."""
    body: str | None = None
    """Part, or named group of cells, that the point belongs to."""


class Effector(Spec):
    """A watched point. Give a point, or points whose mean is watched, or a place that has a name. A point
    outside the body is carried by the rigid motion that fits the body near it best."""

    name: Name
    """Name of the effector."""
    point: Point | None = None
    """Place of the effector."""
    points: Points | None = None
    """Points whose mean is watched."""
    at: Literal["tip", "centre-of-mass"] | None = None
    """tip: the free end of a body of the catalogue, which moves with its design. centre-of-mass: that of the whole
    body, on which gravity acts; no goal is set for it, and the materials need their density."""
    radius: Length = Field(default=2.0, ge=0)
    """Radius of the region over which the motion is averaged."""
    carrier_radius: Length = Field(default=10.0, gt=0)
    """For a point outside the body: what lies within this distance carries it."""
    orientation: bool = False
    """Whether its rotation vector is watched too: rows rx, ry, rz."""
    body: str | None = None
    """Part, or named group of cells, that the effector belongs to."""

    def check(self) -> None:
        _demand_one(f"effector '{self.name}'", point=self.point, points=self.points, at=self.at)
        if self.at == "centre-of-mass" and (self.orientation or self.body):
            raise ValueError("a centre of mass is of the whole body and has no orientation")

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes of the effector's rows."""
        return ("x", "y", "z", "rx", "ry", "rz") if self.orientation else ("x", "y", "z")


class Load(Spec):
    """A constant force on a point of the body. It keeps its direction."""

    point: Point
    """Where the force acts."""
    force: ForceVector
    """The force along x, y and z."""
    radius: Length = Field(default=2.0, ge=0)
    """Radius of the region through which it acts."""
    body: str | None = None
    """Part, or named group of cells, that the point belongs to."""


def _demand_ranges(what: str, does: str, unilateral: bool, **ranges: Any) -> None:
    """Raises ValueError where a range does not ascend, or where that of an actuator that only pulls or inflates has no
    positive end."""
    for name, ends in ranges.items():
        if ends is None:
            continue
        low, high = ends
        if not low < high:
            raise ValueError(f"{what}: {name} must be two numbers, the smaller first")
        if unilateral and not high > 0:
            only = f"it only {does} (unilateral), so its {name} must end above 0"
            raise ValueError(f"{what}: {only}; got {low:g} to {high:g}")


def _demand_one(what: str, **choices: object) -> None:
    given = [name for name, value in choices.items() if value is not None]
    if len(given) != 1:
        *names, last = choices
        got = f"{' and '.join(given)} both" if given else "none"
        raise ValueError(f"{what}: give one of {', '.join(names)} and {last}, got {got}")
