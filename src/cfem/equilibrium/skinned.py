"""A robot whose skin is watched."""

from dataclasses import replace

from cfem.condensed.skin import Skin
from cfem.constraint.skin_rows import SkinRows
from cfem.equilibrium.system.robot import Robot


def skinned(robot: Robot, skin: Skin) -> Robot:
    """The robot with the skin's rows between its effectors and its actuators. It may be of another design, whose nodes
    stand for the same points of the body."""
    return replace(robot, skin=SkinRows(skin, robot.X), rows=replace(robot.rows, skin=skin.names))
