"""What a spec says of markers, unknown forces and the sensors of the actuators, wherever a state is estimated."""

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from cfem.core.actuator_units import Displacement, Effort
from cfem.core.names import Name
from cfem.core.spec import Spec
from cfem.core.units import Force, Length, Point, Time
from cfem.predict.estimation.gate import GateSpec

if TYPE_CHECKING:
    from cfem.predict.estimation.estimate import Estimator
    from cfem.predict.protocol import Predictor


class LoadsSpec(Spec):
    """Unknown forces."""

    rows: list[str] = Field(min_length=1)
    """Rows of the model that they act on: `tip.x` of an effector, `skin.1` of a mode of the surface."""
    largest: Annotated[Force, Field(gt=0)]
    """About how large one becomes, standard deviation."""
    lasts: Annotated[Time, Field(gt=0)] | None = None
    """For how long one keeps its value. The whole recording unless given."""
    along: list[float] | None = None
    """Direction of the force where it is known, a number for each of the rows: the normal of the surface where
    something touches it."""

    def check(self) -> None:
        if self.along is not None and (len(self.along) != len(self.rows) or not any(self.along)):
            raise ValueError(f"along: expected {len(self.rows)} numbers, one for each row, and not all 0")


class DynamicsSpec(Spec):
    """A robot that moves from frame to frame: a filter on the dynamics that its model has learned. Standard
    deviations."""

    push: Annotated[Length, Field(gt=0)] = 0.03
    """Displacement of the effectors by forces that nobody states, each lasting a hundredth of a second, at rest."""
    swing: Annotated[Length, Field(gt=0)] | None = None
    """Vibration of the effectors at the start. 5 % of the robot's length unless given."""
    stiffness: Annotated[float, Field(ge=0)] = 0.1
    """Stiffness over the model's, as a share, at the start."""
    wander: Annotated[float, Field(ge=0)] = 0.1
    """Change of the stiffness in a second, as a share of that."""


class DrivenDynamicsSpec(DynamicsSpec):
    """A filter on the dynamics that the model has learned. Standard deviations."""

    driven: Literal["displacement", "force"] = "displacement"
    """What the actuators are told: unit of their commands. Forces need a command in each frame."""


class ActuatorSensorsSpec(Spec):
    """What is known of the actuators."""

    displacement: Annotated[Displacement, Field(gt=0)] | None = None
    """Standard deviation of measured displacements. Needed where they were recorded."""
    force: Annotated[Effort, Field(gt=0)] | None = None
    """Standard deviation of measured forces. Needed where they were recorded."""
    slip: Annotated[Displacement, Field(gt=0)] | None = None
    """Motion of an actuator from frame to frame beside its command, standard deviation. Without commands: its whole
    motion. 0.05 % of the reach unless given."""
    offset: Annotated[Displacement, Field(gt=0)] | None = None
    """Distance of an actuator from its first command, standard deviation. 5 % of the reach unless given."""


class MarkersSpec(Spec):
    """Markers on the surface, and what is known beside them."""

    markers: dict[Name, Point] = Field(min_length=1)
    """Place of each marker on the surface at rest, in the scene's frame."""
    noise: Annotated[Length, Field(gt=0)]
    """Standard deviation of each measured coordinate."""
    loads: LoadsSpec | None = None
    """Unknown forces. None unless given."""
    actuators: ActuatorSensorsSpec = ActuatorSensorsSpec()
    """Sensors of the actuators, and how well these follow their commands."""
    dynamics: DynamicsSpec | None = None
    """A robot that moves from frame to frame, of a model that has learned to. At rest in each frame unless given."""
    gate: GateSpec = GateSpec()
    """Frames that the filter rejects."""

    @property
    def lasts(self) -> float:
        """Time (s) for which a load keeps its value, infinite unless stated."""
        return np.inf if self.loads is None or self.loads.lasts is None else self.loads.lasts


def estimator_of(spec: MarkersSpec, model: "Predictor", p: np.ndarray | None = None) -> "Estimator":
    """Estimator of a spec; p (n_p,): parameters of the model. InputError where the model cannot tell."""
    from cfem.predict.estimation.estimate import Estimator

    loads, sensors = spec.loads, spec.actuators
    return Estimator(
        model,
        np.array(list(spec.markers.values())),
        spec.noise,
        tuple(loads.rows) if loads else (),
        loads.largest if loads else 1.0,
        sensors.displacement or 1.0,
        sensors.force or 1.0,
        p,
        None if loads is None or loads.along is None else np.array(loads.along),
    )
