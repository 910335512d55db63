"""export.yaml: which trained model, in which formats."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PositiveInt

from cfem.condensed.parameters import Value
from cfem.core.actuator_units import Displacement, Displacements, Effort
from cfem.core.names import Name
from cfem.core.optional import installed
from cfem.core.spec import Spec
from cfem.core.units import Angle, Frequency, Length, Point, Time
from cfem.motion.mpc_spec import MpcSpec
from cfem.predict.contact.obstacle_spec import ContactSpec, ObstacleSpec
from cfem.predict.estimation.spec import DrivenDynamicsSpec, MarkersSpec
from cfem.predict.loads.spec import LoadSpec

Format = Literal["arrays", "onnx", "torchscript", "c", "html", "fmu", "arduino", "mjcf"]
FmuPart = Literal["controller", "robot", "moving", "estimator"]
PACKAGES: dict[Format, tuple[str, ...]] = {
    "arrays": (),
    "onnx": ("torch", "onnx", "onnxscript", "onnxruntime"),
    "torchscript": ("torch",),
}


def writable() -> tuple[Format, ...]:
    """The usual formats whose packages are installed."""
    return tuple(name for name, packages in PACKAGES.items() if all(map(installed, packages)))


class FirmwareControllerSpec(Spec):
    """The controller around the model, on one robot. Displacements are mm of cables and mm^3 of chambers; forces are N
    and MPa."""

    command: Literal["displacement", "force"] = "displacement"
    """What the drives take."""
    observer: Literal["measured", "previous_step", "equilibrium"] = "previous_step"
    """Where the actuators stand: measured by a sensor; previous_step, the last linearisation, as in the paper;
    equilibrium, the model under the last command, by Newton's method."""
    iterations: Annotated[int, Field(ge=1, le=50)] = 1
    """Model queries and programs per tick."""
    halvings: Annotated[int, Field(ge=0, le=20)] = 8
    """Lengths of step tried, each half the last, until the model says that a step leads nearer to the goal. 0 takes the
    full step, as the paper does."""
    tolerance: Displacement | None = None
    """A smaller move of every actuator is not made. 5e-7 of each actuator's stroke unless given."""
    step: Displacement | None = None
    """Farthest that an actuator moves in one linearisation. A quarter of each actuator's stroke unless given."""
    rate: Displacement | None = None
    """Largest change of a displacement command per tick. No limit unless given."""
    force_rate: Effort | None = None
    """Largest change of a force command per tick. No limit unless given."""
    unilateral: bool = True
    """Whether actuators pull and do not push."""
    largest_force: Effort | None = None
    """Largest force of any actuator."""
    regularisation: float = Field(1e-10, gt=0)
    """Cost of a full stroke relative to missing the goal by the robot's length."""
    damping: float = Field(0.0, ge=0)
    """Cost of a full stroke in one tick. It keeps redundant actuators from wandering."""
    weights: list[Annotated[float, Field(ge=0)]] | None = None
    """Weight of each effector row."""
    K_P: float = Field(0.0, ge=0)
    """Proportional gain on the measured error, per sample."""
    K_I: float | None = Field(None, ge=0)
    """Integral gain on the measured error, per sample. By the phase margin unless given."""
    phase_margin: Angle = float(np.pi / 3)
    """Phase margin that the integral gain leaves at the delay and interval that the samples have."""
    late: Annotated[int, Field(ge=1, le=1000)] = 32
    """Ticks after which a sample is too late to be heard."""
    integral_limit: Annotated[Length, Field(gt=0)] | None = None
    """Largest length of the integral part. No limit unless given."""
    start: Displacements | None = None
    """Displacements of the actuators at the start; 0 unless given."""

    def check(self) -> None:
        if self.K_I is None and (self.K_P or not 0 < self.phase_margin < np.pi / 2):
            raise ValueError("phase_margin must be between 0 and 90 deg and needs K_P: 0; or give K_I")


class FirmwareMpcSpec(MpcSpec):
    """Predictive control of a robot that moves, beside the controller whose commands, limits and weights it shares."""

    ticks: Frequency = Field(gt=0)
    """Ticks a second."""
    sensor: bool = True
    """Whether samples of the effectors are heard. Without them it is a feed-forward along what lies ahead."""
    late: Annotated[int, Field(ge=1, le=50)] = 4
    """Ticks after which a sample is too late to be heard."""


class CEstimateSpec(MarkersSpec):
    """The estimator in C, of given markers."""

    markers: dict[Name, Point] = Field(min_length=1, max_length=32)
    """Place of each marker on the surface at rest, in the scene's frame."""
    rate: Frequency = Field(100.0, gt=0)
    """Frames per second."""
    dynamics: DrivenDynamicsSpec | None = None
    """A filter of a robot that moves from frame to frame, beside that of a robot at rest. Needs a model that has
    learned to move. None unless given."""


class CSpec(Spec):
    """C99 for firmware."""

    scalar: Literal["double", "float"] = "double"
    """Number type of the model. The program is solved in the number type of `arithmetic`."""
    arithmetic: Literal["double", "float"] = "double"
    """Number type of all that is computed. float: for processors without double precision, such as a Cortex-M4F; the
    model is then in float too. Of controller, motion and predictive control."""
    hidden_weights: Literal["scalar", "int16"] = "scalar"
    """Number type of a network's hidden layers: as scalar, or 16-bit integers."""
    full: bool = False
    """Whether to write the energy and W_ee too, which control does not use."""
    parameters: dict[str, Value] = {}
    """Values of the model's parameters. The scene's own unless given."""
    vectors: PositiveInt = 100
    """Number of vectors of the self-test."""
    controller: FirmwareControllerSpec = FirmwareControllerSpec()
    """The controller around the model."""
    estimate: CEstimateSpec | None = None
    """An estimator beside it. None unless given."""
    mpc: FirmwareMpcSpec | None = None
    """Predictive control, of a model that has learned to move. None unless given."""
    obstacles: dict[Name, ObstacleSpec] = {}
    """What the robot may touch, in its own frame: rigid bodies, itself, and other robots of the same model, whose
    `shares` say where they go when C is compared with Python. Needs `scene`."""
    contact: ContactSpec = ContactSpec()
    """How the robot's surface touches obstacles."""
    wire: bool = False
    """The firmware's side of the wire is written too, over which `cfem control` and the board exchange frames, with
    an example."""

    def check(self) -> None:
        for name, obstacle in self.obstacles.items():
            if obstacle.pressed or obstacle.avoid is not None or obstacle.path is not None:
                raise ValueError(f"obstacles.{name}: press, largest_force, avoid and path are of `cfem control` alone")
        if self.arithmetic == "float" and (self.obstacles or self.estimate):
            raise ValueError("arithmetic: float is of controller, motion and mpc; obstacles and estimate need double")
        if self.contact.resolution == "mesh":
            raise ValueError("contact.resolution: mesh is of `cfem control` alone; C touches by patches")


class FmuSpec(Spec):
    """Units of co-simulation by FMI 3.0, of the C99 that `c` describes."""

    parts: tuple[FmuPart, ...] | None = Field(None, min_length=1)
    """The controller; the robot, at rest at each instant; the robot that moves, of a model that has learned to; the
    estimator of `c.estimate`. All that there can be unless given."""
    ticks: Frequency = Field(100.0, gt=0)
    """Ticks a second of the controller."""
    step: Annotated[Time, Field(gt=0)] | None = None
    """Longest step of the robot that moves. A fortieth of the period of its first vibration unless given."""


class ExportSpec(Spec):
    """Which trained model to write, in which formats."""

    model: Path
    """Folder of `cfem train`."""
    scene: Path | None = None
    """For formats c and html: the scene whose stated pressures bound the multipliers, and whose surface touches. For
    loads on patches: the scene of which these are solved, to the second order of the force."""
    skin: Path | None = None
    """For format html: folder of a model of the same robot whose skin is drawn. The model's own unless given."""
    out: Path
    """Folder for the files."""
    formats: tuple[Format, ...] = tuple(PACKAGES)
    """Formats to write. Unless given, those of the default whose packages are installed."""
    loads: dict[Name, LoadSpec] = {}
    """Constant loads that the samples did not carry, by the name of the effector, or any name with `at` on a patch of
    the surface: a payload or a push. Every format then holds the loaded robot."""
    shape: bool = False
    """Whether to write the whole surface in every format too: shape.onnx, shape.ts, cfem_shape in C."""
    c: CSpec = CSpec()
    """Settings of format c, of fmu and of arduino; of its controller and parameters, for format html too."""
    fmu: FmuSpec = FmuSpec()
    """Settings of format fmu."""

    def check(self) -> None:
        """Checks which formats and settings go together."""
        if self.c.obstacles and (self.scene is None or self.loads):
            raise ValueError("c.obstacles need `scene`, of which the surface is solved, and do not go with loads yet")
        if self.c.obstacles and "fmu" in self.formats:
            raise ValueError("c.obstacles do not go into an FMU yet: leave out the format fmu, or the obstacles")
        if self.c.arithmetic == "float" and "fmu" in self.formats:
            raise ValueError("c.arithmetic: float is not for an FMU: leave out the format fmu, or take double")
        for name, obstacle in self.c.obstacles.items():
            if obstacle.kind == "robot" and (obstacle.model != self.model or obstacle.scene is not None):
                what = f"in C another robot is one of the exported model: take model: {self.model}, without scene"
                raise ValueError(f"c.obstacles.{name}: {what}")
