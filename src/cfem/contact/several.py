"""Several obstacles as one: each point meets the nearest."""

from collections.abc import Sequence

import numpy as np

from cfem.contact.obstacle import Obstacle


def nearest(obstacles: Sequence[Obstacle], points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) mm distance of points (N, 3) mm to the nearest obstacle, and (N,) its number."""
    if len(obstacles) == 1:
        return obstacles[0].distance(points), np.zeros(len(points), dtype=np.int64)
    distances = np.array([one.distance(points) for one in obstacles])
    which = distances.argmin(axis=0)
    return distances[which, np.arange(len(points))], which


def frames(obstacles: Sequence[Obstacle], which: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(c, 3, 3) of the obstacles `which` (c,) at points (c, 3) mm."""
    if len(obstacles) == 1:
        return obstacles[0].frames(points)
    found = np.empty((len(points), 3, 3))
    for number in np.unique(which):
        found[which == number] = obstacles[number].frames(points[which == number])
    return found
