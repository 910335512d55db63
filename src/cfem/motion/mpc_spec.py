"""Predictive control as the user states it, in a loop of `cfem control` or for firmware."""

from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveInt

from cfem.core.spec import Spec
from cfem.core.units import Length, Point
from cfem.predict.estimation.gate import GateSpec
from cfem.robot.selection import Direction

EVERY = 10  # of the ticks of the horizon, at which what is learned of inertia is asked


class DoubtSpec(Spec):
    """What the observer of a predictive controller takes to be uncertain, as standard deviations."""

    noise: Annotated[Length, Field(gt=0)] | None = None
    """Of a measured coordinate. That of the sensor unless given, and 0.01 mm where it has none."""
    stiffness: NonNegativeFloat = 0.2
    """Of the robot's stiffness over the model's, as a share, at the start."""
    viscosity: NonNegativeFloat = 0.3
    """Of the robot's viscosity over the model's, as a share, at the start."""
    wander: NonNegativeFloat = 0.1
    """Of what stiffness and viscosity change by in a second, as a share of their own."""
    offset: Length = Field(0.3, ge=0)
    """Of what the effectors' error at rest changes by in a second."""
    push: Length = Field(0.03, ge=0)
    """Of the effectors' displacement by unknown forces that act for one tick, at rest."""


class HalfSpaceSpec(Spec):
    """A plane that the first effector should not pass."""

    point: Point
    """A point of the plane."""
    normal: Direction
    """Direction, x, y and z, of the side where the effector may be."""


class MpcSpec(Spec):
    """Model predictive control on the condensed dynamics. In mode open it is a feed-forward along what lies ahead."""

    horizon: Annotated[int, Field(ge=2)] = 20
    """Ticks that are planned ahead."""
    moves: PositiveInt | None = None
    """Commands that are planned apart, later ones held for several ticks. As many as the horizon has ticks unless
    given."""
    smooth: float = Field(1e-2, gt=0)
    """Cost of a change of command by its full range in one tick, relative to missing the goal by the robot's length."""
    effort: NonNegativeFloat = 1e-10
    """Cost of a command that is its full range away from the first one, likewise."""
    doubt: DoubtSpec = DoubtSpec()
    """What its observer takes to be uncertain. Mode closed."""
    gate: GateSpec = GateSpec()
    """Samples that its observer rejects. Mode closed."""
    obstacles: list[HalfSpaceSpec] = []
    """Planes that the first effector should not pass, as the controller predicts it."""


def blocks(ticks: int, moves: int) -> np.ndarray:
    """Ticks (m,) at which a command changes, m = `moves` or `ticks` where that is less: later ones are held longer."""
    count = min(moves, ticks)
    ends = np.geomspace(1, ticks, count).round().astype(int) if count > 1 else np.array([ticks])
    for k in range(1, count):
        ends[k] = max(ends[k], ends[k - 1] + 1)
    return np.concatenate([[0], ends[:-1]])
