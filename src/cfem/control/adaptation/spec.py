"""Spec of `adapt`: what a controller tracks while the robot works."""

from typing import Annotated

from pydantic import Field

from cfem.core.actuator_units import Displacement, Effort
from cfem.core.spec import Spec
from cfem.core.units import Angle, Length, Time


class CameraSpec(Spec):
    """What a camera may have done since it was aligned with the scene."""

    shift: Annotated[Length, Field(ge=0)] = 0.0
    """Standard deviation of its shift along each axis."""
    turn: Annotated[Angle, Field(ge=0)] = 0.0
    """Standard deviation of its rotation about each axis through the scene's origin."""


class AdaptSpec(Spec):
    """Which parameters are tracked while the robot works."""

    noise: Annotated[Length, Field(gt=0)]
    """Standard deviation of each measured coordinate, with what the model misses."""
    find: list[str] | None = Field(None, min_length=1)
    """Parameters of the model. All unless given."""
    forget: Annotated[Time, Field(gt=0)] = 2.0
    """Time after which a sample counts for 1/e, for Young's modulus and losses. The other parameters are taken to
    change 100 times as slowly."""
    loss: Annotated[Effort | Displacement, Field(gt=0)] | None = None
    """What an actuator loses of its command, standard deviation: slack of a cable that is told displacements, friction
    of one that is told forces. None is tracked unless given."""
    camera: CameraSpec | None = None
    """Motion of the camera that sees the effectors, tracked with the parameters. It stands still unless given."""
