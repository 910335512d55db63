"""What cannot be, and what hardly can: a reach beyond the cable, a watched point that is held, a robot of 0.06 mm."""

import numpy as np

from cfem.core.errors import SpecError
from cfem.core.shown import stress
from cfem.equilibrium.robot import Robot
from cfem.robot.soundness import moves_nothing, stands_still

SMALLEST, LARGEST = 1.0, 1e4  # mm, of a soft robot: shorter or longer ones are mostly written in another unit
LONG = 0.5  # share of a cable's length: no soft robot is known to shorten a cable by more
MODULI = (1e-3, 3e5)  # MPa, Young's: from gels to metals, of all that a robot may be made of
RUBBER = (1e-3, 1e3)  # MPa, Young's, of what laws of rubber are fitted to
STRONG = 100.0  # times Young's modulus: chambers burst long before such a pressure


def demand_possible(scene, robot: Robot) -> None:
    """SpecError where an actuator's reach is more than there is of it, or where all that a point acts on is held."""
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
    low, high = item.reach
    length, volume = getattr(actuator, "rest_length", None), getattr(actuator, "rest_volume", None)
    if length is not None and high >= length:
        what = f"cable '{item.name}' is {length:.4g} mm long and cannot be shortened by {high:.4g} mm"
        raise SpecError(what, where="reach", do="give the largest shortening, often a tenth of the length")
    if volume is not None and low <= -volume:
        what = f"{item.kind} '{item.name}' holds {volume:.4g} mm^3 and cannot lose {-low:.4g} mm^3"
        raise SpecError(what, where="reach", do="give the largest loss of volume, below what it holds")


def doubts(scene, robot: Robot) -> list[str]:
    """What hardly can be meant, a sentence each."""
    found = [*size_doubts(np.ptp(robot.X, axis=0))]
    for item, actuator in zip(scene.actuators, robot.actuators, strict=True):
        length = getattr(actuator, "rest_length", None)
        if length is not None and item.reach[1] > LONG * length:
            share = f"{100 * item.reach[1] / length:.0f} %"
            found.append(
                f"cable '{item.name}' may be shortened by {item.reach[1]:.4g} mm, {share} of its {length:.4g} mm"
            )
    found += _pressure_doubts(scene)
    extent = float(np.ptp(robot.X, axis=0).max())
    if not extent / 10 <= scene.length <= 10 * extent:
        found.append(f"length is {scene.length:.4g} mm, and the body measures {_extent(robot.X)} mm: check its unit")
    return found


def modulus_doubts(young: float, known: tuple[float, float], do: str) -> list[str]:
    """Of Young's modulus (MPa): none, or why it is hardly meant. known: smallest and largest; do: what to check."""
    low, high = known
    if low <= young <= high:
        return []
    return [f"Young's modulus is {stress(young)}, and {stress(low)} to {stress(high)} is known of such materials: {do}"]


def _pressure_doubts(scene) -> list[str]:
    """A sentence for each pressure (MPa) that no wall of the robot's stiffest material would bear."""
    young = max(material.young for material in (scene.material, *(part.material for part in scene.materials)))
    driven = [item for item in scene.actuators if getattr(item, "pressure", None) is not None]
    largest = [(item, np.abs(item.pressure).max()) for item in driven]
    return [
        f"the pressure of {item.kind} '{item.name}' may be {pressure:.4g} MPa, {pressure / young:.0f} times "
        f"Young's modulus of {young:.4g} MPa: check their units"
        for item, pressure in largest
        if pressure > STRONG * young
    ]


def size_doubts(extent: np.ndarray) -> list[str]:
    """Of a body that measures `extent` (3,) mm: none, or why that is hardly meant."""
    size = float(extent.max())
    if SMALLEST <= size <= LARGEST:
        return []
    wrong = "metres read as millimetres" if size < SMALLEST else "millimetres read as metres"
    return [f"the body measures {_sides(extent)} mm, which suggests {wrong}: check the units of the geometry"]


def _extent(X: np.ndarray) -> str:
    return _sides(np.ptp(X, axis=0))


def _sides(extent: np.ndarray) -> str:
    return " x ".join(f"{side:.3g}" for side in extent)
