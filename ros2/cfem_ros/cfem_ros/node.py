"""The node `controller`: parameters, topics and a timer around `Bridge`."""

import math
import sys
from contextlib import ExitStack, suppress
from dataclasses import asdict
from pathlib import Path

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, PointStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension, MultiArrayLayout

import cfem
from cfem.plant.device.device_plant import DevicePlant
from cfem.plant.device.lines import Lines
from cfem_ros.bridge import DEFAULTS, Bridge, Refused, Settings, Types

TYPES = Types(
    Time, Header, Point, PointStamped, JointState, MultiArrayDimension, MultiArrayLayout, Float64MultiArray, KeyValue,
    DiagnosticStatus, DiagnosticArray,
)  # fmt: skip


class Controller(Node):
    """failed: the sentence of what stopped it, None while it runs."""

    def __init__(self, stack: ExitStack):
        super().__init__("cfem")
        given = {"model": "", "device": [""], "frame": "robot", "rate": 20.0, "answer_within": 1.0} | asdict(DEFAULTS)
        for name, value in given.items():
            given[name] = self.declare_parameter(name, value).value
        settings = Settings(**{name: given[name] for name in asdict(DEFAULTS)})
        settings.demand_range()
        for name in ("rate", "answer_within"):
            if not 0 < given[name] < math.inf:
                raise ValueError(f"{name} is {given[name]}, expected a number above 0")
        model = cfem.load_model(Path(given["model"]))
        device, plant = [word for word in given["device"] if word], None
        if device:
            known = {"length": model.length, "reach": model.reach}
            pipe = DevicePlant(Lines(device), model.rows, model.rest_e, given["answer_within"], **known)
            plant = stack.enter_context(pipe)
        self.bridge, self.failed = Bridge(model, TYPES, plant, settings, given["frame"]), None
        topics = {"command": JointState, "commands": Float64MultiArray, "diagnostics": DiagnosticArray}
        self._say = {name: self.create_publisher(kind, name, 10) for name, kind in topics.items()}
        self.create_subscription(PointStamped, "goal", lambda one: self._take(self.bridge.on_goal, one), 10)
        if device:
            self._say["effector"] = self.create_publisher(PointStamped, "effector", 10)
        else:
            self.create_subscription(PointStamped, "effector", lambda one: self._take(self.bridge.on_effector, one), 10)
        self.create_timer(1.0 / given["rate"], self.tick)

    def tick(self) -> None:
        try:
            told = self.bridge.tick(self._now())
        except cfem.CfemError as error:
            self.failed = str(error)
            self.get_logger().fatal(self.failed)
            self._say["diagnostics"].publish(self.bridge.diagnostics(self._now(), DiagnosticStatus.ERROR, self.failed))
            raise SystemExit(3) from error
        self._say["command"].publish(told.command)
        self._say["commands"].publish(told.array)
        self._say["diagnostics"].publish(told.diagnostics)
        if told.effector is not None:
            self._say["effector"].publish(told.effector)

    def _take(self, use, message) -> None:
        try:
            use(message, self._now())
        except Refused as why:
            self.get_logger().error(str(why))

    def _now(self) -> float:
        return self.get_clock().now().nanoseconds * 1e-9


def main() -> None:
    """Whatever ends it, the device is told goodbye."""
    rclpy.init(args=sys.argv)
    with suppress(KeyboardInterrupt, ExternalShutdownException), ExitStack() as stack:
        try:
            node = Controller(stack)
        except (cfem.CfemError, ValueError) as error:
            sys.exit(f"cfem: {error}")
        rclpy.spin(node)
