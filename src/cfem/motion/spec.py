"""simulate.yaml: commands over time, and what the robot carries."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from cfem.core.names import Name
from cfem.core.spec import Spec
from cfem.core.units import AccelerationVector, Mass, Time


class PayloadSpec(Spec):
    """A mass that the robot carries at an effector's point."""

    mass: Annotated[Mass, Field(gt=0)]
    """Mass."""
    gravity: AccelerationVector | None = None
    """Acceleration of gravity along x, y and z, which gives it its weight. Without weight unless given."""
    effector: Name | None = None
    """Effector that carries it. The first unless given."""


class FullSpec(Spec):
    """The same motion in full finite elements, for comparison. It takes minutes."""

    scene: Path
    """scene.yaml of the robot."""
    mesh: Path | None = None
    """Folder of its mesh. The scene's `out` unless given."""


class SimulateSpec(Spec):
    """Motion of a learned model under commands over time."""

    model: Path
    """Folder of a trained model that has learned to move."""
    commands: Path
    """Table of the commands, .csv, .parquet or .yaml: `time [s]`, and for each actuator `NAME.displacement [mm]`, or
    for each `NAME.force [N]`. Between its rows commands are interpolated linearly. The robot stands still at
    the first."""
    out: Path
    """Folder for the result."""
    until: Annotated[Time, Field(gt=0)] | None = None
    """End. That of the table unless given; the last command is kept beyond it."""
    step: Annotated[Time, Field(gt=0)] | None = None
    """Length of a step. A fiftieth of the first natural period unless given."""
    payload: PayloadSpec | None = None
    """What the robot carries. Nothing unless given."""
    unilateral: bool | None = None
    """Whether actuators go slack instead of pushing. Cables do, chambers do not, unless given."""
    full: FullSpec | None = None
    """Full finite elements beside it. None unless given."""
