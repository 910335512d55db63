"""How chosen patches of a touchable robot yield, without forces and under them (`cfem.predict.held`): compiled loops.

c patches, k modes of the skin, r mixtures of them (`Touchable.bends`), n_e effectors."""

from typing import NamedTuple

import numpy as np
from numba import njit

from cfem.predict.high_order_load import Beyond, beyond, slope


class Parts(NamedTuple):
    """Of chosen patches without forces: U (3 c, k) their modes, left (3 c, 3 c) mm/N what these leave of the
    compliance, total (3 c, 3 c) all of it, yields (c,) mm/N each one where it is stiff, R (c, 3, 3) rotations since
    rest, dented (c, 3, 3, 3 + n_e) mm/N^2 their E in the robot's axes, with the effectors."""

    U: np.ndarray
    left: np.ndarray
    total: np.ndarray
    yields: np.ndarray
    R: np.ndarray
    dented: np.ndarray


class Loaded(NamedTuple):
    """Under forces on these. w (k,) N: their load on the modes, and v (r,) on the mixtures; change (n_e + r, r) mm/N:
    of C_es and C_ss, seen in these; modes: what they do; bending: the size of its second order over that of its first.
    Of dents: places (c, 3) mm by which patches move beyond what `left` says, slopes (c, 3, 3) mm/N their derivatives,
    and seconds (c,), what is taken of the second order."""

    w: np.ndarray
    v: np.ndarray
    change: np.ndarray
    modes: Beyond
    bending: float
    places: np.ndarray
    slopes: np.ndarray
    seconds: np.ndarray


@njit(cache=True, error_model="numpy")
def parts(chosen, modes, C_ss, R, at, local, dented):
    """U, left, total and dented of `Parts`. chosen (c,) of N patches with modes (N, 3, k); C_ss (k, k) mm/N; at
    (terms,): of the series local (N, N, terms, 3, 3) and dented (terms, N, 3, 3, 3 + n_e)."""
    c, k, terms = len(chosen), len(C_ss), len(at)  # by loops: whole arrays take seconds to compile
    U, by = np.empty((3 * c, k)), np.zeros((3 * c, k))
    left, total = np.empty((3 * c, 3 * c)), np.empty((3 * c, 3 * c))
    for i in range(c):
        for a in range(3):
            for d in range(k):
                U[3 * i + a, d] = modes[chosen[i], a, d]
    for row in range(3 * c):
        for other in range(k):
            for d in range(k):
                by[row, d] += U[row, other] * C_ss[other, d]
    L, half = np.empty((3, 3)), np.empty((3, 3))
    for i in range(c):
        for j in range(i, c):
            L[:] = 0.0
            of = local[chosen[i], chosen[j]]
            for term in range(terms):
                for a in range(3):
                    for b in range(3):
                        L[a, b] += at[term] * of[term, a, b]
            _product(R[i], L, half)
            for a in range(3):
                for b in range(3):
                    value, modal = 0.0, 0.0
                    for d in range(3):
                        value += half[a, d] * R[j, b, d]
                    for d in range(k):
                        modal += by[3 * i + a, d] * U[3 * j + b, d]
                    left[3 * i + a, 3 * j + b] = value
                    total[3 * i + a, 3 * j + b] = modal
        for a in range(3):
            for b in range(a):  # of one patch it is symmetric but for rounding
                mean = (left[3 * i + a, 3 * i + b] + left[3 * i + b, 3 * i + a]) / 2
                left[3 * i + a, 3 * i + b], left[3 * i + b, 3 * i + a] = mean, mean
    for a in range(3 * c):
        for b in range(a, 3 * c):
            total[a, b] += left[a, b]
            left[b, a], total[b, a] = left[a, b], total[a, b]
    return U, left, total, _dents(chosen, R, at, dented)


@njit(cache=True, error_model="numpy")
def _product(A, B, found):
    for a in range(3):
        for b in range(3):
            found[a, b] = A[a, 0] * B[0, b] + A[a, 1] * B[1, b] + A[a, 2] * B[2, b]


@njit(cache=True, error_model="numpy")
def _dents(chosen, R, at, dented):
    """(c, 3, 3, 3 + n_e) of the series, turned by R, which the effectors are not."""
    last = dented.shape[-1]
    found, E, half = np.zeros((len(chosen), 3, 3, last)), np.empty((3, 3, last)), np.empty((3, 3, last))
    for i in range(len(chosen)):
        E[:] = 0.0
        for term in range(len(at)):
            of = dented[term, chosen[i]]
            for a in range(3):
                for b in range(3):
                    for d in range(last):
                        E[a, b, d] += at[term] * of[a, b, d]
        for a in range(3):
            for b in range(3):
                for d in range(3, last):
                    half[a, b, d] = E[a, b, d]
                for d in range(3):
                    half[a, b, d] = E[a, b, 0] * R[i, d, 0] + E[a, b, 1] * R[i, d, 1] + E[a, b, 2] * R[i, d, 2]
        for a in range(3):
            for b in range(3):
                for p in range(3):
                    for q in range(3):
                        for d in range(last):
                            found[i, a, b, d] += R[i, a, p] * R[i, b, q] * half[p, q, d]
    return found


@njit(cache=True, error_model="numpy")
def loaded(forces, C_ss, bends, D, U, yields, dented):
    """Under forces (c, 3) N; bends (k, r); D (r, n_e + r, r) mm/N^2, and of `Parts`."""
    c, (k, r), seen = len(forces), bends.shape, D.shape[1]
    w, v, change, by_mixture = np.zeros(k), np.zeros(r), np.zeros((seen, r)), np.zeros(r)
    for i in range(c):
        for a in range(3):
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
    places, slopes, seconds = np.empty((c, 3)), np.empty((c, 3, 3)), np.empty(c)
    bent, own, by_bent, stiff = np.empty((3, 3)), np.empty(3), np.empty(3), np.zeros((3, 3))
    for i in range(c):
        f = forces[i]
        for a in range(3):
            for b in range(3):
                bent[a, b] = dented[i, a, b, 0] * f[0] + dented[i, a, b, 1] * f[1] + dented[i, a, b, 2] * f[2]
            own[a], stiff[a, a] = yields[i] * f[a], yields[i]
            by_bent[a] = bent[a, 0] * f[0] + bent[a, 1] * f[1] + bent[a, 2] * f[2]
        of = beyond(f, own, by_bent)
        inclined = slope(of, stiff, bent)
        for a in range(3):
            places[i, a] = of.motion[a] - own[a]
            for b in range(3):
                slopes[i, a, b] = inclined[a, b] - stiff[a, b]
        seconds[i] = of.second
    return Loaded(w, v, change, modes, bending, places, slopes, seconds)
