"""Spec of objectives: what a design may be best at."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from cfem.condensed.parameters import Value
from cfem.core.spec import Spec
from cfem.core.units import Angle, Force, Point
from cfem.robot.selection import Direction


class EffectorSpec(Spec):
    """An objective of one effector."""

    effector: str | None = None
    """Name of the effector. The first unless given."""


class DexteritySpec(EffectorSpec):
    """|angle - alpha| with alpha = arccos(tip_z / |rest|): how far the effector turns."""

    kind: Literal["dexterity"]
    """How far the effector turns."""
    axis: Literal["x", "y", "z"] = "z"
    """Axis that alpha is measured from."""
    angle: Angle = np.pi / 2
    """Wanted angle."""
    rest: Point | None = None
    """Point of rest for all designs. Where each design rests unless given."""


class StrengthSpec(EffectorSpec):
    """|largest - |lambda_c||, where lambda_c is the force along `axis` that holds the effector at rest."""

    kind: Literal["strength"]
    """How strongly the effector pushes."""
    axis: Literal["x", "y", "z"] = "y"
    """Axis of the force."""
    largest: Force = 91.0
    """Wanted force."""
    rest: Point | None = None
    """Point of rest for all designs. Where each design rests unless given."""


class FunctionSpec(Spec):
    """Your own function of W (m, n, n), delta_free (m, n) and p (m, n_p), which returns (m,)."""

    kind: Literal["python"]
    """A Python function."""
    function: str
    """'module:function' or 'file.py:function'."""
    sense: Literal["minimise", "maximise"] = "minimise"
    """Whether smaller or larger is better."""
    unit: str = ""
    """Unit of what it returns, such as 'N': printed beside the numbers."""


class ReachSpec(EffectorSpec):
    """Where the effector goes, over all of the actuators' reach: a length of one actuator, an area of two, a volume of
    three. More is better."""

    kind: Literal["workspace"]
    """How much the effector reaches."""
    points: int = Field(5, ge=2, le=20)
    """Actuations along each actuator's reach."""


class ManipulabilitySpec(EffectorSpec):
    """How far the effector goes for a unit of actuation, in the direction in which it goes least; mean over the
    actuators' reach. More is better."""

    kind: Literal["manipulability"]
    """Dexterity over the workspace."""
    points: int = Field(3, ge=2, le=20)
    """Actuations along each actuator's reach."""


class StiffnessSpec(EffectorSpec):
    """Force on the effector per mm that it yields along a direction, actuators held. More is better."""

    kind: Literal["stiffness"]
    """How stiff the effector is."""
    direction: Direction
    """Direction of the force."""
    points: int | None = Field(None, ge=2, le=20)
    """Actuations along each actuator's reach, of which the softest counts. At the actuation alone unless given."""


class ForceSpec(EffectorSpec):
    """Force that the effector gives along a direction where it is held at a goal, actuators held, to first order. More
    is better."""

    kind: Literal["force"]
    """How strongly the effector pushes at a goal."""
    direction: Direction
    """Direction of the force."""
    goal: Point
    """Where the effector is held."""


class BodySpec(Spec):
    """A number of the whole body. Less is better. By finite elements only, but for the volume."""

    kind: Literal["volume", "mass", "strain", "stress"]
    """Volume; mass; largest principal strain or von Mises' stress at the actuation, as a mean of power 16 over the
    body."""


class FrequencySpec(Spec):
    """Lowest natural frequency of small vibrations about the state at the actuation, Hz, undamped. More is better. By
    finite elements only."""

    kind: Literal["frequency"]
    """How fast the robot vibrates."""
    actuators: Literal["held", "free"] = "held"
    """Whether actuators stand still while the robot vibrates, or pull with constant forces."""

    @property
    def number(self) -> str:
        """Name among the numbers of the body."""
        return "frequency" if self.actuators == "held" else "free frequency"


class RobustSpec(Spec):
    """Another objective where parameters scatter as manufacture scatters them: normally, independently, within their
    ranges."""

    kind: Literal["robust"]
    """An objective over scattered parameters."""
    of: str
    """Name of the objective."""
    scatter: dict[str, Value] = Field(min_length=1)
    """Standard deviation of each parameter that scatters."""
    statistic: Literal["mean", "quantile"] = "quantile"
    """Mean, or the quantile that `share` of the robots do no worse than."""
    share: float = Field(0.95, gt=0, lt=1)
    """Share of the robots, for the quantile."""
    robots: int = Field(64, ge=8, le=10_000)
    """Number of robots that are tried."""


Objective = Annotated[
    DexteritySpec
    | StrengthSpec
    | FunctionSpec
    | ReachSpec
    | ManipulabilitySpec
    | StiffnessSpec
    | ForceSpec
    | BodySpec
    | FrequencySpec
    | RobustSpec,
    Field(discriminator="kind"),
]
