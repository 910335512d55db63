"""Planes that moving least squares fit to a surface before its points, compiled: see `cfem.contact.detection`."""

from typing import NamedTuple

import numpy as np
from numba import njit

TURNING = 0.2  # of the product of two normals: a face that turns away loses its weight over so much
LEAST = 1e-6  # of the weight of a face at the point: faces that are kept have no less
WITHIN = 2.5  # distances of patches: how far from a point its faces are looked for
OPPOSED = -0.2  # largest product of the normals of two that face each other
STEEP = 0.7  # slope of the plane through faces on their own normals: from twice that, as at an edge, it is not taken
RANK = 1e-3  # of the larger extent: faces in a line span no surface
END = np.exp(-(WITHIN**2))


class Planes(NamedTuple):
    """Planes before points (p,), each of its faces, f of all points together.

    weights: (f,) of the faces in the foot of the point
    gaps: (p,) mm
    frames: (p, 3, 3) rows n, t1, t2
    spread: (p,) the smallest extent of the faces over the largest"""

    weights: np.ndarray
    gaps: np.ndarray
    frames: np.ndarray
    spread: np.ndarray


def planes_before(
    points: np.ndarray, first: np.ndarray, faces: np.ndarray, places: np.ndarray, normals: np.ndarray, wide: np.ndarray
) -> Planes:
    """Planes before points (p,), whose faces are faces[first[i]:first[i + 1]]; places (N, 3) mm, outward unit normals
    (N, 3), and distances `wide` (N,) mm to the neighbours, of all."""
    return Planes(*_planes(points, first, faces, places, normals, wide))


@njit(cache=True, error_model="numpy")
def kernel(square):
    """Weight of a face by the square of its distance, in distances of patches: 0, but for LEAST, from WITHIN on, so
    that a face comes and goes without a jump."""
    return max((np.exp(-square) - END) / (1 - END), LEAST)


@njit(cache=True, error_model="numpy")
def _planes(points, first, faces, places, normals, wide):
    """Fields of `Planes`."""
    weights, gaps, spread = np.empty(len(faces)), np.empty(len(points)), np.empty(len(points))
    frames, e = np.empty((len(points), 3, 3)), np.zeros(3)
    e[0] = 1.0
    for p in range(len(points)):
        i, a, b = points[p], first[p], first[p + 1]
        apart, G, n = places[i] - places[faces[a:b]], np.empty(b - a), np.zeros(3)
        for k in range(b - a):
            j = faces[a + k]
            opposed = OPPOSED - (normals[i] * normals[j]).sum()
            turned = min(max(opposed / TURNING, LEAST), 1.0)
            G[k] = kernel((apart[k] * apart[k]).sum() / wide[j] ** 2) * turned
            n += G[k] * normals[j]
        n /= np.sqrt((n * n).sum())
        for _ in range(2):  # the second time square on the plane that the first has fitted
            frame = frames[p]
            _tangents(n, frame)
            A, M, rise = np.ones((b - a, 3)), np.zeros((3, 3)), np.zeros(3)
            for k in range(b - a):
                for t in range(1, 3):
                    A[k, t] = -(frame[t] * apart[k]).sum() / wide[i]
                above = -(frame[0] * apart[k]).sum()
                for r in range(3):
                    rise[r] += G[k] * A[k, r] * above
                    for c in range(3):
                        M[r, c] += G[k] * A[k, r] * A[k, c]
            extents = np.linalg.eigvalsh(M)
            spread[p] = extents[0] / extents[2]
            for r in range(3):
                M[r, r] += max(RANK - spread[p], 0.0) * extents[2]
            slope = np.linalg.solve(M, rise)[1:] / wide[i]
            slope *= min(max(2 - np.sqrt((slope * slope).sum()) / STEEP, 0.0), 1.0)
            n = frame[0] - slope[0] * frame[1] - slope[1] * frame[2]
            n /= np.sqrt((n * n).sum())
        share, foot = np.linalg.solve(M, e), np.zeros(3)
        for k in range(b - a):
            weights[a + k] = G[k] * (A[k] * share).sum()
            foot += weights[a + k] * apart[k]
        gaps[p] = (frames[p, 0] * foot).sum() + (1 - weights[a:b].sum()) * (frames[p, 0] * places[i]).sum()
    return weights, gaps, frames, spread


@njit(cache=True, error_model="numpy")
def _tangents(n, frame):
    """Fills a frame (3, 3) as `cfem.contact.obstacle.tangents` does."""
    x, y, z = n
    sign = -1.0 if z < -0.99 else 1.0
    a = -1.0 / (sign + z)
    frame[0] = n
    frame[1, 0], frame[1, 1], frame[1, 2] = 1.0 + sign * x * x * a, sign * x * y * a, -sign * x
    frame[2, 0], frame[2, 1], frame[2, 2] = x * y * a, sign + y * y * a, -y


@njit(cache=True, error_model="numpy")
def near_faces(places, normals, wide, regions, codes, middles, radii, deep, own):
    """Numbers (k,) of points and of faces that are near them, turned towards them, and, of their own body, not more
    than `deep` distances behind.

    places (N, 3) mm, normals (N, 3) and wide (N,) mm of all; regions (N,) that they lie in, codes (G, G) of who may
    meet whom, none where 0, middles (G, 3) mm and radii (G,) mm of the regions"""
    count, widest = len(codes), np.zeros(len(codes))
    order = np.argsort(regions, kind="mergesort")
    begin = np.searchsorted(regions[order], np.arange(count + 1))
    for p in range(len(places)):
        widest[regions[p]] = max(widest[regions[p]], wide[p])
    points, faces = [0 for _ in range(0)], [0 for _ in range(0)]
    for g in range(count):
        for h in range(count):
            if codes[g, h] == 0:
                continue
            reach, square = radii[g] + radii[h] + WITHIN * widest[h], 0.0
            for a in range(3):
                square += (middles[g, a] - middles[h, a]) ** 2
            if square >= reach * reach:
                continue
            for i in order[begin[g] : begin[g + 1]]:
                for j in order[begin[h] : begin[h + 1]]:
                    square, facing, above = 0.0, 0.0, 0.0
                    for a in range(3):
                        apart = places[i, a] - places[j, a]
                        square += apart * apart
                        above += apart * normals[j, a]
                        facing += normals[i, a] * normals[j, a]
                    if square >= (WITHIN * wide[j]) ** 2 or facing >= OPPOSED:
                        continue
                    if codes[g, h] == own and above < -deep * wide[j]:
                        continue
                    points.append(i)
                    faces.append(j)
    return np.array(points, dtype=np.int64), np.array(faces, dtype=np.int64)
