"""Cables that hardly run as they are meant to, and effectors that watch the same."""

from itertools import combinations

import numpy as np

from cfem.core.errors import SpecError
from cfem.equilibrium.system.robot import Robot
from cfem.robot import spec
from cfem.robot.places import cable_points, effector_points, pull_point

FAR = 2.0  # times the robot's size, between a pull point and the cable's first point
BESIDE = 0.01  # of the robot's size, within which two ways of a cable are the same
NEAR = 0.25  # of the robot's size, within which a cable's end is at what is held


def cable_doubts(scene: spec.SceneSpec, robot: Robot) -> list[str]:
    """A sentence for each cable that runs back over its own way, whose pull point is far away, that begins at the wrong
    end, or that is pulled from the free end of the body."""
    size, held = float(np.ptp(robot.X, axis=0).max()), robot.X[robot.fixed]
    sentences = []
    for item in scene.actuators:
        if item.kind != "cable":
            continue
        points = cable_points(scene, item)
        if (back := _turns_back(points, BESIDE * size)) is not None:
            sentences.append(f"cable '{item.name}' runs back over its own way at point {back}: check their order")
        if (pull := pull_point(scene, item)) is None:
            continue
        first, last = (float(np.linalg.norm(pull - points[end])) for end in (0, -1))
        from_held = [float(np.linalg.norm(held - end, axis=1).min()) for end in (pull, points[-1])]
        if first > FAR * size:
            sentences.append(
                f"cable '{item.name}' is pulled from {first:.4g} mm away, and the body is {size:.3g} mm large: "
                "check pull_point"
            )
        elif len(points) > 1 and first > 2 * last:
            sentences.append(
                f"cable '{item.name}' begins {first:.3g} mm from its pull point and ends {last:.3g} mm from it: "
                "its points run from the pull point on, check their order"
            )
        elif from_held[0] > 0.5 * size and from_held[1] < NEAR * size:
            sentences.append(
                f"cable '{item.name}' is pulled from the free end, {from_held[0]:.3g} mm from what is held: "
                "check pull_point and the order of the points"
            )
    return sentences


def _turns_back(points: np.ndarray, near: float) -> int | None:
    """Number of the first of points (k, 3) mm at which a cable turns back over its own way, within `near` mm of it, or
    None."""
    for number in range(1, len(points) - 1):
        ways = [points[end] - points[number] for end in (number - 1, number + 1)]
        shorter, longer = sorted(ways, key=np.linalg.norm)
        along = longer / np.linalg.norm(longer)
        if shorter @ along > 0 and np.linalg.norm(shorter - (shorter @ along) * along) < near:
            return number
    return None


def effector_doubts(scene: spec.SceneSpec) -> list[str]:
    """A sentence for each pair that watches the same points."""
    watched = []
    for item in scene.effectors:
        try:
            places = np.atleast_2d(effector_points(scene, item))
        except SpecError:
            continue  # a centre of mass
        watched.append((item.name, item.orientation, places))
    return [
        f"effectors '{a}' and '{b}' watch the same place: leave one out"
        for (a, turns_a, places_a), (b, turns_b, places_b) in combinations(watched, 2)
        if turns_a == turns_b and places_a.shape == places_b.shape and np.abs(places_a - places_b).max() < 1e-6
    ]
