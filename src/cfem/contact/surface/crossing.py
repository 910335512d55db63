"""Self-intersections of a surface of triangles: edges that pierce triangles."""

import numpy as np
from scipy.spatial import cKDTree

_PARALLEL = 1e-12  # of the edge's and the triangle's sizes: an edge in the plane of a triangle does not pierce it

PORTION = 20_000  # segments at a time, for memory


def crossings(X: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges (k, 2), by their nodes, and the numbers (k,) of triangles that they pierce; X (n, 3), triangles (m, 3).
    An edge that has a corner of the triangle does not count (Moeller and Trumbore, Journal of Graphics Tools 2, 1997).
    """
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    edges = np.unique(np.sort(sides, axis=1), axis=0)
    edge, triangle = _candidate_pairs(X[edges], X[triangles])
    apart = (edges[edge][:, :, None] != triangles[triangle][:, None]).all(axis=(1, 2))
    edge, triangle = edge[apart], triangle[apart]
    pierced, *_ = _pierces(X[edges[edge]], X[triangles[triangle]])
    return edges[edge[pierced]], triangle[pierced]


def pierced_by(segments: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """All piercings of segments (k, 2, 3) through triangles with corners (m, 3, 3): the numbers (p,) of segment and
    triangle, the share (p,) of the segment, and the barycentric coordinates (p, 3) in the triangle."""
    parts = []
    for start in range(0, len(segments), PORTION):
        some = segments[start : start + PORTION]
        segment, triangle = _candidate_pairs(some, corners)
        pierced, *coordinates = _pierces(some[segment], corners[triangle])
        share, u, v = (value[pierced] for value in coordinates)
        parts.append((start + segment[pierced], triangle[pierced], share, np.column_stack([1 - u - v, u, v])))
    return tuple(np.concatenate(each) for each in zip(*parts, strict=True))


def _candidate_pairs(edges: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of edges (k, 2, 3) and triangles (m, 3, 3), numbers (p,) each, whose surrounding balls meet. Triangles are
    sought by classes of size, so that large ones do not make every edge near."""
    middles, centres = edges.mean(axis=1), triangles.mean(axis=1)
    halves = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1) / 2
    radii = np.linalg.norm(triangles - centres[:, None], axis=2).max(axis=1)
    classes = np.floor(np.log2(np.maximum(radii, 1e-9 * radii.max())))
    found_edges, found_triangles = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for each in np.unique(classes):
        members = np.flatnonzero(classes == each)
        near = cKDTree(centres[members]).query_ball_point(middles, halves + radii[members].max())
        counts = np.array([len(numbers) for numbers in near])
        if counts.sum():
            found_edges.append(np.repeat(np.arange(len(edges)), counts))
            found_triangles.append(members[np.concatenate([numbers for numbers in near if numbers])])
    return np.concatenate(found_edges), np.concatenate(found_triangles)


def _pierces(edges: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Mask (k,) of crossings of edges (k, 2, 3) and triangles (k, 3, 3); where they do, the share of the edge, and the
    second and third barycentric coordinates in the triangle."""
    start, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    a, first, second = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(along, second)
    det = np.einsum("ki,ki->k", first, across)
    sizes = np.linalg.norm(along, axis=1) * np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    slanted = np.abs(det) > _PARALLEL * sizes
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = start - a
        turned = np.cross(offset, first)
        u = np.einsum("ki,ki->k", offset, across) / det
        v = np.einsum("ki,ki->k", along, turned) / det
        share = np.einsum("ki,ki->k", second, turned) / det
        pierced = slanted & (u > 0) & (v > 0) & (u + v < 1) & (share > 0) & (share < 1)
    return pierced, share, u, v
