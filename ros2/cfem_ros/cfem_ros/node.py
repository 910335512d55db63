"""The node `controller`: parameters, topics and a timer around `Bridge`."""

import sys
from contextlib import ExitStack, suppress
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
from cfem.plant.pipe_plant import PipePlant
from cfem_ros.bridge import Bridge, Refused, Types

TYPES = Types(
    Time, Header, Point, PointStamped, JointState, MultiArrayDimension, MultiArrayLayout, Float64MultiArray, KeyValue,
    DiagnosticStatus, DiagnosticArray,
)  # fmt: skip


class Controller(Node):
    """failed: the sentence of what stopped it, None while it runs."""

    def __init__(self, stack: ExitStack):
        super().__init__("cfem")
        given = {
            "model": "", "device": [""], "command": "displacement", "frame": "robot", "rate": 20.0,
            "goal_timeout": 0.5, "measured_timeout": 0.5, "integral": 0.3, "answer_within": 1.0,
        }  # fmt: skip
        for name, value in given.items():
            given[name] = self.declare_parameter(name, value).value
        model = cfem.load_model(Path(given["model"]))
        device, plant = [word for word in given["device"] if word], None
        if device:
            plant = stack.enter_context(PipePlant(device, model.rows, model.rest_e, given["answer_within"]))
        wanted = ("command", "frame", "goal_timeout", "measured_timeout", "integral")
        self.bridge, self.failed = Bridge(model, TYPES, plant, **{name: given[name] for name in wanted}), None
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
    rclpy.init(args=sys.argv)
    with ExitStack() as stack:
        try:
            node = Controller(stack)
        except (cfem.CfemError, ValueError) as error:
            sys.exit(f"cfem: {error}")
        with suppress(KeyboardInterrupt, ExternalShutdownException):
            rclpy.spin(node)
