"""Markers on a surface: which point of it is nearest, and places for trials."""

import numpy as np

from cfem.predict.protocol import Predictor


def closest(corners: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(t, 3) barycentric coordinates of the nearest point of each triangle (t, 3, 3), and its distance (t,) mm: in the
    triangle's plane, else on its edges (Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5)."""
    a, b, c = corners.swapaxes(0, 1)
    ab, ac, ap = b - a, c - a, point - a
    d11, d12, d22 = ((u * v).sum(axis=1) for u, v in ((ab, ab), (ab, ac), (ac, ac)))
    p1, p2 = (ap * ab).sum(axis=1), (ap * ac).sum(axis=1)
    det = np.maximum(d11 * d22 - d12**2, 1e-300)
    v, w = (d22 * p1 - d12 * p2) / det, (d11 * p2 - d12 * p1) / det
    options = [np.column_stack([1 - v - w, v, w])]
    for start, end in ((0, 1), (1, 2), (2, 0)):
        edge = corners[:, end] - corners[:, start]
        t = ((point - corners[:, start]) * edge).sum(axis=1) / np.maximum((edge**2).sum(axis=1), 1e-300)
        t = np.clip(t, 0.0, 1.0)
        bary = np.zeros((len(t), 3))
        bary[:, start], bary[:, end] = 1 - t, t
        options.append(bary)
    distances = [np.linalg.norm(np.einsum("tc,tci->ti", one, corners) - point, axis=1) for one in options]
    distances[0] = np.where((options[0] >= 0).all(axis=1), distances[0], np.inf)
    best = np.argmin(distances, axis=0)
    index = np.arange(len(best))
    return np.stack(options)[best, index], np.stack(distances)[best, index]


def markers_near(model: Predictor, count: int) -> np.ndarray:
    """(count, 3) mm nodes of the surface spread over what moves: for trials."""
    rest = model.skin.rest
    moves = np.linalg.norm(model.skin.modes, axis=(0, 2))
    loose = np.flatnonzero(moves > 0.2 * moves.max())
    chosen = [int(loose[np.argmax(np.linalg.norm(rest[loose] - rest[loose].mean(axis=0), axis=1))])]
    while len(chosen) < count:
        apart = np.linalg.norm(rest[loose][:, None] - rest[chosen], axis=2).min(axis=1)
        chosen.append(int(loose[np.argmax(apart)]))
    return rest[chosen]
