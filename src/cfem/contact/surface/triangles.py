"""Nearest points of triangles (Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5)."""

import numpy as np

FLAT = 1e-24  # of the squared sides' product: the squared area of a triangle that is no more than a segment


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
