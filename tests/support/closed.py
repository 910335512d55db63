"""Closed surfaces of triangles."""

import numpy as np

from cfem.contact.surface.closed_surface import ClosedSurface

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
_SQUARES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
_BOX = np.array([[a, b, c] for a, b, c, d in _SQUARES] + [[a, c, d] for a, b, c, d in _SQUARES])


def box_arrays(low, high) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a box between two corners."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    return low + _CORNERS * (high - low), _BOX


def box_surface(half) -> ClosedSurface:
    return ClosedSurface(*box_arrays(-np.asarray(half), np.asarray(half)))


def prism_arrays(polygon, triangles, height: float) -> tuple[np.ndarray, np.ndarray]:
    """A polygon (n, 2), anticlockwise, cut into triangles (m, 3), as the prism from z = 0 to `height`."""
    n, caps = len(polygon), np.asarray(triangles)
    around = np.arange(n)
    after = np.roll(around, -1)
    sides = [np.column_stack([around, after, after + n]), np.column_stack([around, after + n, around + n])]
    ends = [np.column_stack([polygon, np.full(n, z)]) for z in (0.0, height)]
    return np.vstack(ends), np.vstack([caps[:, ::-1], caps + n, *sides])


def octahedral_sphere(levels: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors and triangles, each split into four `levels` times."""
    vertices = [*np.eye(3), *-np.eye(3)]
    triangles = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    for _ in range(levels):
        middle: dict[tuple[int, int], int] = {}
        split = []
        for corners in triangles:
            new = []
            for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
                if (key := (min(a, b), max(a, b))) not in middle:
                    middle[key] = len(vertices)
                    vertices.append((vertices[a] + vertices[b]) / np.linalg.norm(vertices[a] + vertices[b]))
                new.append(middle[key])
            (a, b, c), (ab, bc, ca) = corners, new
            split += [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        triangles = split
    return np.array(vertices), np.array(triangles)
