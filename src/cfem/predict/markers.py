"""Markers: places on a surface, fixed to its nodes, and places for trials."""

import numpy as np

from cfem.contact.triangles import closest
from cfem.predict.protocol import Predictor


def on_triangles(points: np.ndarray, rest: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """points (m, 3) mm -> (m, n) weights of the nodes at rest (n, 3), those of the nearest triangle (t, 3), and
    distances (m,) mm from it."""
    corners = rest[triangles]
    weights, away = np.zeros((len(points), len(rest))), np.empty(len(points))
    for number, point in enumerate(np.asarray(points, float)):
        bary, distance = closest(corners, point)
        best = int(distance.argmin())
        weights[number, triangles[best]] = bary[best]
        away[number] = distance[best]
    return weights, away


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
