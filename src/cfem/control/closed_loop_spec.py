"""What the `loop:` part of `control.yaml` says: control over time, open or closed, into an imperfect plant."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeInt, PositiveInt, model_validator

from cfem.core.spec import Spec
from cfem.core.units import Angle, Course, Effort, ForceVector, Frequency, Length, Point, Time
from cfem.robot.selection import Direction

PositiveCourse = Annotated[Course, Field(gt=0)]
PositiveEffort = Annotated[Effort, Field(gt=0)]


class DisplacementCommandSpec(Spec):
    """Cables by their shortening, chambers by their growth. step: largest change in a tick; quantum: what the plant
    rounds commands to."""

    kind: Literal["displacement"]
    step: PositiveCourse | None = None
    quantum: PositiveCourse | None = None


class ForceCommandSpec(Spec):
    """Cables by their tension, chambers by their pressure. step: largest change in a tick; largest: amplitude;
    quantum: what the plant rounds commands to."""

    kind: Literal["force"]
    step: PositiveEffort | None = None
    largest: PositiveEffort | None = None
    quantum: PositiveEffort | None = None


class GainsSpec(Spec):
    """Of the PI on the effector error, per sample, no dt: either `integral` (with `proportional`), or the phase_margin
    that the integral gain is to leave for the loop's delay. bound: longest correction that the integral may become."""

    proportional: float = Field(0.0, ge=0)
    integral: float | None = Field(None, ge=0)
    phase_margin: Angle | None = None
    bound: Length | None = None

    @model_validator(mode="after")
    def _one_of_both(self):
        if (self.integral is None) == (self.phase_margin is None):
            raise ValueError("give either integral or phase_margin")
        if self.phase_margin is not None and (self.proportional or not 0 < self.phase_margin < np.pi / 2):
            raise ValueError("phase_margin must be between 0 and 90 deg, and is for proportional: 0")
        return self


class ControllerSpec(Spec):
    """One way to control. model: one of `models`, the first unless given, or `fe-based`, FE matrices; observer:
    where no sensor says where the actuators stand (`previous_step` is the paper's); iterations: inverse steps a tick, 1
    is the paper's; gains: of mode: closed, a phase margin of 60 deg unless given."""

    mode: Literal["open", "closed"]
    model: str | None = None
    observer: Literal["measured", "previous_step", "equilibrium"] = "equilibrium"
    iterations: PositiveInt = 1
    gains: GainsSpec | None = None

    @model_validator(mode="after")
    def _gains_are_closed(self):
        if self.mode == "open" and self.gains is not None:
            raise ValueError("mode: open has no gains")
        return self


class SettleSpec(Spec):
    """A goal is reached when the effectors stay within `radius` of it for `hold`; at_most: time before it is given up,
    where goals wait for each other."""

    radius: Length
    hold: Time
    at_most: Time = 10.0


class SensorSpec(Spec):
    """noise: standard deviation of each measured coordinate; rate: of samples, the loop's unless given; delay: ticks
    from sample to controller."""

    noise: Length = 0.0
    rate: Frequency | None = None
    delay: NonNegativeInt = 0


class WallSpec(Spec):
    """A plane without friction that the first effector cannot pass. point: on it; normal: to the side where the
    effector may be."""

    point: Point
    normal: Direction


class RealSpec(Spec):
    """What the real robot has that the model does not know. scene: overrides `key=value` of the scene, mesh: another
    one, wall: something in its way (plant: fem); stiffer: times the model's stiffness (plant: model)."""

    scene: list[str] = Field(default=[])
    mesh: Path | None = None
    wall: WallSpec | None = None
    stiffer: float = Field(1.0, gt=0)


class DisturbanceSpec(Spec):
    """A constant force on the first effector from a tick on."""

    tick: PositiveInt
    force: ForceVector


class LoopSpec(Spec):
    """rate: control ticks a second; command: what the plant is told; goal_every: time from one goal to the next, else
    each waits for the last to be reached (`settle`); approach: time for the first goal where goal_every is given;
    budget: time for all goals; seeds: a run of everything with each; device: command line of plant: pipe, and how long
    it may take to answer."""

    rate: Frequency
    command: Annotated[DisplacementCommandSpec | ForceCommandSpec, Field(discriminator="kind")]
    controllers: dict[str, ControllerSpec] = Field(min_length=1)
    settle: SettleSpec
    goal_every: Time | None = None
    approach: Time = 1.0
    budget: Time | None = None
    seeds: list[NonNegativeInt] = Field(default=[0], min_length=1)
    sensor: SensorSpec = SensorSpec()
    real: RealSpec = RealSpec()
    disturbance: DisturbanceSpec | None = None
    device: list[str] | None = Field(None, min_length=1)
    answer_within: Time = 1.0

    @model_validator(mode="after")
    def _sensor_is_no_faster(self):
        if self.sensor.rate is not None and self.sensor.rate > self.rate:
            raise ValueError("sensor.rate must not be above the loop's rate")
        return self

    def ticks(self, time: float) -> int:
        """A time (s) in ticks, at least one."""
        return max(1, round(time * self.rate))

    @property
    def ticks_a_sample(self) -> float:
        return 1.0 if self.sensor.rate is None else self.rate / self.sensor.rate
