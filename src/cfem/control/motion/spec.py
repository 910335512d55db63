"""Spec of a robot that moves between ticks, and of controllers that know how."""

from typing import Annotated, Literal

from pydantic import Field, PositiveInt

from cfem.core.spec import Spec
from cfem.core.units import Frequency, Time


class MovingSpec(Spec):
    """A plant that moves between ticks. The material of its scene needs a density."""

    substeps: PositiveInt = 2
    """Steps in time per tick. Steps that are not found are halved."""


class LapsSpec(Spec):
    """Goals run round each trajectory, taken as a closed curve, at constant speed."""

    speeds: list[Annotated[Frequency, Field(gt=0)]] = Field(min_length=1)
    """Laps per second. The trajectory is run at each of these."""
    laps: PositiveInt = 1
    """Laps that count."""
    run_up: Time = Field(0.5, ge=0)
    """Time before them, in which the speed grows from zero."""


class ShapingSpec(Spec):
    """Input shaping for the natural frequencies where the robot is, as the condensed dynamics has them."""

    kind: Literal["zv", "zvd"] = "zv"
    """zv: zero vibration, two impulses per mode. zvd: zero vibration and derivative, three, for uncertain
    frequencies."""
    modes: PositiveInt = 1
    """Number of modes that are shaped, lowest first."""
