"""A surface cut into patches, each of which may be touched: its place is the mean of its nodes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

SHARP = np.radians(30.0)


@dataclass(frozen=True)
class Patches:
    """of (m,): number of the patch that each surface node belongs to; shares (m,): of the node in its patch, of sum 1
    in each; rest (N, 3) mm: places of the patches."""

    of: np.ndarray
    shares: np.ndarray
    rest: np.ndarray

    def __len__(self) -> int:
        return len(self.rest)

    def mean(self, values: np.ndarray) -> np.ndarray:
        """(m, ...) of surface nodes -> (N, ...) of patches."""
        found = np.zeros((len(self), *values.shape[1:]))
        np.add.at(found, self.of, self.shares.reshape(-1, *[1] * (values.ndim - 1)) * values)
        return found

    @cached_property
    def spacing(self) -> float:
        """mm: the distance of neighbours at rest, the median."""
        apart = np.linalg.norm(self.rest[:, None] - self.rest, axis=2) + 1e9 * np.eye(len(self))
        return float(np.median(apart.min(axis=1)))

    @cached_property
    def members(self) -> tuple[np.ndarray, ...]:
        """Surface nodes of each."""
        order = np.argsort(self.of, kind="stable")
        return tuple(np.split(order, np.searchsorted(self.of[order], np.arange(1, len(self)))))


def edges(rest: np.ndarray, triangles: np.ndarray) -> csr_array:
    """(m, m) mm: the lengths of the edges of triangles (t, 3) between nodes at rest (m, 3) mm."""
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
    graph, of, count = edges(rest, triangles).tocoo(), np.zeros(len(rest), dtype=np.int64), 0
    parts = _connected(on_sharp_edges(rest, triangles).astype(np.int64), graph) if sharp_edges else of
    for part in np.unique(parts):
        mine = np.flatnonzero(parts == part)
        of[mine] = count + _nearest_centre(rest[mine], apart)
        count = int(of[mine].max()) + 1
    of = _connected(of, graph)
    area = np.maximum(weights, 1e-12 / len(weights))
    shares = area / np.bincount(of, area)[of]
    patches = Patches(of, shares, np.zeros((int(of.max()) + 1, 3)))
    return Patches(of, shares, patches.mean(rest))


def _nearest_centre(nodes: np.ndarray, apart: float) -> np.ndarray:
    """(m,) number of the centre that is nearest to each of nodes (m, 3) mm. Each centre is the node farthest from those
    before (Gonzalez 1985), until every node is within `apart` mm of one."""
    nearest, of = np.full(len(nodes), np.inf), np.zeros(len(nodes), dtype=np.int64)
    centre, count = int(np.argmax(np.linalg.norm(nodes - nodes.mean(axis=0), axis=1))), 0
    while nearest.max() > apart:
        away = np.linalg.norm(nodes - nodes[centre], axis=1)
        closer = away < nearest
        of[closer], nearest[closer] = count, away[closer]
        centre, count = int(np.argmax(nearest)), count + 1
    return of


def on_sharp_edges(rest: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(m,) bool: nodes on edges at which the surface is convex and turns by more than SHARP."""
    corners = rest[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    start, end, opposite = (triangles[:, np.roll([0, 1, 2], -i)].ravel() for i in range(3))
    key, of = start * len(rest) + end, np.repeat(np.arange(len(triangles)), 3)
    order = np.argsort(key)
    twin = order[np.minimum(np.searchsorted(key[order], end * len(rest) + start), len(key) - 1)]
    turned = np.einsum("ei,ei->e", normals[of], normals[of[twin]]) < np.cos(SHARP)
    below = np.einsum("ei,ei->e", rest[opposite[twin]] - rest[start], normals[of]) < 0
    sharp = turned & below & (start[twin] == end) & (end[twin] == start)
    return np.isin(np.arange(len(rest)), [start[sharp], end[sharp]])


def _connected(of: np.ndarray, graph: coo_array) -> np.ndarray:
    """(m,) patches, in each of which edges lead from any node to any other: the largest piece of each of `of` keeps its
    number, the others get new ones."""
    within = of[graph.row] == of[graph.col]
    inner = csr_array((graph.data[within], (graph.row[within], graph.col[within])), shape=graph.shape)
    pieces, piece = connected_components(inner, directed=False)
    size, patch = np.bincount(piece), np.empty(pieces, dtype=np.int64)
    patch[piece] = of
    order = np.lexsort((-size, patch))
    extra = order[1:][patch[order[1:]] == patch[order[:-1]]]
    patch[extra] = of.max() + 1 + np.arange(len(extra))
    return patch[piece]
