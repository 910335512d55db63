"""From messages to a controller of cfem and back, without rclpy: units, frames, age. Messages are in SI units."""

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import cfem
from cfem.condensed.far import doubt, far_of
from cfem.plant.device.answer import FAR
from cfem.plant.device.sample_clock import SampleClock
from cfem.plant.protocol import Measurement
from cfem_ros.topic_plant import TopicPlant

SI = {"mm": 1e-3, "mm^3": 1e-9, "N": 1.0, "MPa": 1e6}  # of one unit of cfem


class Refused(Exception):
    """A message that is not used; says why."""


@dataclass(frozen=True)
class Types:
    """Classes of the messages: of the installed packages, or of what stands for them in tests."""

    Time: Any
    Header: Any
    Point: Any
    PointStamped: Any
    JointState: Any
    MultiArrayDimension: Any
    MultiArrayLayout: Any
    Float64MultiArray: Any
    KeyValue: Any
    DiagnosticStatus: Any
    DiagnosticArray: Any


@dataclass(frozen=True)
class Settings:
    """command: displacement or force; goal_timeout: s after which a goal is stale, 0 for goals that hold until the
    next; measured_timeout: s after which a sample no longer counts; clock_tolerance: s by which a stamp may lie in the
    future; effector_clock: of the stamps of the effector, `own` or `other`; latency: s that a sample without a stamp of
    our clock takes to arrive at least; phase_margin: deg that the feedback leaves, 0 for none."""

    command: str = "displacement"
    goal_timeout: float = 0.5
    measured_timeout: float = 0.5
    clock_tolerance: float = 0.1
    effector_clock: str = "own"
    latency: float = 0.0
    phase_margin: float = 60.0

    def demand_range(self) -> None:
        """ValueError, by the name of the parameter."""
        for name, words in {"command": ("displacement", "force"), "effector_clock": ("own", "other")}.items():
            if getattr(self, name) not in words:
                raise ValueError(f"{name} is {getattr(self, name)!r}, expected {' or '.join(words)}")
        for name in ("goal_timeout", "measured_timeout", "clock_tolerance", "latency", "phase_margin"):
            most = 90.0 if name == "phase_margin" else math.inf
            if not 0 <= getattr(self, name) < most:
                raise ValueError(f"{name} is {getattr(self, name)}, expected a number from 0 on, below {most:g}")


DEFAULTS = Settings()


@dataclass(frozen=True)
class Told:
    """Messages of one tick. effector: None where it was not measured."""

    command: Any
    array: Any
    effector: Any | None
    diagnostics: Any


class Bridge:
    """model: with one effector of rows x, y and z; plant: a `DevicePlant`, or None for a robot on topics; frame: of the
    scene. ValueError where the model is none that this node can control."""

    def __init__(
        self, model: Any, types: Types, plant: Any | None = None, settings: Settings = DEFAULTS, frame: str = "robot"
    ):
        if model.rows.n_e != 3:
            rows = ", ".join(model.rows.effectors)
            raise ValueError(f"the node takes goals of one point with x, y and z; the model has the rows {rows}")
        self.model, self.types, self.frame, self._settings = model, types, frame, settings
        tolerance, other = settings.clock_tolerance, settings.effector_clock == "other"
        self._goal_clock, self._effector_clock = SampleClock(tolerance), SampleClock(tolerance, settings.latency, other)
        self.plant, self._command = TopicPlant() if plant is None else plant, settings.command
        margin = settings.phase_margin
        feedback = {"phase_margin": margin} if margin else {"gains": (0.0, 0.0)}
        self._controller = cfem.make_controller(model, command=self._command, **feedback)
        self._units = [pair[0 if self._command == "displacement" else 1] for pair in model.actuator_units]
        self._scale = np.array([SI[unit] for unit in self._units])
        self._goal: np.ndarray | None = None
        self._stamp = self._now = self._sampled = -math.inf  # s: of the goal, of the last tick, of the last sample
        self._measured: Measurement | None = None
        self._said: tuple[int, str] | None = None  # of a message that was refused, until the next tick
        self._u = np.zeros(model.rows.n_a)
        self._ticks, self._steps = 0, 0  # of the controller, of the plant, which is told something in every tick
        self._counts: deque[int] = deque(maxlen=1000)  # ticks of the controller at the last steps of the plant

    def on_goal(self, message: Any, now: float) -> None:
        """A PointStamped; now: s. Refused where it cannot be meant for this robot."""
        place, timeout = self._point(message, "goal"), self._settings.goal_timeout
        stamp = self._taken(self._goal_clock, message, now, "goal")
        if timeout and now - stamp > timeout:
            raise self._refuse(f"goal is stale: its stamp is {now - stamp:.2f} s old, at most {timeout:g} s")
        strange = doubt(place, self.model.rest_e, far_of(self.model.rows, self.model.length))
        if strange:
            raise self._refuse(f"goal {strange}, messages in metres")
        self._goal, self._stamp = place, stamp

    def on_effector(self, message: Any, now: float) -> None:
        """A PointStamped of a robot on topics."""
        what = "measured effector"
        place = self._point(message, what)
        self.plant.take(place, self._taken(self._effector_clock, message, now, what))

    def tick(self, now: float) -> Told:
        """One command; it stays as it was without a goal that is young enough. CfemError where the pipe has stopped."""
        status, found, timeout = self.types.DiagnosticStatus, [], self._settings.goal_timeout
        if now < self._now - self._settings.clock_tolerance:
            self._said = (status.ERROR, self._put_back(now))
        self._now = now
        if isinstance(self.plant, TopicPlant):
            self.plant.now = now
        age = now - self._stamp
        if self._goal is None:
            found.append((status.STALE, "waiting for a goal"))
        elif timeout and age > timeout:
            found.append((status.STALE, f"goal is stale: {age:.2f} s old; the last command is held"))
        else:
            self._u = self._controller.tick(self._goal, self._sample()).u
            self._ticks += 1
        self._measured, before = self.plant.step(self._u, self._command), self._measured
        self._counts.append(self._ticks)
        self._steps += 1
        if before is None or self._measured.t > before.t:
            self._sampled = now
        if why := self._unseen():
            found.append((status.WARN, why))
        if self._said:  # the last word: why a message was not used
            found.append(self._said)
            self._said = None
        level, message = found[-1] if found else (status.OK, "tracking")
        return Told(self._joints(now), self._array(), self._effector(now), self.diagnostics(now, level, message))

    def _put_back(self, now: float) -> str:
        """What is said where our own clock went back: goal and samples of before are of no known time."""
        back, self._goal, self._sampled = self._now - now, None, now
        if isinstance(self.plant, TopicPlant):
            self.plant.forget()
        return f"the clock was put back by {back:.2f} s: the goal and the samples before are forgotten"

    def _unseen(self) -> str | None:
        """Why the present position is not known; None where it is."""
        if not np.isfinite(self._measured.x_e).all():
            return self._measured.status
        age = self.plant.age() if isinstance(self.plant, TopicPlant) else self._now - self._sampled
        if age > self._settings.measured_timeout:
            return f"the effector is not measured: the last sample is {age:.2f} s old"
        return None

    def _sample(self) -> Measurement | None:
        """The last measurement, numbered by the controller's own ticks."""
        if self._measured is None or self._unseen():
            return None
        back = self._steps - self._measured.t
        known = self._measured.t > 0 and back < len(self._counts)
        return replace(self._measured, t=self._counts[-1 - back] if known else 0)

    def diagnostics(self, now: float, level: Any, message: str) -> Any:
        types, seen = self.types, self._measured
        values = {"robot": self.model.meta["scene"], "frame": self.frame, "command": self._command}
        if seen is not None and not self._unseen():
            feedback = self._controller.feedback
            values |= {"samples_late": str(feedback.late), "integral": f"{feedback.integral:.4f}"}
            if self._goal is not None:
                values["error_mm"] = f"{np.linalg.norm(seen.x_e - self._goal):.4f}"
        if hasattr(self.plant, "late"):
            values["late_ticks"] = str(self.plant.late)
        values = [types.KeyValue(key=key, value=value) for key, value in values.items()]
        status = types.DiagnosticStatus(
            level=level, name="cfem: controller", message=message, hardware_id=self.model.meta["scene"], values=values
        )
        return types.DiagnosticArray(header=self._header(now), status=[status])

    def _point(self, message: Any, what: str) -> np.ndarray:
        """(3,) mm in the frame of the scene."""
        if message.header.frame_id != self.frame:
            where = f"{what} is in frame '{message.header.frame_id}', expected '{self.frame}'"
            raise self._refuse(f"{where}: transform it with tf2, or set the parameter `frame`")
        metres = (message.point.x, message.point.y, message.point.z)
        place = np.array([one / SI["mm"] for one in metres])  # inf, without a warning, where it is beyond all numbers
        if not np.isfinite(place).all():
            raise self._refuse(f"{what} is not finite")
        away, length = math.hypot(*(place - self.model.rest_e)), self.model.length
        if away > FAR * length:
            raise self._refuse(
                f"{what} is {away / 1e3:.3g} m from where the effector rests, and the robot {length / 1e3:.3g} m long: "
                "messages are in metres, are these millimetres?"
            )
        return place

    def _taken(self, clock: SampleClock, message: Any, now: float, what: str) -> float:
        """s of our clock."""
        try:
            return clock.taken(_seconds(message.header.stamp), now)
        except cfem.InputError as error:
            raise self._refuse(f"{what}: {error}") from error

    def _refuse(self, why: str) -> Refused:
        self._said = (self.types.DiagnosticStatus.ERROR, why)
        return Refused(why)

    def _header(self, now: float) -> Any:
        whole = math.floor(now)
        stamp = self.types.Time(sec=int(whole), nanosec=int((now - whole) * 1e9))
        return self.types.Header(stamp=stamp, frame_id=self.frame)

    def _joints(self, now: float) -> Any:
        numbers = (self._u * self._scale).tolist()
        place, effort = (numbers, []) if self._command == "displacement" else ([], numbers)
        names = list(self.model.rows.actuators)
        return self.types.JointState(header=self._header(now), name=names, position=place, velocity=[], effort=effort)

    def _array(self) -> Any:
        n = len(self._u)
        size = self.types.MultiArrayDimension(label="actuators", size=n, stride=n)
        layout = self.types.MultiArrayLayout(dim=[size], data_offset=0)
        return self.types.Float64MultiArray(layout=layout, data=(self._u * self._scale).tolist())

    def _effector(self, now: float) -> Any | None:
        if isinstance(self.plant, TopicPlant) or self._unseen():
            return None
        x, y, z = (float(one) for one in self._measured.x_e * SI["mm"])
        return self.types.PointStamped(header=self._header(now), point=self.types.Point(x=x, y=y, z=z))


def _seconds(stamp: Any) -> float | None:
    """None for a stamp of 0, which is none."""
    return stamp.sec + 1e-9 * stamp.nanosec or None
