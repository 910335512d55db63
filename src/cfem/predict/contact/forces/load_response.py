"""What forces on points of a robot's surface do, each of which dents by itself: compiled loops.

c points, k modes of the skin, r mixtures of them (`SurfaceModel.bends`), n_e effectors."""

from typing import NamedTuple

import numpy as np
from numba import njit

from cfem.predict.contact.forces.high_order import HighOrderMotion, beyond, slope


class LoadResponse(NamedTuple):
    """What forces on patches do.

    w (k,) N: their load on the modes
    v (r,) N: that on the mixtures
    change (n_e + r, r) mm/N: of C_es and C_ss, seen in the mixtures
    modes: motion of the modes, with its first and second order
    bending: size of the second order of that motion over the first
    places (c, 3) mm: motion of the patches by dents, beyond what `PointCompliance.local` says
    slopes (c, 3, 3) mm/N: derivatives of `places` by the forces
    firsts, seconds (c,): shares of the first and of the second order that are taken
    bears: whether any of the forces is not 0"""

    w: np.ndarray
    v: np.ndarray
    change: np.ndarray
    modes: HighOrderMotion
    bending: float
    places: np.ndarray
    slopes: np.ndarray
    firsts: np.ndarray
    seconds: np.ndarray
    bears: bool


@njit(cache=True, error_model="numpy")
def load_response(forces, C_ss, bends, D, U, flexibility, dents):
    """`LoadResponse` to forces (c, 3) N on patches. bends (k, r); D (r, n_e + r, r) mm/N^2; U, flexibility and dents of
    `PointCompliance`."""
    c, (k, r), seen = len(forces), bends.shape, D.shape[1]
    w, v, change, by_mixture = np.zeros(k), np.zeros(r), np.zeros((seen, r)), np.zeros(r)
    bears = False
    for i in range(c):
        for a in range(3):
            bears |= forces[i, a] != 0.0
            for d in range(k):
                w[d] += U[3 * i + a, d] * forces[i, a]
    for row in range(k):
        for d in range(r):
            v[d] += bends[row, d] * w[row]
    for d in range(r):
        for row in range(seen):
            for column in range(r):
                change[row, column] += v[d] * D[d, row, column]
    for row in range(r):
        for d in range(r):
            by_mixture[row] += change[seen - r + row, d] * v[d]
    first, second = np.zeros(k), np.zeros(k)
    for row in range(k):
        for d in range(k):
            first[row] += C_ss[row, d] * w[d]
        for d in range(r):
            second[row] += bends[row, d] * by_mixture[d]
    modes, size, more = beyond(w, first, second), 0.0, 0.0
    for row in range(k):
        size += first[row] ** 2
        more += second[row] ** 2 / 4
    bending = np.sqrt(more / size) if size > 0 else 0.0
    places, slopes, firsts, seconds = np.empty((c, 3)), np.empty((c, 3, 3)), np.empty(c), np.empty(c)
    bent, linear, by_bent, stiff = np.empty((3, 3)), np.empty(3), np.empty(3), np.zeros((3, 3))
    for i in range(c):
        f = forces[i]
        for a in range(3):
            for b in range(3):
                bent[a, b] = dents[i, a, b, 0] * f[0] + dents[i, a, b, 1] * f[1] + dents[i, a, b, 2] * f[2]
            linear[a], stiff[a, a] = flexibility[i] * f[a], flexibility[i]
            by_bent[a] = bent[a, 0] * f[0] + bent[a, 1] * f[1] + bent[a, 2] * f[2]
        dent = beyond(f, linear, by_bent)
        inclined = slope(dent, stiff, bent)
        for a in range(3):
            places[i, a] = dent.motion[a] - linear[a]
            for b in range(3):
                slopes[i, a, b] = inclined[a, b] - stiff[a, b]
        firsts[i], seconds[i] = dent.first, dent.second
    return LoadResponse(w, v, change, modes, bending, places, slopes, firsts, seconds, bears)


@njit(cache=True, error_model="numpy")
def under_forces(total, local, U, bends, change, slopes, modes):
    """Compliance (3 c, 3 c) mm/N of patches under forces: total, local and U of `PointCompliance`; bends (k, r); change
    (r, r) of C_ss, and slopes and modes of `LoadResponse`."""
    n, (k, r), (_, first, second, across, rank) = len(total), bends.shape, modes
    V, by_V, along, by_change = np.zeros((n, r)), np.empty((r, n)), np.zeros(n), np.zeros((n, r))
    for i in range(n):
        for d in range(k):
            along[i] += U[i, d] * across[d]
            for e in range(r):
                V[i, e] += U[i, d] * bends[d, e]
        for d in range(r):
            by_V[d, i] = V[i, d]
            for e in range(r):
                by_change[i, e] += V[i, d] * change[d, e]
    compliance = np.empty((n, n))
    for i in range(n):
        row = compliance[i]
        for j in range(n):
            row[j] = total[i, j] + (first - 1) * (total[i, j] - local[i, j]) + rank * (along[i] * along[j])
        for d in range(r):
            share = second * by_change[i, d]
            for j in range(n):
                row[j] += share * by_V[d, j]
        for b in range(3):
            row[i - i % 3 + b] += slopes[i // 3, i % 3, b]
    return compliance


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def moved_places(free, flat, motion, patches, local, forces, dents):
    """Places (N, 3) mm of patches from places `free` (N, 3) mm, modes `flat` (3 N, k) having gone by motion (k,) mm.
    Those of patches (c,) are also moved by forces (c, 3) N that act locally, by `local` of `PointCompliance`, and by
    dents (c, 3) mm."""
    places = np.empty_like(free)
    for p in range(len(free)):
        for a in range(3):
            displacement = 0.0
            for d in range(len(motion)):
                displacement += flat[3 * p + a, d] * motion[d]
            places[p, a] = free[p, a] + displacement
    for i in range(len(patches)):
        for a in range(3):
            displacement = dents[i, a]
            for j in range(len(patches)):
                for b in range(3):
                    displacement += local[3 * i + a, 3 * j + b] * forces[j, b]
            places[patches[i], a] += displacement
    return places
