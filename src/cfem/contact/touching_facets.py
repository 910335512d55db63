"""Facets of the surfaces that touch, by the numbers of their points: edges between them, and smooth parts of the
surface up to sharp edges, which have normals of their own around a node."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from cfem.condensed.patches import SHARP
from cfem.contact.surface.triangles import normals_of


class Facets(NamedTuple):
    """Triangles of all surfaces, by the numbers of N points.

    triangles: (t, 3)
    edges, sides, opposite: (e, 2), edges between two triangles, which these are, and their corners beside the edge
    first (N + 1,), beside: the points that share an edge with point i are beside[first[i]:first[i + 1]]
    smooth: (t, 3) number of the smooth part of the surface around each corner, up to sharp edges"""

    triangles: np.ndarray
    edges: np.ndarray
    sides: np.ndarray
    opposite: np.ndarray
    first: np.ndarray
    beside: np.ndarray
    smooth: np.ndarray

    @classmethod
    def none(cls, count: int) -> "Facets":
        """No facets, among `count` points."""
        return cls.of(np.zeros((0, 3), dtype=np.int64), np.zeros((count, 3)))

    @classmethod
    def of(cls, triangles: np.ndarray, rest: np.ndarray) -> "Facets":
        """Facets (t, 3) of points at rest (N, 3) mm."""
        count = len(rest)
        halves = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        edges, edge = np.unique(np.sort(halves, axis=1), axis=0, return_inverse=True)
        order = np.argsort(edge.ravel(), kind="stable")
        sizes = np.bincount(edge.ravel(), minlength=len(edges))
        begin = np.cumsum(sizes) - sizes
        pairs = sizes == 2
        of_pairs = order[begin[pairs][:, None] + np.arange(2)]
        sides, opposite = of_pairs // 3, triangles[of_pairs // 3, (of_pairs + 2) % 3]
        both = np.concatenate([edges, edges[:, ::-1]])
        both = both[np.argsort(both[:, 0], kind="stable")]
        first = np.searchsorted(both[:, 0], np.arange(count + 1))
        edges = edges[pairs]
        smooth = _smooth(rest, triangles, edges, sides)
        beside = both[:, 1].copy()
        return cls(triangles.astype(np.int64), edges.astype(np.int64), sides, opposite, first, beside, smooth)

    @classmethod
    def joined(cls, each: "Sequence[Facets]", ends: Sequence[int]) -> "Facets":
        """Facets of surfaces whose points begin at the numbers `ends` among all; their count is the last of these."""
        corners = np.cumsum([0, *(facets.smooth.size for facets in each)])
        sides = np.cumsum([0, *(len(facets.triangles) for facets in each)])
        beside = np.cumsum([0, *(len(facets.beside) for facets in each)])
        return cls(
            _stacked([facets.triangles for facets in each], ends),
            _stacked([facets.edges for facets in each], ends),
            _stacked([facets.sides for facets in each], sides),
            _stacked([facets.opposite for facets in each], ends),
            np.append(_stacked([facets.first[:-1] for facets in each], beside), beside[-1]),
            _stacked([facets.beside for facets in each], ends),
            _stacked([facets.smooth for facets in each], corners),
        )


def _stacked(each: Sequence[np.ndarray], begins: Sequence[int]) -> np.ndarray:
    return np.concatenate([begin + numbers for begin, numbers in zip(begins, each, strict=False)])


def _smooth(rest: np.ndarray, triangles: np.ndarray, edges: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """`Facets.smooth`: corners of facets are of one part where they share a node, and an edge at which the normals turn
    by less than SHARP leads from one to the other."""
    normals = normals_of(rest[triangles])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    turns = (normals[sides[:, 0]] * normals[sides[:, 1]]).sum(axis=1)
    edges, sides = edges[turns > np.cos(SHARP)], sides[turns > np.cos(SHARP)]
    corner = (triangles[sides][:, :, :, None] == edges[:, None, None]).argmax(axis=2)  # (s, 2, 2) by side and node
    both = 3 * sides[:, :, None] + corner
    first, second = both[:, 0].ravel(), both[:, 1].ravel()
    shape = triangles.size, triangles.size
    graph = coo_array((np.ones(len(first)), (first, second)), shape=shape)
    return connected_components(graph, directed=False)[1].reshape(-1, 3).astype(np.int64)


@njit(cache=True, error_model="numpy")
def facet_normal(x, normal):
    """Puts the unit normal of the triangle x (3, 3) mm into normal (3,). Its area, mm^2."""
    square = 0.0
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        normal[a] = (x[1, b] - x[0, b]) * (x[2, c] - x[0, c]) - (x[1, c] - x[0, c]) * (x[2, b] - x[0, b])
        square += normal[a] ** 2
    for a in range(3):
        normal[a] /= np.sqrt(square)
    return np.sqrt(square) / 2


@njit(cache=True, error_model="numpy")
def smooth_normals(places, facets):
    """Unit normals (g, 3) of the smooth parts around nodes, by the areas of their facets."""
    normals, x, n = np.zeros((facets.smooth.max() + 1 if facets.smooth.size else 0, 3)), np.empty((3, 3)), np.empty(3)
    for f in range(len(facets.triangles)):
        for c in range(3):
            for a in range(3):
                x[c, a] = places[facets.triangles[f, c], a]
        area = facet_normal(x, n)
        for c in range(3):
            for a in range(3):
                normals[facets.smooth[f, c], a] += area * n[a]
    for g in range(len(normals)):
        size = np.sqrt(normals[g, 0] ** 2 + normals[g, 1] ** 2 + normals[g, 2] ** 2)
        for a in range(3):
            normals[g, a] /= size
    return normals
