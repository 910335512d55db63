"""Depth of the overlap of closed surfaces with themselves: the outer skin of a body, and the walls of its chambers."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array

from cfem.contact.surface.closed_surface import winding
from cfem.contact.surface.crossing import crossings
from cfem.contact.surface.facets import components
from cfem.contact.surface.triangles import closest, mean_normals, normals_of, volumes_within

JITTER = 1e-8  # of the size: mirrored halves meet at edges exactly, where none would pierce the other
ALLOWED = 0.01  # of a robot's length, to which parts of its body may pass through each other
OUT = 1e-6  # of the size: how far before the surface it is seen whether another part of the body is there


@dataclass(frozen=True)
class Overlap:
    """The deepest place of a surface in itself: depth mm, 0 where there is none; the number of the node."""

    depth: float
    node: int


NONE = Overlap(0.0, -1)


@dataclass(frozen=True)
class Boundary:
    """The whole boundary of a body.

    rest: (n, 3) mm all nodes; skin: triangles (t, 3) of what bounds it from outside; chambers: those of each void;
    at_rest: depth mm by which any of them passes through itself at rest"""

    rest: np.ndarray
    skin: np.ndarray
    chambers: tuple[np.ndarray, ...]
    at_rest: float = 0.0

    def overlap(self, x: np.ndarray) -> Overlap:
        """Deepest overlap where the nodes are at x (n, 3) mm: of the skin, whose inside the chambers are part of, or of
        a chamber's walls in each other. Less deep than at rest counts as none."""
        parts = [overlap_of(x, self.skin), *(overlap_of(x, walls, 1.0) for walls in self.chambers)]
        deepest = max(parts, key=lambda part: part.depth)
        return deepest if deepest.depth > self.at_rest else NONE


def boundary_of(X: np.ndarray, triangles: np.ndarray) -> Boundary:
    """Boundary of triangles (t, 3), normals outward, at nodes X (n, 3) mm at rest."""
    _, part = components(triangles)
    volumes = volumes_within(X, triangles, part)
    voids = tuple(triangles[part == number] for number in np.flatnonzero(volumes < 0))
    plain = Boundary(X, triangles[volumes[part] > 0], voids)
    return Boundary(X, plain.skin, voids, plain.overlap(X).depth)


def overlap_of(x: np.ndarray, triangles: np.ndarray, around: float = 0.0) -> Overlap:
    """Deepest overlap of a closed surface of triangles (t, 3) at nodes x (n, 3) mm, in itself. around: how often what
    is not of it winds about its inside: 1 for the walls of a void, 0 for a skin. Only from where edges pierce triangles
    on, and from node to node, is it seen whether a node lies within."""
    jitter = JITTER * np.linalg.norm(np.ptp(x, axis=0)) * np.random.default_rng(0).uniform(-1, 1, x.shape)
    edges, pierced = crossings(x + jitter, triangles)
    if not len(edges):
        return NONE
    used, triangles = np.unique(triangles, return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    nodes, count = x[used], len(used)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    joined = coo_array((np.ones(len(start)), (start, end)), shape=(count, count)).tocsr()
    front = np.unique(np.concatenate([np.searchsorted(used, edges).ravel(), triangles[pierced].ravel()]))
    tried, within = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    while len(front):
        tried[front] = True
        inside = front[_within(nodes, triangles, front, around)]
        within[inside] = True
        reached = np.zeros(count)
        reached[inside] = 1.0
        front = np.flatnonzero((joined @ reached > 0) & ~tried)
    depth, node = _deepest(nodes, triangles, np.flatnonzero(within))
    return Overlap(depth, int(used[node]))


def depth_in_itself(nodes: np.ndarray, triangles: np.ndarray, tried: np.ndarray) -> float:
    """Depth, mm, by which a closed surface of nodes (m, 3) mm and triangles (t, 3) has gone through itself, at the
    nodes of numbers `tried`, 0 where it has not."""
    return _deepest(nodes, triangles, tried[_within(nodes, triangles, tried)])[0]


def _within(nodes: np.ndarray, triangles: np.ndarray, tried: np.ndarray, around: float = 0.0) -> np.ndarray:
    """Mask (k,) of the nodes `tried` of which the outer side is within the body."""
    before = nodes[tried] + OUT * np.linalg.norm(np.ptp(nodes, axis=0)) * mean_normals(nodes, triangles)[tried]
    return winding(nodes[triangles], before) + around > 0.5


def _deepest(nodes: np.ndarray, triangles: np.ndarray, within: np.ndarray) -> tuple[float, int]:
    """Depth mm and number of the node, of those within, whose way out is the longest: that to the nearest triangle
    which faces the node."""
    corners, outward = nodes[triangles], mean_normals(nodes, triangles)
    across = normals_of(corners)
    deepest = (0.0, -1)
    for number in within:
        facing = corners[across @ outward[number] < 0]
        distance = closest(facing, np.broadcast_to(nodes[number], (len(facing), 3)))[1]
        deepest = max(deepest, (float(distance.min(initial=np.inf)) if len(distance) else 0.0, int(number)))
    return deepest
