"""The outer surface of a body."""

from dataclasses import dataclass

import numpy as np

from cfem.contact.surface.facets import components
from cfem.contact.surface.triangles import normals_of, volumes_within

_TRIANGLES = {3: [0, 1, 2], 6: [0, 3, 5, 3, 1, 4, 5, 4, 2, 3, 4, 5], 4: [0, 1, 2, 0, 2, 3]}


@dataclass(frozen=True)
class Surface:
    """The outer surface of a body.

    nodes: (m,) numbers in the mesh
    rest: (m, 3) mm
    triangles: (t, 3) indices into nodes, normals outward
    weights: (m,) each node's share of the area, of sum 1"""

    nodes: np.ndarray
    rest: np.ndarray
    triangles: np.ndarray
    weights: np.ndarray


def outer_surface(X: np.ndarray, facets: np.ndarray) -> Surface:
    """Surface of facets (k, 3 | 6 | 4) at nodes X (n, 3) mm: all but closed cavities. Quadratic triangles become
    four."""
    triangles = triangulated(facets)
    _, part = components(triangles)
    volumes = volumes_within(X, triangles, part)
    nodes, triangles = np.unique(triangles[volumes[part] > 0], return_inverse=True)
    triangles, rest = triangles.reshape(-1, 3), X[nodes]
    areas = np.linalg.norm(normals_of(rest[triangles]), axis=1)
    weights = np.bincount(triangles.ravel(), np.repeat(areas, 3))
    return Surface(nodes, rest, triangles, weights / weights.sum())


def triangulated(facets: np.ndarray) -> np.ndarray:
    """Triangles (t, 3) of facets: triangles as they are, quadrilaterals as two, quadratic triangles as four."""
    return facets[:, _TRIANGLES[facets.shape[1]]].reshape(-1, 3)
