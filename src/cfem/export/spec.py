"""export.yaml: which trained model, in which formats."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PositiveInt

from cfem.condensed.given import Value
from cfem.core.spec import Spec
from cfem.core.units import Course, Effort, Length, LengthVector, VolumeVector

Format = Literal["arrays", "onnx", "torchscript", "c"]


class ControllerSpec(Spec):
    """The controller around the model, on one robot. Displacements are mm of cables and mm^3 of chambers, forces N
    and MPa.

    command: what the drives take; observer: of where the actuators stand (measured by a sensor; previous_step: the
    last linearisation, the paper's; equilibrium: the model under the last command, by Newton's method); iterations:
    model and program within a tick; step: farthest that an actuator moves in a linearisation; halvings: lengths of
    step tried, each half the last, until the model says that it leads nearer to the goal, 0 takes it unseen, as the
    paper does; tolerance: a smaller move of every actuator is not made; rate, force_rate: by which the command may
    change in a tick; unilateral: actuators pull and do not push; largest_force: of any actuator; regularisation: what
    full course costs relative to missing by the robot's length; damping: what a move by full course in a tick costs,
    which keeps redundant actuators from wandering; weights: of effector rows; K_P, K_I: gains on the
    measured error, per tick; integral_limit: longest that K_I sum(e) becomes; start: where the actuators stand at
    first, 0 unless given."""

    command: Literal["displacement", "force"] = "displacement"
    observer: Literal["measured", "previous_step", "equilibrium"] = "previous_step"
    iterations: Annotated[int, Field(ge=1, le=50)] = 1
    halvings: Annotated[int, Field(ge=0, le=20)] = 8
    tolerance: Course = 1e-5
    step: Course = 5.0
    rate: Course | None = None
    force_rate: Effort | None = None
    unilateral: bool = True
    largest_force: Effort | None = None
    regularisation: float = Field(1e-10, gt=0)
    damping: float = Field(0.0, ge=0)
    weights: list[Annotated[float, Field(ge=0)]] | None = None
    K_P: float = Field(0.01, ge=0)
    K_I: float = Field(0.002, ge=0)
    integral_limit: Length = 10.0
    start: LengthVector | VolumeVector | None = None


class CSpec(Spec):
    """C99 for firmware. scalar: of the model, the program is always solved in double; hidden_weights: of a network's
    hidden layers, as the scalar or as 16-bit integers; full: also the energy and W_ee, which control does not use;
    parameters: values of the model's parameters, the scene's own unless given; vectors: of the self-test."""

    scalar: Literal["double", "float"] = "double"
    hidden_weights: Literal["scalar", "int16"] = "scalar"
    full: bool = False
    parameters: dict[str, Value] = {}
    vectors: PositiveInt = 100
    controller: ControllerSpec = ControllerSpec()


class ExportSpec(Spec):
    """model: folder of `cfem train`; scene: for the format c, whose stated pressures bound the multipliers."""

    model: Path
    scene: Path | None = None
    out: Path
    formats: tuple[Format, ...] = ("arrays", "onnx", "torchscript")
    c: CSpec = CSpec()
