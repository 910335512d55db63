"""Nearest points of triangles."""

import numpy as np


def closest(corners: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(t, 3) barycentric coordinates of the point of each triangle (t, 3, 3) that is nearest to its point, and their
    distance (t,) mm; points (t, 3), or one (3,) for all. The nearest point lies in the triangle, else on its edges,
    where the coordinates of the other corners are exactly 0 (Ericson, *Real-Time Collision Detection*, 2005, section
    5.1.5)."""
    a, b, c = corners.swapaxes(0, 1)
    ab, ac, ap = b - a, c - a, points - a
    d11, d12, d22 = ((u * v).sum(axis=1) for u, v in ((ab, ab), (ab, ac), (ac, ac)))
    p1, p2 = (ap * ab).sum(axis=1), (ap * ac).sum(axis=1)
    det = d11 * d22 - d12**2
    flat = det <= 1e-24 * d11 * d22
    det = np.where(flat, 1.0, det)
    v, w = (d22 * p1 - d12 * p2) / det, (d11 * p2 - d12 * p1) / det
    options = [np.column_stack([1 - v - w, v, w])]
    for start, end in ((0, 1), (1, 2), (2, 0)):
        edge = corners[:, end] - corners[:, start]
        t = ((points - corners[:, start]) * edge).sum(axis=1) / np.maximum((edge**2).sum(axis=1), 1e-300)
        t = np.clip(t, 0.0, 1.0)
        bary = np.zeros((len(t), 3))
        bary[:, start], bary[:, end] = 1 - t, t
        options.append(bary)
    distances = [np.linalg.norm(np.einsum("tc,tci->ti", one, corners) - points, axis=1) for one in options]
    distances[0] = np.where(~flat & (options[0] >= 0).all(axis=1), distances[0], np.inf)
    best = np.argmin(distances, axis=0)
    index = np.arange(len(best))
    return np.stack(options)[best, index], np.stack(distances)[best, index]
