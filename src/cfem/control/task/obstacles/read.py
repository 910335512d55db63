"""The obstacles of a spec, with what their files hold: how each moves, and which are pressed, avoided or soft."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from cfem.contact.obstacle import Obstacle
from cfem.contact.prescribed_motion import ActuatedRobot, PrescribedMotion
from cfem.control.task.obstacles.spec import ObstaclesSpec
from cfem.core.errors import located
from cfem.predict.contact.obstacle_spec import RobotObstacle
from cfem.predict.load import load_model


@dataclass(frozen=True)
class ReadObstacles:
    """Obstacles by name.

    motions: of rigid bodies, and of robots that are only avoided
    robots: courses of the robots that may be touched
    itself: the name under which the robot touches itself, or none
    pressed: those whose force is a row
    avoided: those whose distance is a row"""

    motions: Mapping[str, PrescribedMotion]
    robots: Mapping[str, ActuatedRobot]
    itself: tuple[str, ...]
    pressed: tuple[str, ...]
    avoided: tuple[str, ...]

    @cached_property
    def rigid(self) -> dict[str, Obstacle]:
        """Those of `motions` where they are at the first goal."""
        return {name: motion.at(0.0) for name, motion in self.motions.items()}

    @property
    def at_first(self) -> dict[str, Obstacle]:
        """All but the robot itself, where they are at the first goal."""
        return self.rigid | {name: course.at(0.0) for name, course in self.robots.items()}

    @property
    def touched(self) -> dict[str, PrescribedMotion]:
        """Those of `motions` that are not avoided."""
        return {name: motion for name, motion in self.motions.items() if name not in self.avoided}

    @property
    def moving(self) -> dict[str, PrescribedMotion]:
        """Those of `motions` that do not stand still."""
        return {name: motion for name, motion in self.motions.items() if motion.way(0.0, 1.0) > 0}


def read_obstacles(spec: ObstaclesSpec, base: Path) -> ReadObstacles:
    """Obstacles of the spec; base: its folder. InputError where a file or a model does not fit."""
    robots, motions = {}, {}
    for name, obstacle in spec.obstacles.items():
        if isinstance(obstacle, RobotObstacle):
            kind = robots if obstacle.avoid is None else motions
            kind[name] = course_of(obstacle, base / obstacle.model)
        elif obstacle.kind != "itself":
            motions[name] = obstacle.course(base)
    return ReadObstacles(
        motions,
        robots,
        tuple(name for name, obstacle in spec.obstacles.items() if obstacle.kind == "itself"),
        tuple(name for name, obstacle in spec.obstacles.items() if obstacle.pressed),
        tuple(name for name, obstacle in spec.obstacles.items() if obstacle.avoid is not None),
    )


def course_of(obstacle: RobotObstacle, folder: Path) -> ActuatedRobot:
    """Course of another robot's actuators; folder: of its model."""
    with located(folder):
        return obstacle.actuated(load_model(folder))
