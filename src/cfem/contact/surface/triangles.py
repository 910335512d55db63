"""Triangles of surfaces: their normals, the volumes within, and nearest points (Ericson, *Real-Time Collision
Detection*, 2005, section 5.1.5)."""

import numpy as np

FLAT = 1e-24  # of the squared sides' product: the squared area of a triangle that is no more than a segment


def normals_of(corners: np.ndarray) -> np.ndarray:
    """Normals (t, 3) mm^2 of triangles (t, 3, 3), each twice its area long."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def area_vectors(
    surface: np.ndarray, triangles: np.ndarray, patch: np.ndarray | None = None, count: int | None = None
) -> np.ndarray:
    """Area vectors (count, 3) mm^2: sums of the normals of triangles, twice their area long, over the corners that
    belong to each patch, to each node unless patches (m,) are given."""
    a, b, c = (surface[triangles[:, i]].T for i in range(3))
    (x, y, z), (u, v, w) = b - a, c - a
    corners = (triangles if patch is None else patch[triangles]).ravel()
    area = (np.repeat(component, 3) for component in (y * w - z * v, z * u - x * w, x * v - y * u))
    count = len(surface) if count is None else count
    return np.stack([np.bincount(corners, component, count) for component in area], axis=1)


def mean_normals(
    surface: np.ndarray, triangles: np.ndarray, patch: np.ndarray | None = None, count: int | None = None
) -> np.ndarray:
    """Outward unit normals (count, 3) of patches of a surface (m, 3) mm with triangles (t, 3), of its nodes unless
    patches are given; patch (m,): number of each node's patch. Each corner of a triangle gives its area to its own
    patch."""
    total = area_vectors(surface, triangles, patch, count)
    return total / np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]


def volumes_within(X: np.ndarray, triangles: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Volumes (count,) mm^3 within closed surfaces of triangles (t, 3) at nodes X (n, 3) mm, negative where the normals
    point into it; part (t,): number of each triangle's surface."""
    corners = X[triangles] - X[triangles].mean(axis=(0, 1))
    return np.bincount(part, np.linalg.det(corners)) / 6


def closest(corners: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric coordinates (t, 3) of the point of each triangle (t, 3, 3) that is nearest to its point, and their
    distance (t,) mm; points (t, 3), or one (3,) for all. On an edge the other corner's coordinate is exactly 0."""
    a, b, c = corners.swapaxes(0, 1)
    ab, ac, ap = b - a, c - a, points - a
    d11, d12, d22, p1, p2 = (np.einsum("ti,ti->t", u, v) for u, v in ((ab, ab), (ab, ac), (ac, ac), (ab, ap), (ac, ap)))
    b1, b2, c1, c2 = p1 - d11, p2 - d12, p1 - d12, p2 - d22  # of the ways from b and from c
    of_c, of_b, of_a = p1 * b2 - b1 * p2, c1 * p2 - p1 * c2, b1 * c2 - c1 * b2
    along = b2 - b1
    zeros, ones = np.zeros(len(ab)), np.ones(len(ab))
    with np.errstate(divide="ignore", invalid="ignore"):
        on_ab, on_ac, on_bc, area = p1 / d11, p2 / d22, along / (along + c1 - c2), of_a + of_b + of_c
        cases = [
            ((p1 <= 0) & (p2 <= 0), zeros, zeros),
            ((b1 >= 0) & (b2 <= b1), ones, zeros),
            ((of_c <= 0) & (p1 >= 0) & (b1 <= 0), on_ab, zeros),
            ((c2 >= 0) & (c1 <= c2), zeros, ones),
            ((of_b <= 0) & (p2 >= 0) & (c2 <= 0), zeros, on_ac),
            ((of_a <= 0) & (along >= 0) & (c1 >= c2), 1 - on_bc, on_bc),
        ]
        conditions = [case[0] for case in cases]
        v = np.select(conditions, [case[1] for case in cases], of_b / area)
        w = np.select(conditions, [case[2] for case in cases], of_c / area)
    bary = np.column_stack([np.where(conditions[5] & ~np.any(conditions[:5], axis=0), 0.0, 1 - v - w), v, w])
    flat = d11 * d22 - d12**2 <= FLAT * d11 * d22
    if flat.any():
        bary[flat] = _on_sides(corners[flat], np.broadcast_to(points, a.shape)[flat])
    return bary, np.linalg.norm(np.einsum("tc,tci->ti", bary, corners) - points, axis=1)


def _on_sides(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (t, 3) of the nearest points of their three sides."""
    bary = np.zeros((3, len(corners), 3))
    for side, (start, end) in enumerate(((0, 1), (1, 2), (2, 0))):
        edge = corners[:, end] - corners[:, start]
        t = ((points - corners[:, start]) * edge).sum(axis=1) / np.maximum((edge**2).sum(axis=1), 1e-300)
        bary[side, :, end] = np.clip(t, 0.0, 1.0)
        bary[side, :, start] = 1 - bary[side, :, end]
    apart = np.linalg.norm(np.einsum("stc,tci->sti", bary, corners) - points, axis=2)
    return bary[np.argmin(apart, axis=0), np.arange(len(corners))]
