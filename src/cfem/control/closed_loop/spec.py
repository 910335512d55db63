"""Spec of `loop:` in control.yaml: control over time, open or closed, into an imperfect plant."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeInt, PositiveInt

from cfem.control.adaptation.spec import AdaptSpec
from cfem.control.closed_loop.estimated_spec import LoopEstimateSpec
from cfem.control.motion.spec import LapsSpec, MovingSpec, ShapingSpec
from cfem.core.actuator_units import Displacement, Effort
from cfem.core.names import Name
from cfem.core.spec import Spec
from cfem.core.units import Angle, ForceVector, Frequency, Length, Point, Time
from cfem.motion.mpc_spec import MpcSpec
from cfem.plant.device.spec import DeviceSpec
from cfem.robot.selection import Direction

PositiveDisplacement = Annotated[Displacement, Field(gt=0)]
PositiveEffort = Annotated[Effort, Field(gt=0)]


class DisplacementCommandSpec(Spec):
    """Cables are told their shortening, chambers their growth."""

    kind: Literal["displacement"]
    """Commands are displacements."""
    step: PositiveDisplacement | None = None
    """Largest change per tick."""
    quantum: PositiveDisplacement | None = None
    """What the plant rounds commands to."""


class ForceCommandSpec(Spec):
    """Cables are told their tension, chambers their pressure."""

    kind: Literal["force"]
    """Commands are forces."""
    step: PositiveEffort | None = None
    """Largest change per tick."""
    largest: PositiveEffort | None = None
    """Largest command."""
    quantum: PositiveEffort | None = None
    """What the plant rounds commands to."""


class GainsSpec(Spec):
    """Gains of the PI controller on the effector error, per sample. Give `integral` (with `proportional`) or
    `phase_margin`."""

    proportional: float = Field(0.0, ge=0)
    """Proportional gain."""
    integral: float | None = Field(None, ge=0)
    """Integral gain."""
    phase_margin: Angle | None = None
    """Phase margin that the integral gain leaves at the delay and interval that the samples have."""
    bound: Annotated[Length, Field(gt=0)] | None = None
    """Largest length of the integral part."""

    def check(self) -> None:
        if (self.integral is None) == (self.phase_margin is None):
            raise ValueError("give either integral or phase_margin")
        if self.phase_margin is not None and (self.proportional or not 0 < self.phase_margin < np.pi / 2):
            raise ValueError("phase_margin must be between 0 and 90 deg, and needs proportional: 0")


class ControllerSpec(Spec):
    """A controller of the loop."""

    mode: Literal["open", "closed", "policy"]
    """open: no feedback. closed: with gains on the measured error. policy: a trained policy."""
    model: str | None = None
    """One of `models`, or fe-based for FE matrices. The first unless given."""
    observer: Literal["measured", "previous_step", "equilibrium"] = "equilibrium"
    """Where the actuators stand, if no sensor measures it: previous_step, the last linearisation, as in the paper;
    equilibrium, the model under the last command."""
    iterations: PositiveInt = 1
    """Inverse steps per tick. The paper has 1."""
    gains: GainsSpec | None = None
    """Gains of mode closed. A phase margin of 60 deg unless given."""
    shaping: ShapingSpec | None = None
    """Input shaping on top."""
    feedforward: bool = False
    """Whether inertia and viscosity are computed along the goals ahead. Mode open."""
    mpc: MpcSpec | None = None
    """Model predictive control instead, with an observer of its own in mode closed."""
    policy: Path | None = None
    """File of the policy, .onnx, for mode: policy."""
    adapt: AdaptSpec | None = None
    """Parameters that are tracked meanwhile, of a model that has some."""

    @property
    def moves(self) -> bool:
        """True where the controller asks a model that has learned to move."""
        return self.feedforward or self.shaping is not None or self.mpc is not None

    def check(self) -> None:
        """Checks that the fields go together."""
        if self.mode != "closed" and self.gains is not None:
            raise ValueError(f"gains: mode: {self.mode} takes none")
        if (self.mode == "policy") != (self.policy is not None):
            raise ValueError("mode: policy needs policy, a file, and the other modes take none")
        if self.mode == "policy" and (self.adapt is not None or self.moves or self.model == "fe-based"):
            raise ValueError("mode: policy takes neither adapt, shaping, feedforward, mpc nor model: fe-based")
        if self.adapt is not None and (self.moves or self.model == "fe-based" or self.observer != "equilibrium"):
            raise ValueError("adapt needs a learned model, observer: equilibrium, and no shaping, feedforward or mpc")
        chosen = [self.shaping is not None, self.feedforward, self.mpc is not None]
        if sum(chosen) > 1:
            raise ValueError("give one of shaping, feedforward and mpc")
        if self.feedforward and self.mode == "closed":
            raise ValueError("feedforward is of mode: open; mpc of mode: closed listens to sensors")
        if self.mpc is not None and (self.gains is not None or self.observer == "measured"):
            raise ValueError("mpc takes neither gains nor observer: its own observer is mpc.doubt")
        if self.moves and self.model == "fe-based":
            raise ValueError("a controller that knows how the robot moves needs a learned model")


class SettleSpec(Spec):
    """When a goal counts as reached: the effectors stay within `radius` of it for `hold`."""

    radius: Length = Field(gt=0)
    """Largest distance from the goal."""
    hold: Time = Field(ge=0)
    """Time within that distance."""
    at_most: Time = Field(10.0, gt=0)
    """Time after which the goal is given up, where goals wait for each other."""


class SensorSpec(Spec):
    """Sensor of the effectors."""

    noise: Length = Field(0.0, ge=0)
    """Standard deviation of each measured coordinate."""
    rate: Annotated[Frequency, Field(gt=0)] | None = None
    """Samples per second. The loop's rate unless given."""
    delay: NonNegativeInt = 0
    """Ticks from sample to controller."""


class WallSpec(Spec):
    """A plane without friction that the first effector cannot pass."""

    point: Point
    """A point of the plane."""
    normal: Direction
    """Direction, x, y and z, of the side where the effector may be."""


class DriftSpec(Spec):
    """How the material of the real robot changes."""

    stiffness: float = Field(gt=0)
    """Stiffness at the end, relative to that at first."""
    within: Annotated[Time, Field(gt=0)]
    """Time of the change."""


class RealSpec(Spec):
    """How the real robot differs from the model."""

    scene: list[str] = Field(default=[])
    """Overrides `key=value` of the scene (plant: fem)."""
    mesh: Path | None = None
    """Another mesh (plant: fem)."""
    wall: WallSpec | None = None
    """A wall in its way (plant: fem)."""
    stiffer: float = Field(1.0, gt=0)
    """Stiffness relative to the model's (plant: model)."""
    viscosity: float = Field(1.0, ge=0)
    """Viscosity relative to the model's, beyond what stiffness makes of it (plant: model that moves)."""
    drift: DriftSpec | None = None
    """A stiffness that changes while the robot works, of one material without loads (plant: fem, model)."""


class DisturbanceSpec(Spec):
    """A constant force on the first effector from one tick on."""

    tick: PositiveInt
    """First tick with the force."""
    force: ForceVector
    """The force along x, y and z."""


class LoopSpec(Spec):
    """Control over time, open or closed."""

    rate: Frequency = Field(gt=0)
    """Control ticks per second."""
    command: Annotated[DisplacementCommandSpec | ForceCommandSpec, Field(discriminator="kind")]
    """What the plant is told."""
    controllers: dict[Name, ControllerSpec] = Field(min_length=1)
    """Ways to control, by name."""
    moving: MovingSpec | None = None
    """The plant moves between ticks. Without it, it is at rest at each."""
    live: bool = False
    """Whether a model whose folder is replaced meanwhile, by `cfem train`, is taken up. The one before answers until
    then."""
    laps: LapsSpec | None = None
    """Goals run round the trajectories, at each tick a new one."""
    settle: SettleSpec
    """When a goal counts as reached."""
    goal_every: Annotated[Time, Field(gt=0)] | None = None
    """Time from one goal to the next. Without it, each goal waits until the last is reached."""
    approach: Time = Field(1.0, ge=0)
    """Time for the first goal, where goal_every is given."""
    budget: Annotated[Time, Field(gt=0)] | None = None
    """Time for all goals."""
    seeds: list[NonNegativeInt] = Field(default=[0], min_length=1)
    """Seeds of the noise. Everything runs once per seed."""
    sensor: SensorSpec = SensorSpec()
    """What measures the effectors."""
    estimate: LoopEstimateSpec | None = None
    """Markers on the surface instead: controllers then know of the robot what is estimated from them."""
    real: RealSpec = RealSpec()
    """How the real robot differs from the model."""
    disturbance: DisturbanceSpec | None = None
    """A force that appears during the run."""
    device: DeviceSpec | None = None
    """The device, for plant: device."""
    answer_within: Time = Field(1.0, gt=0)
    """Time in which the device must answer."""

    def check(self) -> None:
        """Checks that the fields go together."""
        if self.laps is not None and self.goal_every is not None:
            raise ValueError("laps have a goal at each tick: leave out goal_every")
        if self.laps is None and self.goal_every is None and self.settle.hold > self.settle.at_most:
            raise ValueError("settle.hold: a goal is given up after settle.at_most, before it was held so long")
        if self.moving is not None and self.real.wall is not None:
            raise ValueError("real.wall does not go with moving yet")
        if self.moving is not None and self.real.drift is not None:
            raise ValueError("real.drift does not go with moving yet")
        if self.moving is None and self.real.viscosity != 1:
            raise ValueError("real.viscosity needs moving")
        learning = [
            controller
            for controller in self.controllers.values()
            if controller.adapt or controller.policy or controller.moves
        ]
        if self.live and (learning or self.estimate is not None or self.moving is not None):
            raise ValueError(
                "live goes with modes open and closed of a robot at rest: leave out adapt, policy, shaping, "
                "feedforward, mpc, estimate and moving"
            )
        if self.sensor.rate is not None and self.sensor.rate > self.rate:
            raise ValueError("sensor.rate must not be above the loop's rate")
        if self.estimate is None:
            return
        if self.real.wall is not None:
            raise ValueError("estimate takes the robot to be free: leave out real.wall")
        if self.estimates_motion and any(controller.adapt for controller in self.controllers.values()):
            raise ValueError("adapt takes the robot to be at rest, and its estimate to move: leave one of them out")
        if self.estimates_motion and self.estimate.actuators.force is not None:
            raise ValueError("load cells measure inertia too, which estimate leaves aside: leave actuators.force out")
        if any(controller.adapt and controller.adapt.camera for controller in self.controllers.values()):
            raise ValueError("estimate needs markers in the scene's frame: leave out adapt.camera")
        if self.sensor.noise:
            raise ValueError("estimate has a noise of its own: leave out sensor.noise")

    @property
    def estimates_motion(self) -> bool:
        """True where the estimate is a filter on the dynamics."""
        return self.estimate is not None and (self.moving is not None or self.estimate.dynamics is not None)

    def ticks(self, time: float) -> int:
        """A time (s) in ticks, at least one."""
        return max(1, round(time * self.rate))

    @property
    def ticks_a_sample(self) -> float:
        return 1.0 if self.sensor.rate is None else self.rate / self.sensor.rate
