"""Places of a scene's cables and effectors: as its points say, or along the body of the catalogue."""

import numpy as np

from cfem.core.errors import SpecError
from cfem.robot import constraints, spec
from cfem.robot.catalogue import routes, taper


def cable_points(scene: spec.SceneSpec, item: constraints.Cable) -> np.ndarray:
    """Points (k, 3) mm that the cable runs through."""
    points = item.points if item.route is None else routes.points(scene.geometry, item.route)
    return points if item.shift is None else taper.shifted(points, item.shift.y, item.shift.z, item.shift.outward)


def pull_point(scene: spec.SceneSpec, item: constraints.Cable) -> np.ndarray | None:
    """Point (3,) mm from which the cable is pulled, None where it is held in the body."""
    if item.pull_point is not None or item.route is None:
        return item.pull_point
    return routes.pull_point(scene.geometry, item.route)


def effector_points(scene: spec.SceneSpec, item: constraints.Effector) -> np.ndarray:
    """Point (3,) or points (k, 3) mm that an effector watches. SpecError for a centre of mass, which has no place of
    its own."""
    if item.at == "centre-of-mass":
        raise SpecError(f"effector '{item.name}': the centre of mass of varied geometries is not known")
    if item.at:
        return routes.tip(scene.geometry)
    return item.point if item.points is None else item.points
