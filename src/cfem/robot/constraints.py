"""What drives, touches, loads and watches the robot, as the user writes it."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, PositiveInt, model_validator

from cfem.core.names import Name
from cfem.core.spec import Spec
from cfem.core.units import ForceVector, Length, LengthRange, Point, Points, StressRange, VolumeRange


def _either(one: str, other: str) -> ConfigDict:
    """Says to editors that exactly one of two keys is due."""
    return ConfigDict(json_schema_extra={"oneOf": [{"required": [one]}, {"required": [other]}]})


class Route(Spec):
    """A straight way along a soft finger, at x and y: through its segments, seen at their sloped faces."""

    x: Length
    y: Length


class Cable(Spec):
    """A cable through points of the body, from a fixed pull point where one is given. points; or route, along a soft
    finger, whose points then move with its design. reach: its smallest and largest shortening. radius: of the region
    through which each point acts, 0 for a mathematical point. unilateral: it can pull and cannot push. body: the part,
    or named group of cells, that all its points belong to."""

    model_config = _either("points", "route")
    kind: Literal["cable"]
    name: Name
    points: Points | None = None
    route: Route | None = None
    pull_point: Point | None = None
    radius: Length = Field(default=2.0, ge=0)
    reach: LengthRange
    unilateral: bool = True
    body: str | None = None

    @model_validator(mode="after")
    def _ordered(self):
        _demand_one(f"cable '{self.name}'", points=self.points, route=self.route)
        _demand_order(f"cable '{self.name}'", self.reach)
        return self


class Cavity(Spec):
    """A chamber, driven by the growth of its volume against a pressure. inside: a point in the void, which must be
    closed on all sides; or surface: the name of a facet set of the mesh file. reach: smallest and largest growth;
    pressure: smallest and largest pressure, between which sample.yaml can draw. unilateral: it can push and cannot
    suck."""

    model_config = _either("inside", "surface")
    kind: Literal["cavity"]
    name: Name
    inside: Point | None = None
    surface: str | None = None
    reach: VolumeRange
    pressure: StressRange | None = None
    unilateral: bool = False

    @model_validator(mode="after")
    def _ordered(self):
        _demand_one(f"cavity '{self.name}'", inside=self.inside, surface=self.surface)
        _demand_order(f"cavity '{self.name}'", self.reach)
        _demand_order(f"cavity '{self.name}'", self.pressure, "pressure")
        return self


class Chambers(Spec):
    """Chambers of one module of a stiff-flop that share a pressure, driven by the growth of their volume. module: 1 at
    the base; chambers: their numbers, 0 to 5. reach: smallest and largest growth; pressure: smallest and largest
    pressure, between which sample.yaml can draw. unilateral: they can push and cannot suck."""

    kind: Literal["chambers"]
    name: Name
    module: PositiveInt
    chambers: list[Annotated[int, Field(ge=0, le=5)]] = Field(min_length=1)
    reach: VolumeRange
    pressure: StressRange | None = None
    unilateral: bool = True

    @model_validator(mode="after")
    def _ordered(self):
        if len(set(self.chambers)) < len(self.chambers):
            raise ValueError(f"chambers '{self.name}': a chamber is named twice, of {self.chambers}")
        _demand_order(f"chambers '{self.name}'", self.reach)
        _demand_order(f"chambers '{self.name}'", self.pressure, "pressure")
        return self


Actuator = Annotated[Cable | Cavity | Chambers, Field(discriminator="kind")]


class Contact(Spec):
    """A point of the body that something may touch, through a region of `radius`: three rows, x, y and z. body: the
    part, or named group of cells, that it belongs to."""

    name: Name
    point: Point
    radius: Length = Field(default=2.0, ge=0)
    body: str | None = None


class Effector(Spec):
    """A watched point, or the mean of several `points`, or the point `at` a place that the geometry names: the tip of a
    soft finger, which moves with its design. One that lies outside the body is carried by the best-fit rigid
    motion of what lies within carrier_radius of it. orientation: its rotation vector is watched too, rows rx, ry, rz.
    body: the part, or named group of cells, that it belongs to."""

    name: Name
    point: Point | None = None
    points: Points | None = None
    at: Literal["tip"] | None = None
    radius: Length = Field(default=2.0, ge=0)
    carrier_radius: Length = Field(default=10.0, gt=0)
    orientation: bool = False
    body: str | None = None

    @model_validator(mode="after")
    def _placed(self):
        _demand_one(f"effector '{self.name}'", point=self.point, points=self.points, at=self.at)
        return self

    @property
    def axes(self) -> tuple[str, ...]:
        """Of its rows."""
        return ("x", "y", "z", "rx", "ry", "rz") if self.orientation else ("x", "y", "z")


class Load(Spec):
    """A constant force on a point of the body, through a region of `radius`; it keeps its direction. body: the part, or
    named group of cells, that the point belongs to."""

    point: Point
    force: ForceVector
    radius: Length = Field(default=2.0, ge=0)
    body: str | None = None


def _demand_order(what: str, ends, name: str = "reach") -> None:
    if ends is not None and not ends[0] < ends[1]:
        raise ValueError(f"{what}: {name} must be two numbers, the smaller first")


def _demand_one(what: str, **choices: object) -> None:
    given = [name for name, value in choices.items() if value is not None]
    if len(given) != 1:
        *names, last = choices
        got = f"{' and '.join(given)} both" if given else "none"
        raise ValueError(f"{what}: give one of {', '.join(names)} and {last}, got {got}")
