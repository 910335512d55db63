"""Spec of a gait: the crawler, the ground under it, and what commands may be."""

from typing import Annotated

from pydantic import Field, PositiveInt

from cfem.control.holding.spec import RobotSpec, demand_names
from cfem.control.task.run_spec import RunSpec
from cfem.core.names import Name
from cfem.core.spec import Spec
from cfem.core.units import Acceleration, Force, Length, LengthRange, Point
from cfem.robot.selection import Direction

Friction = Annotated[float, Field(ge=0)]


class BaseSpec(Spec):
    """The rigid base to which the legs are fixed: a box, which the corners of its side at the ground carry."""

    centre: Point
    """Centre of the box."""
    half_size: Point
    """Half of its edges along x, y and z."""
    weight: Annotated[Force, Field(gt=0)]
    """Weight of the base. It acts at the centre of the box."""
    pads: Annotated[float, Field(gt=0)] = 1e-2
    """Compliance in mm/N of the pad at each corner."""


class GroundSpec(Spec):
    """The plane on which the crawler goes."""

    point: Point
    """A point of it."""
    normal: Direction
    """Direction out of the ground, to where the crawler is."""
    friction: Friction
    """Coefficient of friction between crawler and ground."""


class GaitSpec(Spec):
    """A cyclic command of all legs that carries the crawler along, found on the first model."""

    base: BaseSpec
    """What the legs are fixed to."""
    ground: GroundSpec
    """Where it goes."""
    gravity: Annotated[Acceleration, Field(gt=0)] | None = None
    """Acceleration of gravity, which gives the legs their own weight. Their scene then needs a last effector
    `at: centre-of-mass`. Without it they have no weight."""
    direction: Direction
    """Where it should go."""
    mirrored: list[Name] = []
    """Robots whose actuators get the commands of the others in reverse order, such as legs on the other side."""
    pulls: LengthRange
    """Smallest and largest command of an actuator."""
    steps: PositiveInt = 16
    """Commands in a cycle."""
    cycles: Annotated[int, Field(ge=2)] = 3
    """Cycles that are walked. The first is left out of the distance per cycle."""
    distance: Annotated[Length, Field(gt=0)] | None = None
    """How far it should go along the direction, from rest. It then walks as many commands as the model needs for that,
    whatever `cycles` says."""
    evaluations: PositiveInt = 24
    """Gaits that are tried on the model."""
    frictions: list[Friction] = []
    """Other coefficients of friction at which model and finite elements walk the same gait."""

    planned_frictions: list[Friction] = []
    """Others at which the model alone walks it, in seconds each."""

    def check(self) -> None:
        if not self.pulls[0] < self.pulls[1]:
            raise ValueError("pulls: expected a smallest and a larger one")


class CrawlingSpec(RunSpec):
    """A crawler: a gait is found on the learned model of a leg, and finite elements walk it."""

    gait: GaitSpec
    """The gait to find."""
    robots: list[RobotSpec] = Field(default=[RobotSpec(name="robot")], min_length=1)
    """The legs: the scene's robot at several places, whose effectors touch the ground."""
    reached: Length = Field(0.1, gt=0)
    """A command is carried out as planned where the base ends nearer than this to where the plan has it."""

    def check(self) -> None:
        if len(self.models) > 1:
            raise ValueError(f"models: a gait takes one model, got {len(self.models)}")
        unknown = set(self.gait.mirrored) - {robot.name for robot in self.robots}
        if unknown:
            raise ValueError(f"gait.mirrored: {sorted(unknown)} are not among the robots")
        demand_names(self.robots)
