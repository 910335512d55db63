"""Points by which a surface touches, each a weighted mean of its nodes: of a patch, for one."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

SHARP = np.radians(30.0)


class _Means:
    """Weighted means of surface nodes: weights (N, m) of the m nodes in N points, and the points' places at `rest` (N,
    3)."""

    weights: csr_array
    rest: np.ndarray

    def __len__(self) -> int:
        return len(self.rest)

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Means (N, ...) at the points of values (m, ...) of surface nodes."""
        return (self.weights @ values.reshape(len(values), -1)).reshape(len(self), *values.shape[1:])

    @cached_property
    def spacing(self) -> float:
        """Distance of neighbours at rest, mm, the median."""
        return float(np.median(cKDTree(self.rest).query(self.rest, 2)[0][:, 1]))


@dataclass(frozen=True)
class SurfacePoints(_Means):
    """Points of any weights.

    weights: (N, m) of the surface nodes, of sum 1 in each point
    rest: (N, 3) mm, places of the points
    areas: (N,) mm^2 on which the force of each point acts as a pressure; 0 at the corners of quadratic triangles, where
    nodes carry none"""

    weights: csr_array
    rest: np.ndarray
    areas: np.ndarray


@dataclass(frozen=True)
class Patches(_Means):
    """A surface cut into N patches, each of which touches as the mean of its nodes.

    of: (m,) number of the patch that each surface node belongs to
    shares: (m,) of the node in its patch, of sum 1 in each
    rest: (N, 3) mm, places of the patches"""

    of: np.ndarray
    shares: np.ndarray
    rest: np.ndarray

    @cached_property
    def weights(self) -> csr_array:
        return csr_array((self.shares, (self.of, np.arange(len(self.of)))), shape=(len(self.rest), len(self.of)))

    @cached_property
    def members(self) -> tuple[np.ndarray, ...]:
        """Surface nodes of each."""
        order = np.argsort(self.of, kind="stable")
        return tuple(np.split(order, np.searchsorted(self.of[order], np.arange(1, len(self)))))


def edges(rest: np.ndarray, triangles: np.ndarray) -> csr_array:
    """Lengths (m, m) mm of the edges of triangles (t, 3) between nodes at rest (m, 3) mm."""
    pairs = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    lengths = np.linalg.norm(np.diff(rest[pairs], axis=1)[:, 0], axis=1)
    return csr_array((lengths, pairs.T), shape=(len(rest), len(rest)))


def cut(
    rest: np.ndarray, weights: np.ndarray, apart: float, triangles: np.ndarray, sharp_edges: bool = False
) -> Patches:
    """Patches of a surface of nodes rest (m, 3) mm with shares `weights` (m,) and triangles (t, 3), whose centres are
    about `apart` mm from each other. What does not hang together along the surface is not one patch. sharp_edges: such
    edges have patches of their own, as what is beside them first touches there, and the mean of a patch that goes round
    one lies in the body."""
    graph, patch, count = edges(rest, triangles).tocoo(), np.zeros(len(rest), dtype=np.int64), 0
    parts = _connected(on_sharp_edges(rest, triangles).astype(np.int64), graph) if sharp_edges else patch
    for part in np.unique(parts):
        members = np.flatnonzero(parts == part)
        patch[members] = count + _nearest_centre(rest[members], apart)
        count = int(patch[members].max()) + 1
    patch = _connected(patch, graph)
    area = np.maximum(weights, 1e-12 / len(weights))
    shares = area / np.bincount(patch, area)[patch]
    places = np.zeros((int(patch.max()) + 1, 3))
    np.add.at(places, patch, shares[:, None] * rest)
    return Patches(patch, shares, places)


def _nearest_centre(nodes: np.ndarray, apart: float) -> np.ndarray:
    """Number (m,) of the centre that is nearest to each of nodes (m, 3) mm. Each centre is the node farthest from those
    before (Gonzalez 1985), until every node is within `apart` mm of one."""
    nearest, nearest_number = np.full(len(nodes), np.inf), np.zeros(len(nodes), dtype=np.int64)
    centre, count = int(np.argmax(np.linalg.norm(nodes - nodes.mean(axis=0), axis=1))), 0
    while nearest.max() > apart:
        away = np.linalg.norm(nodes - nodes[centre], axis=1)
        closer = away < nearest
        nearest_number[closer], nearest[closer] = count, away[closer]
        centre, count = int(np.argmax(nearest)), count + 1
    return nearest_number


def on_sharp_edges(rest: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Mask (m,) of the nodes on edges at which the surface is convex and turns by more than SHARP."""
    corners = rest[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    # half edges from `start` to `end`, each with the third corner of its triangle; its twin runs the other way
    start, end, opposite = (triangles[:, np.roll([0, 1, 2], -i)].ravel() for i in range(3))
    key, triangle = start * len(rest) + end, np.repeat(np.arange(len(triangles)), 3)
    order = np.argsort(key)
    twin = order[np.minimum(np.searchsorted(key[order], end * len(rest) + start), len(key) - 1)]
    # the normals turn by more than SHARP, and the twin's third corner lies below this triangle: convex
    turned = np.einsum("ei,ei->e", normals[triangle], normals[triangle[twin]]) < np.cos(SHARP)
    below = np.einsum("ei,ei->e", rest[opposite[twin]] - rest[start], normals[triangle]) < 0
    sharp = turned & below & (start[twin] == end) & (end[twin] == start)
    return np.isin(np.arange(len(rest)), [start[sharp], end[sharp]])


def _connected(numbers: np.ndarray, graph: coo_array) -> np.ndarray:
    """Patches (m,), in each of which edges lead from any node to any other: the largest piece of each of `numbers`
    keeps its number, the others get new ones."""
    within = numbers[graph.row] == numbers[graph.col]
    inner = csr_array((graph.data[within], (graph.row[within], graph.col[within])), shape=graph.shape)
    pieces, piece = connected_components(inner, directed=False)
    size, patch = np.bincount(piece), np.empty(pieces, dtype=np.int64)
    patch[piece] = numbers
    order = np.lexsort((-size, patch))
    extra = order[1:][patch[order[1:]] == patch[order[:-1]]]
    patch[extra] = numbers.max() + 1 + np.arange(len(extra))
    return patch[piece]
