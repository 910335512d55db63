"""What `control.yaml` says of a robot that moves between ticks, and of controllers that know how."""

from typing import Literal

from pydantic import Field, NonNegativeFloat, PositiveInt

from cfem.core.spec import Spec
from cfem.core.units import Frequency, Length, Point, Time
from cfem.robot.selection import Direction


class MovingSpec(Spec):
    """A plant that moves between ticks. The material of its scene needs a density."""

    substeps: PositiveInt = 2
    """Steps in time per tick. Steps that are not found are halved."""


class LapsSpec(Spec):
    """Goals run round each trajectory, taken as a closed curve, at constant speed."""

    speeds: list[Frequency] = Field(min_length=1)
    """Laps per second. The trajectory is run at each of these."""
    laps: PositiveInt = 1
    """Laps that count."""
    run_up: Time = 0.5
    """Time before them, in which the speed grows from zero."""


class DoubtSpec(Spec):
    """What the observer of a predictive controller takes to be uncertain, as standard deviations."""

    noise: Length | None = None
    """Of a measured coordinate. That of the sensor unless given, and 0.01 mm where it has none."""
    stiffness: NonNegativeFloat = 0.2
    """Of the robot's stiffness over the model's, as a share, at the start."""
    viscosity: NonNegativeFloat = 0.3
    """Of the robot's viscosity over the model's, as a share, at the start."""
    wander: NonNegativeFloat = 0.1
    """Of what stiffness and viscosity change by in a second, as a share of their own."""
    offset: Length = 0.3
    """Of what the effectors' error at rest changes by in a second."""
    push: Length = 0.03
    """Of the effectors' displacement by unknown forces that act for one tick, at rest."""


class HalfSpaceSpec(Spec):
    """A plane that the first effector should not pass."""

    point: Point
    """A point of the plane."""
    normal: Direction
    """Direction, x, y and z, of the side where the effector may be."""


class MpcSpec(Spec):
    """Model predictive control on the condensed dynamics. In mode open it is a feed-forward along what lies ahead."""

    horizon: PositiveInt = 20
    """Ticks that are planned ahead."""
    moves: PositiveInt | None = None
    """Commands that are planned apart, later ones held for several ticks. As many as the horizon has ticks unless
    given."""
    smooth: float = Field(1e-3, gt=0)
    """Cost of a change of command by its full range in one tick, relative to missing the goal by the robot's length."""
    effort: NonNegativeFloat = 1e-10
    """Cost of a command that is its full range away from the first one, likewise."""
    doubt: DoubtSpec = DoubtSpec()
    """What its observer takes to be uncertain. Mode closed."""
    obstacles: list[HalfSpaceSpec] = []
    """Planes that the first effector should not pass, as the controller predicts it."""


class ShapingSpec(Spec):
    """Input shaping for the natural frequencies where the robot is, as the condensed dynamics has them."""

    kind: Literal["zv", "zvd"] = "zv"
    """zv: zero vibration, two impulses per mode. zvd: zero vibration and derivative, three, for uncertain
    frequencies."""
    modes: PositiveInt = 1
    """Number of modes that are shaped, lowest first."""
