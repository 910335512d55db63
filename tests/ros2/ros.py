"""What stands for ROS 2 in the tests: message classes by their fields, and a node that keeps what it is given.

`real()` has the definitions of the standard packages, from the package rosbags where it is installed. `written()` has
the same fields by hand, and takes no others; a test compares both."""

import sys
from dataclasses import fields, make_dataclass
from types import ModuleType, SimpleNamespace

FIELDS = {
    "builtin_interfaces/msg/Time": "sec nanosec",
    "std_msgs/msg/Header": "stamp frame_id",
    "std_msgs/msg/MultiArrayDimension": "label size stride",
    "std_msgs/msg/MultiArrayLayout": "dim data_offset",
    "std_msgs/msg/Float64MultiArray": "layout data",
    "geometry_msgs/msg/Point": "x y z",
    "geometry_msgs/msg/PointStamped": "header point",
    "sensor_msgs/msg/JointState": "header name position velocity effort",
    "diagnostic_msgs/msg/KeyValue": "key value",
    "diagnostic_msgs/msg/DiagnosticStatus": "level name message hardware_id values",
    "diagnostic_msgs/msg/DiagnosticArray": "header status",
}


def written() -> dict[str, type]:
    made = {name: make_dataclass(name.split("/")[-1], of.split(), slots=True) for name, of in FIELDS.items()}
    levels = {"OK": b"\0", "WARN": b"\1", "ERROR": b"\2", "STALE": b"\3"}  # bytes, as rclpy has them
    status = made["diagnostic_msgs/msg/DiagnosticStatus"]
    made["diagnostic_msgs/msg/DiagnosticStatus"] = type("DiagnosticStatus", (status,), levels)
    return made


def real() -> tuple[dict[str, type], object]:
    """Classes, and the store that serialises them; skips the test without rosbags."""
    import pytest

    pytest.importorskip("rosbags", reason="the definitions of ROS 2 messages: pip install rosbags")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    return {name: store.types[name] for name in FIELDS}, store


def names(message: type) -> list[str]:
    return [one.name for one in fields(message) if one.name.islower() and one.name[0] != "_"]


class Node:
    """Keeps publishers' messages by topic, subscriptions and timers; parameters come from `given`, time from `now`."""

    given, now = {}, 1000.0

    def __init__(self, name):
        self.published, self.takes, self.timers, self.log = {}, {}, [], []

    def declare_parameter(self, name, value):
        return SimpleNamespace(value=self.given.get(name, value))

    def create_publisher(self, kind, topic, depth):
        self.published[topic] = said = []

        def publish(message):
            assert isinstance(message, kind)
            said.append(message)

        return SimpleNamespace(publish=publish)

    def create_subscription(self, kind, topic, use, depth):
        self.takes[topic] = (kind, use)

    def create_timer(self, period, call):
        self.timers.append((period, call))

    def get_logger(self):
        return SimpleNamespace(error=self.log.append, fatal=self.log.append)

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=round(Node.now * 1e9)))


def install(monkeypatch, messages: dict[str, type]) -> None:
    """Makes `import rclpy` and the packages of messages find these; cfem_ros is read afresh."""
    packages: dict[str, ModuleType] = {}
    for name, kind in messages.items():
        package, _, short = name.split("/")
        module = packages.setdefault(f"{package}.msg", ModuleType(f"{package}.msg"))
        setattr(module, short, kind)
        packages.setdefault(package, ModuleType(package))
    packages |= {name: ModuleType(name) for name in ("rclpy", "rclpy.node", "rclpy.executors")}
    packages["rclpy.node"].Node = Node
    packages["rclpy.executors"].ExternalShutdownException = type("ExternalShutdownException", (Exception,), {})
    packages["rclpy"].init, packages["rclpy"].spin = lambda args=None: None, lambda node: None
    for name, module in packages.items():
        monkeypatch.setitem(sys.modules, name, module)
    for name in ("cfem_ros", "cfem_ros.bridge", "cfem_ros.node", "cfem_ros.topic_plant"):
        monkeypatch.delitem(sys.modules, name, raising=False)
