"""The legs' own weight: a force on the centre of mass of each, which the model knows as an effector."""

from collections.abc import Sequence

import numpy as np

from cfem.constraint.centre_of_mass import CentreOfMass
from cfem.control.crawling.crawler import LegWeight
from cfem.control.crawling.spec import GaitSpec
from cfem.core.errors import InputError
from cfem.equilibrium.system.robot import Robot


def own_weight(
    gait: GaitSpec, robot: Robot, places: Sequence[tuple[np.ndarray, np.ndarray]]
) -> tuple[list[np.ndarray], list[LegWeight]]:
    """Weight of the legs at places, (turn, shift) each: forces (3,) N on the centre of mass in the leg's frame, (0,)
    where the robot has no such effector, and the weights, none without gravity. The forces keep their direction in the
    base, which tilts by little. InputError where the robot's last effector is not its centre of mass."""
    masses, last = robot.masses, robot.effectors[-1]
    if gait.gravity is None and not masses:
        return [np.zeros(0)] * len(places), []
    if not isinstance(last, CentreOfMass) or len(masses) > 1:
        what = "the legs' weight acts on their centre of mass, which is not the last effector of their scene"
        raise InputError(what, where="scene", do="end its effectors with {name: body, at: centre-of-mass}")
    if gait.gravity is None:
        return [np.zeros(3)] * len(places), []
    size, normal = last.mass * gait.gravity, np.asarray(gait.ground.normal, float)
    down = -normal / np.linalg.norm(normal)
    loads = [size * (turn.T @ down) for turn, _ in places]
    return loads, [LegWeight(size, turn @ last.rest + shift, turn) for turn, shift in places]
