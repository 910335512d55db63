"""Points of a closed surface that face another part of it across a gap."""

import numpy as np

from cfem.contact.surface.crossing import pierced_by
from cfem.contact.surface.triangles import normals_of

START = 1e-6  # of the size: how far before its face a ray begins
FACING = 0.5  # cosine between the normals of faces that face each other
ALONG = 1e-7  # of a place in a face: rays that meet an edge exactly pass beside it on one side


def facing(
    X: np.ndarray, triangles: np.ndarray, points: np.ndarray, within: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of a point of a triangle and what lies straight before it within `within` mm. X: (n, 3) mm; triangles:
    (t, 3), normals outward; points: (q, 3) barycentric, of every triangle.

    Returns the numbers (k,) and barycentric places (k, 3) of the points, and those of their partners; without faces
    that share a node or stand at more than 60 degrees to each other."""
    corners = X[triangles]
    across = normals_of(corners)
    normals = across / np.linalg.norm(across, axis=1)[:, None]
    aside = points + ALONG * np.array([1.0, np.sqrt(2), -1 - np.sqrt(2)])
    places = np.einsum("qc,tci->tqi", aside, corners).reshape(-1, 3)
    face, place = np.repeat(np.arange(len(triangles)), len(points)), np.tile(points, (len(triangles), 1))
    start = places + START * np.linalg.norm(np.ptp(X, axis=0)) * normals[face]
    ray, partner, share, partner_place = pierced_by(np.stack([start, places + within * normals[face]], axis=1), corners)
    order = np.lexsort((share, ray))
    first = order[np.unique(ray[order], return_index=True)[1]]
    ray, partner, partner_place = ray[first], partner[first], partner_place[first]
    apart = (triangles[face[ray]][:, :, None] != triangles[partner][:, None]).all(axis=(1, 2))
    against = (normals[face[ray]] * normals[partner]).sum(axis=1) < -FACING
    kept = apart & against
    return face[ray[kept]], place[ray[kept]], partner[kept], partner_place[kept]
