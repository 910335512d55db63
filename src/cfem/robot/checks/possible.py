"""What cannot be: a reach beyond the cable, a watched point that is held."""

from cfem.core.errors import SpecError
from cfem.equilibrium.system.robot import Robot
from cfem.robot.checks.soundness import moves_nothing, stands_still


def demand_possible(scene, robot: Robot) -> None:
    """Raises SpecError where an actuator's reach is more than there is of it, or where all that a point acts on is
    held."""
    for index, (item, actuator) in enumerate(zip(scene.actuators, robot.actuators, strict=True)):
        with scene.locating("actuators", index):
            _demand_reach(item, actuator)
            if moves_nothing(robot, actuator):
                what = f"{item.kind} '{item.name}' acts on held nodes alone and moves nothing"
                raise SpecError(what, do="lead it beyond what `fixed` holds, or hold less")
    for index, (item, effector) in enumerate(zip(scene.effectors, robot.effectors, strict=True)):
        if stands_still(robot, effector):
            what = f"effector '{item.name}' lies where `fixed` holds the body and cannot move"
            with scene.locating("effectors", index):
                raise SpecError(what, do="watch a point that is free, or hold less")


def _demand_reach(item, actuator) -> None:
    """Raises SpecError where the reach exceeds the length of a cable, or a loss of volume what a chamber holds."""
    low, high = item.reach
    length, volume = getattr(actuator, "rest_length", None), getattr(actuator, "rest_volume", None)
    if length is not None and high >= length:
        what = f"cable '{item.name}' is {length:.4g} mm long and cannot be shortened by {high:.4g} mm"
        raise SpecError(what, where="reach", do="give the largest shortening, often a tenth of the length")
    if volume is not None and low <= -volume:
        what = f"{item.kind} '{item.name}' holds {volume:.4g} mm^3 and cannot lose {-low:.4g} mm^3"
        raise SpecError(what, where="reach", do="give the largest loss of volume, below what it holds")
