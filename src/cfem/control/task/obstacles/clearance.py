"""Checks before a robot that meets obstacles starts: it overlaps nothing, nothing comes to its mount, and what it is to
touch comes near it."""

from collections.abc import Mapping

import numpy as np

from cfem.condensed.far import FAR
from cfem.contact.obstacle import Obstacle, Plane
from cfem.contact.prescribed_motion import PrescribedMotion
from cfem.core.errors import InputError, NumericalError, SpecError
from cfem.equilibrium.system.robot import Robot
from cfem.predict.contact.model import ContactModel

STOPS = 21  # places of a way that are looked at
INSIDE = 1e-6  # of the length: how far the robot may reach into an obstacle at rest


def demand_apart(model: ContactModel) -> None:
    """Raises SpecError where robots overlap at rest, InputError where there is no contact state."""
    if not model.others and not model.itself:
        return
    try:
        model.standing(0.0).touched(np.zeros(model.patched.model.rows.n_a))
    except InputError as error:
        raise SpecError(error.what, where="obstacles", do=error.do) from None
    except NumericalError as error:
        raise SpecError(str(error), where="obstacles", do="move them apart at the first goal") from None


def demand_outside(robot: Robot, nodes: np.ndarray, obstacles: Mapping[str, Obstacle]) -> None:
    """Raises SpecError where the robot at rest reaches into an obstacle."""
    surface = robot.X[nodes]
    for name, obstacle in obstacles.items():
        distance = obstacle.distance(surface)
        worst = int(distance.argmin())
        if distance[worst] < -INSIDE * robot.length:
            place = ", ".join(f"{x:.3g}" for x in surface[worst])
            raise SpecError(
                f"the robot starts {-distance[worst]:.3g} mm inside it, at ({place}) mm",
                where=f"obstacles.{name}",
                do="turn its normal out of it, or move it"
                if isinstance(obstacle, Plane)
                else "move it away at the first goal",
            )


def demand_way(robot: Robot, nodes: np.ndarray, courses: Mapping[str, PrescribedMotion]) -> None:
    """Raises SpecError where an obstacle comes to where the robot is held, which cannot give way."""
    held = robot.X[nodes[np.isin(nodes, robot.fixed)]]
    for name, motion in courses.items():
        for share in np.linspace(0.0, 1.0, STOPS):
            deep = -motion.at(share).distance(held).min(initial=np.inf)
            if deep > INSIDE * robot.length:
                raise SpecError(
                    f"its way leads {deep:.3g} mm into where the robot is held, {100 * share:.0f} % through the goals",
                    where=f"obstacles.{name}",
                    do="end it before",
                )


def demand_near(robot: Robot, nodes: np.ndarray, courses: Mapping[str, PrescribedMotion]) -> None:
    """Raises SpecError where an obstacle is so far from the robot at rest, all the time, that it is never touched."""
    surface = robot.X[nodes]
    for name, motion in courses.items():
        shares = np.linspace(0.0, 1.0, STOPS) if motion.way(0.0, 1.0) > 0 else [0.0]
        away = min(motion.at(share).distance(surface).min() for share in shares)
        if away > FAR * robot.length:
            raise SpecError(
                f"it is never nearer than {away:.3g} mm, {away / robot.length:.3g} times the robot's length: the robot "
                "does not come to it",
                where=f"obstacles.{name}",
                do="check the unit of its place, or leave it out",
            )
