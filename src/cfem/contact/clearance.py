"""The smallest signed distance of a surface of triangles to an obstacle, between its nodes too, with a bound.

Branch and bound: for every triangle there is a bound that no point of it is nearer than (`Obstacle.at_least`). Those
whose bound is lower than the smallest distance found so far are split into four."""

from dataclasses import dataclass

import numpy as np

from cfem.contact.obstacle import Obstacle

TOLERANCE = 1e-3  # mm
MOST = 20_000  # triangles at a time, before the rest is left to the bound
_MIDDLES = np.array([[1, 1, 0], [0, 1, 1], [1, 0, 1]]) / 2
_SPLIT = np.array([*([corner, *_MIDDLES[[i, i - 1]]] for i, corner in enumerate(np.eye(3))), _MIDDLES])


@dataclass(frozen=True)
class Nearest:
    """The point of a surface that is nearest to an obstacle.

    distance: mm, the smallest that was found, negative inside
    at_least: mm; no point of the surface is nearer
    place: (3,) mm, in the surface's triangle number `triangle` at barycentric coordinates `shares` (3,)
    normal: (3,) unit gradient of the distance by the place"""

    distance: float
    at_least: float
    place: np.ndarray
    triangle: int
    shares: np.ndarray
    normal: np.ndarray


def nearest_of_surface(
    nodes: np.ndarray, triangles: np.ndarray, obstacle: Obstacle, tolerance: float = TOLERANCE
) -> Nearest:
    """Nearest point of a surface of nodes (m, 3) mm and triangles (t, 3). Its distance is within `tolerance` mm of the
    smallest, unless more than MOST triangles at a time cannot be told apart, as where a surface lies flat on a mesh:
    at_least says what is certain."""
    distance = obstacle.distance(nodes)
    at_node = np.full(len(nodes), -1)
    at_node[triangles] = np.arange(len(triangles))[:, None]
    used = np.flatnonzero(at_node >= 0)
    first = used[np.argmin(distance[used])]
    best, triangle = float(distance[first]), int(at_node[first])
    shares = (triangles[triangle] == first).astype(float)
    parents, parts = np.arange(len(triangles)), np.tile(np.eye(3), (len(triangles), 1, 1))
    floor = np.inf  # below what is left out
    while len(parents):
        corners = parts @ nodes[triangles[parents]]
        value, bound = obstacle.at_least(corners, best - tolerance)
        least = int(np.argmin(value))
        if value[least] < best:
            best, triangle, shares = float(value[least]), int(parents[least]), parts[least].mean(axis=0)
        near = bound < best - tolerance
        floor = min(floor, bound[~near].min(initial=np.inf))
        parents, parts, bound = parents[near], parts[near], bound[near]
        if len(parents) > max(MOST, len(triangles)):
            floor = min(floor, bound.min())
            break
        parts = (_SPLIT @ parts[:, None]).reshape(-1, 3, 3)
        parents = np.repeat(parents, 4)
    place = shares @ nodes[triangles[triangle]]
    return Nearest(best, min(best, float(floor)), place, triangle, shares, obstacle.normals(place[None])[0])
