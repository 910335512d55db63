"""What hardly can be meant, such as a robot of 0.06 mm: most of it is a number written in another unit."""

import numpy as np
from numpy.typing import ArrayLike

from cfem.core.console.shown import stress
from cfem.equilibrium.system.robot import Robot
from cfem.robot.checks.routing import cable_doubts, effector_doubts
from cfem.robot.checks.stroke import stroke_doubts
from cfem.robot.checks.walls import wall_doubts

SMALLEST, LARGEST = 1.0, 1e4  # mm, of a soft robot: shorter or longer ones are mostly written in another unit
ROBOTS = (10.0, 1e3)  # mm, that most soft robots measure
LONG = 0.5  # share of a cable's length: no soft robot is known to shorten a cable by more
MODULI = (1e-3, 3e5)  # MPa, Young's: from gels to metals, of all that a robot may be made of
RUBBER = (1e-3, 1e3)  # MPa, Young's, of what laws of rubber are fitted to
LENGTHS = 3.0  # times: between the length that errors are told by and the body's largest side
DENSITIES = (1e-11, 2.3e-8)  # t/mm^3, from foams to the heaviest metals
GRAVITIES = (100.0, 1e5)  # mm/s^2, from a tenth of the moon's to ten times the earth's
LOCKS = 0.49  # Poisson's ratio beyond which tetrahedra of constant strain hold on to their volumes
LONG_AXES = {"bar": 0, "taper": 0, "stiff-flop": 0, "trunk": 2, "soft-finger": 2}  # along which these bodies are long


def doubts(scene, robot: Robot) -> list[str]:
    """Sentences on what in a scene is hardly meant as it is written."""
    sentences = [*size_doubts(np.ptp(robot.X, axis=0))]
    for item, actuator in zip(scene.actuators, robot.actuators, strict=True):
        length = getattr(actuator, "rest_length", None)
        if length is not None and item.reach[1] > LONG * length:
            share = f"{100 * item.reach[1] / length:.0f} %"
            sentences.append(
                f"cable '{item.name}' may be shortened by {item.reach[1]:.4g} mm, {share} of its {length:.4g} mm"
            )
    extent = np.ptp(robot.X, axis=0)
    if not extent.max() / LENGTHS <= scene.length <= LENGTHS * extent.max():
        sentences.append(f"length is {scene.length:.4g} mm, and the body measures {sides(extent)} mm: check its unit")
    sentences += _width_doubts(scene, extent) + _material_doubts(scene)
    if scene.gravity is not None:
        sentences += gravity_doubts(scene.gravity.acceleration, "gravity")
    sentences += wall_doubts(scene, robot)
    return sentences + cable_doubts(scene, robot) + effector_doubts(scene) + stroke_doubts(scene, robot)


def _width_doubts(scene, extent: np.ndarray) -> list[str]:
    """Says if a body that is long by its name is wider than long."""
    axis = LONG_AXES.get(scene.geometry.kind)
    if axis is None or extent[axis] >= extent.max():
        return []
    what = f"the {scene.geometry.kind} measures {sides(extent)} mm"
    return [f"{what}, wider than its {extent[axis]:.3g} mm of length: check its widths"]


def _material_doubts(scene) -> list[str]:
    """Says which moduli and densities are of no known material, and where tet4 locks."""
    sentences = []
    for key, item in scene.all_materials.items():
        sentences += modulus_doubts(item.young, MODULI, f"check the units of {key}")
        if item.density is not None and not DENSITIES[0] <= item.density <= DENSITIES[1]:
            dense, known = 1e12 * item.density, " to ".join(f"{1e12 * end:g}" for end in DENSITIES)
            sentences.append(f"the density of {key} is {dense:.4g} kg/m^3, and matter has {known}: check its unit")
        if scene.mesh.element == "tet4" and item.poisson > LOCKS:
            what = f"tet4 locks at Poisson's ratio {item.poisson:g} of {key}, and forces come out far too large"
            sentences.append(f"{what}: use tet10p0, or a ratio of at most {LOCKS:g}")
    if scene.mesh.element == "tet4" and scene.layers:
        sentences.append("tet4 below a layer locks, and bends far too little: use tet10p0")
    return sentences


def gravity_doubts(acceleration: ArrayLike, key: str) -> list[str]:
    """Says if an acceleration (3,) mm/s^2, stated under `key`, is hardly that of gravity."""
    size = float(np.linalg.norm(acceleration))
    if size == 0 or GRAVITIES[0] <= size <= GRAVITIES[1]:
        return []
    return [f"{key} is {size / 1e3:.4g} m/s^2, and on earth 9.81 m/s^2: check its unit"]


def modulus_doubts(young: float, known: tuple[float, float], do: str) -> list[str]:
    """Says if Young's modulus (MPa) is outside of what is known. known: smallest and largest; do: what to check."""
    low, high = known
    if low <= young <= high:
        return []
    return [f"Young's modulus is {stress(young)}, and {stress(low)} to {stress(high)} is known of such materials: {do}"]


def size_doubts(extent: np.ndarray) -> list[str]:
    """Says if a body that measures `extent` (3,) mm is too small or too large for a soft robot."""
    size = float(extent.max())
    if SMALLEST <= size <= LARGEST:
        return []
    wrong = "metres read as millimetres" if size < SMALLEST else "millimetres read as metres"
    return [f"the body measures {sides(extent)} mm, which suggests {wrong}: check the units of the geometry"]


def sides(extent: np.ndarray) -> str:
    """Text 'x x y x z' of an extent (3,)."""
    return " x ".join(f"{side:.3g}" for side in extent)
