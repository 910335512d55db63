"""Markers: places on a surface, fixed to its nodes, and places for trials."""

import numpy as np

from cfem.condensed.spread import outermost, spread
from cfem.contact.surface.triangles import closest
from cfem.predict.protocol import Predictor


def on_triangles(points: np.ndarray, rest: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights (m, n) of the nodes whose mean is nearest to each point, those of one triangle, and distances (m,) mm.

    points (m, 3) mm; rest (n, 3) mm: the nodes; triangles (t, 3): numbers of nodes."""
    corners = rest[triangles]
    weights, distances = np.zeros((len(points), len(rest))), np.empty(len(points))
    for number, point in enumerate(np.asarray(points, float)):
        barycentric, distance = closest(corners, point)
        best = int(distance.argmin())
        weights[number, triangles[best]] = barycentric[best]
        distances[number] = distance[best]
    return weights, distances


def markers_near(model: Predictor, count: int) -> np.ndarray:
    """Places (count, 3) mm of nodes spread over the part of the surface that moves: for trials."""
    rest = model.skin.rest
    moves = np.linalg.norm(model.skin.modes, axis=(0, 2))
    loose = np.flatnonzero(moves > 0.2 * moves.max())
    return rest[loose[spread(rest[loose], count, outermost(rest[loose], rest[loose].mean(axis=0)))]]
