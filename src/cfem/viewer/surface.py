"""A surface as a viewer needs it: smooth where it is smooth, sharp at edges."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

SHARP = np.deg2rad(40.0)


def sharpened(rest: np.ndarray, triangles: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of rest (n, 3) that lie on an edge where the surface turns by more than `SHARP`, once for each smooth part
    behind the first, numbered from `first` on; and the triangles (t, 3) with these numbers. Each part is then lit by
    its own normals."""
    sides = [rest[triangles[:, k]] - rest[triangles[:, 0]] for k in (1, 2)]
    normals = np.cross(*sides)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None]
    corner = np.arange(triangles.size).reshape(triangles.shape)
    ends = np.concatenate([np.stack([corner[:, k], corner[:, (k + 1) % 3]], axis=1) for k in range(3)])
    points = triangles.ravel()[ends]
    turned = points[:, 0] > points[:, 1]
    ends[turned], points[turned] = ends[turned, ::-1], points[turned, ::-1]
    order = np.lexsort(points.T)
    edge, following = order[:-1], order[1:]  # two sides of an edge follow each other
    smooth = (normals[ends[edge, 0] // 3] * normals[ends[following, 0] // 3]).sum(axis=1) > np.cos(SHARP)
    joined = (points[edge] == points[following]).all(axis=1) & smooth
    pairs = np.concatenate([np.stack([ends[edge, k], ends[following, k]], axis=1)[joined] for k in (0, 1)])
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(triangles.size,) * 2)
    part = connected_components(graph, directed=False)[1]
    parts, index = np.unique(np.stack([triangles.ravel(), part]), axis=1, return_inverse=True)
    later = np.flatnonzero(np.diff(parts[0], prepend=-1) == 0)
    number = parts[0].copy()
    number[later] = first + np.arange(len(later))
    return parts[0][later], number[index.ravel()].reshape(triangles.shape)
