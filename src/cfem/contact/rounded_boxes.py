"""Distances, frames and curvatures of many rounded boxes (`cfem.contact.obstacle.Rounded`) at many points, compiled.

The arrays of `Boxes` are of all boxes, as the obstacles have them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from cfem.contact.obstacle import Rounded


class Boxes(NamedTuple):
    """Arrays of n rounded boxes.

    R, t: (n, 3, 3) rotations and (n, 3) mm places
    core, rounding: (n, 3) mm and (n,) mm
    below: (n,) half spaces
    reach: (n,) mm from t to the farthest point"""

    R: np.ndarray
    t: np.ndarray
    core: np.ndarray
    rounding: np.ndarray
    below: np.ndarray
    reach: np.ndarray

    @classmethod
    def of(cls, obstacles: Sequence[Rounded]) -> "Boxes":
        R = np.array([obstacle.R for obstacle in obstacles], float).reshape(-1, 3, 3)
        return cls(R, np.array([obstacle.t for obstacle in obstacles], float).reshape(-1, 3), *sizes(obstacles))


def sizes(obstacles: Sequence[Rounded]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Core, rounding, below and reach of `Boxes`."""
    core = np.array([obstacle.core for obstacle in obstacles], float).reshape(-1, 3)
    rounding = np.array([obstacle.rounding for obstacle in obstacles], float)
    return core, rounding, np.isinf(core[:, 0]), np.sqrt((core**2).sum(axis=1)) + rounding


@njit(cache=True, error_model="numpy")
def nearest(boxes, points, farthest):
    """Distances (N,) mm from points (N, 3) mm to the nearest box, `farthest` at most, and (N,) its place among them."""
    distance, which = np.full(len(points), farthest), np.zeros(len(points), dtype=np.int64)
    for o in range(len(boxes.t)):
        t, reach, of_box = boxes.t[o], boxes.reach[o], (boxes.R[o], boxes.core[o], boxes.rounding[o], boxes.below[o])
        for p in range(len(points)):
            x, y, z = points[p, 0] - t[0], points[p, 1] - t[1], points[p, 2] - t[2]
            beyond = distance[p] + reach
            if beyond > 0 and x * x + y * y + z * z < beyond * beyond:  # else it is not nearer than is known
                candidate = _distance(*of_box, x, y, z, distance[p])
                if candidate < distance[p]:
                    distance[p], which[p] = candidate, o
    return distance, which


@njit(cache=True, error_model="numpy")
def _distance(R, core, rounding, below, x, y, z, farthest):
    """Distance of a point, mm from the middle of a box, as of `_local`; `farthest` where it is not nearer than that."""
    square, most = 0.0, -np.inf
    for i in range(3):
        s = x * R[0, i] + y * R[1, i] + z * R[2, i]
        excess = (s if below else abs(s)) - core[i]
        if excess - rounding >= farthest:
            return farthest
        if excess > most:
            most = excess
        if excess > 0:
            square += excess * excess
    away = np.sqrt(square)
    return (away if away > 0 else most) - rounding


@njit(cache=True, error_model="numpy")
def frames(boxes, numbers, points):
    """Frames (c, 3, 3), rows n, t1, t2, of the boxes `numbers` (c,) at points (c, 3) mm: see
    `cfem.contact.obstacle.tangents`."""
    frames, n, local = np.zeros((len(points), 3, 3)), np.empty(3), np.empty((3, 3))
    for p in range(len(points)):
        local_distance(boxes, numbers[p], points[p], n)
        sign = -1.0 if n[2] < -0.99 else 1.0
        a = -1.0 / (sign + n[2])
        b = n[0] * n[1] * a
        local[0, 0], local[0, 1], local[0, 2] = n[0], n[1], n[2]
        local[1, 0], local[1, 1], local[1, 2] = 1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]
        local[2, 0], local[2, 1], local[2, 2] = b, sign + n[1] * n[1] * a, -n[1]
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    frames[p, i, j] += local[i, k] * boxes.R[numbers[p], j, k]
    return frames


@njit(cache=True, error_model="numpy")
def bends(boxes, numbers, points):
    """Derivative (c, 3, 3) 1/mm of the normals of the boxes `numbers` (c,) by the places `points` (c, 3) mm."""
    slopes, n, local, half = np.zeros((len(points), 3, 3)), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    for p in range(len(points)):
        o = numbers[p]
        R = boxes.R[o]
        away = local_distance(boxes, o, points[p], n) + boxes.rounding[o]
        if not (boxes.rounding[o] > 0 and away > 0):
            continue
        for i in range(3):
            for j in range(3):
                round_there = i == j and (n[i] != 0 or boxes.core[o, i] == 0)  # there is no face across this axis
                local[i, j] = ((1.0 if round_there else 0.0) - n[i] * n[j]) / away
        for i in range(3):
            for j in range(3):
                half[i, j] = local[i, 0] * R[j, 0] + local[i, 1] * R[j, 1] + local[i, 2] * R[j, 2]
        for i in range(3):
            for j in range(3):
                slopes[p, i, j] = R[i, 0] * half[0, j] + R[i, 1] * half[1, j] + R[i, 2] * half[2, j]
    return slopes


@njit(cache=True, error_model="numpy")
def deep(boxes, numbers, points, distances, side):
    """True where a point (c, 3) mm is so far within its box `numbers` (c,), by -distances (c,) mm, that the normal
    twice as far in has a product below `side` with the one there."""
    n, deeper, x = np.empty(3), np.empty(3), np.empty(3)
    for p in range(len(points)):
        if distances[p] < 0:
            o, product = numbers[p], 0.0
            local_distance(boxes, o, points[p], n)
            for i in range(3):
                along = boxes.R[o, i, 0] * n[0] + boxes.R[o, i, 1] * n[1] + boxes.R[o, i, 2] * n[2]
                x[i] = points[p, i] + distances[p] * along
            local_distance(boxes, o, x, deeper)
            for i in range(3):
                product += n[i] * deeper[i]
            if product < side:
                return True
    return False


@njit(cache=True, error_model="numpy")
def local_distance(boxes, o, x, normal):
    """Distance of x (3,) mm to box o, and the normal in its own coordinates: see `cfem.contact.obstacle.rounded`."""
    square, largest, most = 0.0, 0, -np.inf
    for i in range(3):
        s = 0.0
        for j in range(3):
            s += (x[j] - boxes.t[o, j]) * boxes.R[o, j, i]
        sign = -1.0 if s < 0 and not boxes.below[o] else 1.0
        excess = sign * s - boxes.core[o, i]
        if excess > most:
            largest, most = i, excess
        normal[i] = sign * max(excess, 0.0)
        square += max(excess, 0.0) ** 2
        if i == largest:
            upwards = sign
    away = np.sqrt(square)
    if away > 0:
        for i in range(3):
            normal[i] /= away
        return away - boxes.rounding[o]
    for i in range(3):
        normal[i] = upwards if i == largest else 0.0
    return most - boxes.rounding[o]
