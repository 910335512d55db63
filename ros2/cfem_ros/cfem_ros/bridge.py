"""From messages to a controller of cfem and back, without rclpy: units, frames, age. Messages are in SI units."""

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import cfem
from cfem.condensed.far import doubt, far_of
from cfem.plant.protocol import Measurement

SI = {"mm": 1e-3, "mm^3": 1e-9, "N": 1.0, "MPa": 1e6}  # of one unit of cfem
FAR = 10.0  # times the robot's length: a goal so far away is of another unit


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
class Told:
    """Messages of one tick. effector: None where it was not measured."""

    command: Any
    array: Any
    effector: Any | None
    diagnostics: Any


class TopicPlant:
    """A robot that is on topics: what it was told is published by the node, what was measured last is its answer.
    Measurements older than `timeout` s count as not seen."""

    def __init__(self, timeout: float):
        self.timeout, self.x_e, self.seen, self.now, self._t = timeout, None, -math.inf, 0.0, 0

    def step(self, u: np.ndarray, kind: str) -> Measurement:
        self._t += 1
        if self.x_e is None or self.now - self.seen > self.timeout:
            return Measurement(np.full(3, np.nan), None, None, self._t, "the effector is not measured")
        return Measurement(self.x_e, None, None, self._t, "converged")


class Bridge:
    """model: with one effector of rows x, y and z. plant: a `PipePlant`, or None for a robot on topics; command:
    displacement or force; frame: of the scene; goal_timeout: s after which a goal is stale, 0 for goals that hold until
    the next; integral: gain. ValueError where the model is none that this node can control."""

    def __init__(
        self,
        model: Any,
        types: Types,
        plant: Any | None = None,
        command: str = "displacement",
        frame: str = "robot",
        goal_timeout: float = 0.5,
        measured_timeout: float = 0.5,
        integral: float = 0.3,
    ):
        if model.rows.n_e != 3:
            rows = ", ".join(model.rows.effectors)
            raise ValueError(f"the node takes goals of one point with x, y and z; the model has the rows {rows}")
        self.model, self.types, self.frame = model, types, frame
        self.plant = TopicPlant(measured_timeout) if plant is None else plant
        self._command, self._goal_timeout = command, goal_timeout
        self._controller = cfem.make_controller(model, command=command, gains=(0.0, integral))
        self._units = [pair[0 if command == "displacement" else 1] for pair in model.actuator_units]
        self._scale = np.array([SI[unit] for unit in self._units])
        self._goal: np.ndarray | None = None
        self._stamp = -math.inf
        self._measured: Measurement | None = None
        self._said: tuple[int, str] | None = None  # of a message that was refused, until the next tick
        self._u = np.zeros(model.rows.n_a)
        self._ticks, self._steps = 0, 0  # of the controller, of the plant, which is told something in every tick
        self._counts: deque[int] = deque(maxlen=1000)  # ticks of the controller at the last steps of the plant

    def on_goal(self, message: Any, now: float) -> None:
        """A PointStamped; now: s. Refused where it cannot be meant for this robot."""
        place = self._point(message, "goal")
        stamp = _seconds(message.header.stamp) or now
        if self._goal_timeout and now - stamp > self._goal_timeout:
            raise self._refuse(f"goal is stale: its stamp is {now - stamp:.2f} s old, at most {self._goal_timeout:g} s")
        strange = doubt(place, self.model.rest_e, far_of(self.model.rows, self.model.length))
        if strange:
            raise self._refuse(f"goal {strange}, messages in metres")
        self._goal, self._stamp = place, stamp

    def on_effector(self, message: Any, now: float) -> None:
        """A PointStamped of a robot on topics."""
        self.plant.x_e = self._point(message, "measured effector")
        self.plant.seen = _seconds(message.header.stamp) or now

    def tick(self, now: float) -> Told:
        """One command; it stays as it was without a goal that is young enough. CfemError where the pipe has stopped."""
        status, found = self.types.DiagnosticStatus, []
        if isinstance(self.plant, TopicPlant):
            self.plant.now = now
        age = now - self._stamp
        if self._goal is None:
            found.append((status.STALE, "waiting for a goal"))
        elif self._goal_timeout and age > self._goal_timeout:
            found.append((status.STALE, f"goal is stale: {age:.2f} s old; the last command is held"))
        else:
            self._u = self._controller.tick(self._goal, self._sample()).u
            self._ticks += 1
        self._measured = self.plant.step(self._u, self._command)
        self._counts.append(self._ticks)
        self._steps += 1
        if not np.isfinite(self._measured.x_e).all():
            found.append((status.WARN, self._measured.status))
        if self._said:  # the last word: why a message was not used
            found.append(self._said)
            self._said = None
        level, message = found[-1] if found else (status.OK, "tracking")
        return Told(self._joints(now), self._array(), self._effector(now), self.diagnostics(now, level, message))

    def _sample(self) -> Measurement | None:
        """The last measurement, numbered by the controller's own ticks."""
        if self._measured is None:
            return None
        back = self._steps - self._measured.t
        known = self._measured.t > 0 and back < len(self._counts)
        return replace(self._measured, t=self._counts[-1 - back] if known else 0)

    def diagnostics(self, now: float, level: Any, message: str) -> Any:
        types, seen = self.types, self._measured
        values = {"robot": self.model.meta["scene"], "frame": self.frame, "command": self._command}
        if seen is not None and self._goal is not None and np.isfinite(seen.x_e).all():
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
        place = np.array([message.point.x, message.point.y, message.point.z])
        if not np.isfinite(place).all():
            raise self._refuse(f"{what} is not finite")
        place = place / SI["mm"]
        away, length = np.linalg.norm(place - self.model.rest_e), self.model.length
        if away > FAR * length:
            raise self._refuse(
                f"{what} is {away / 1e3:.3g} m from where the effector rests, and the robot {length / 1e3:.3g} m long: "
                "messages are in metres, are these millimetres?"
            )
        return place

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
        if isinstance(self.plant, TopicPlant) or not np.isfinite(self._measured.x_e).all():
            return None
        x, y, z = (float(one) for one in self._measured.x_e * SI["mm"])
        return self.types.PointStamped(header=self._header(now), point=self.types.Point(x=x, y=y, z=z))


def _seconds(stamp: Any) -> float:
    return stamp.sec + 1e-9 * stamp.nanosec
