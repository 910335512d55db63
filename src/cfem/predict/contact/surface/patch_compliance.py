"""Compliance of patches of a robot (`cfem.predict.contact.surface.patched_model`) without forces on them: compiled
loops.

c patches, k modes of the skin, n_e effectors."""

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def patch_compliance(patches, modes, C_ss, R, basis, local, dented):
    """U, local, total and dents of `PointCompliance`: of patches (c,) among N with modes (N, 3, k); C_ss (k, k) mm/N;
    basis (terms,) of the series local (N, N, terms, 3, 3) and dented (terms, N, 3, 3, 3 + n_e)."""
    c, k, terms = len(patches), len(C_ss), len(basis)  # by loops: whole arrays take seconds to compile
    U, by_compliance = np.empty((3 * c, k)), np.zeros((3 * c, k))
    local_part, total = np.empty((3 * c, 3 * c)), np.empty((3 * c, 3 * c))
    for i in range(c):
        for a in range(3):
            for d in range(k):
                U[3 * i + a, d] = modes[patches[i], a, d]
    for row in range(3 * c):
        for mode in range(k):
            for d in range(k):
                by_compliance[row, d] += U[row, mode] * C_ss[mode, d]
    L, half = np.empty((3, 3)), np.empty((3, 3))
    for i in range(c):
        for j in range(i, c):
            L[:] = 0.0
            series = local[patches[i], patches[j]]
            for term in range(terms):
                for a in range(3):
                    for b in range(3):
                        L[a, b] += basis[term] * series[term, a, b]
            _product(R[i], L, half)
            for a in range(3):
                for b in range(3):
                    value, modal = 0.0, 0.0
                    for d in range(3):
                        value += half[a, d] * R[j, b, d]
                    for d in range(k):
                        modal += by_compliance[3 * i + a, d] * U[3 * j + b, d]
                    local_part[3 * i + a, 3 * j + b] = value
                    total[3 * i + a, 3 * j + b] = modal
        for a in range(3):
            for b in range(a):  # of one patch it is symmetric but for rounding
                mean = (local_part[3 * i + a, 3 * i + b] + local_part[3 * i + b, 3 * i + a]) / 2
                local_part[3 * i + a, 3 * i + b], local_part[3 * i + b, 3 * i + a] = mean, mean
    for a in range(3 * c):
        for b in range(a, 3 * c):
            total[a, b] += local_part[a, b]
            local_part[b, a], total[b, a] = local_part[a, b], total[a, b]
    return U, local_part, total, _dents(patches, R, basis, dented)


@njit(inline="always", error_model="numpy")  # else numba optimises it again in its caller
def _product(A, B, product):
    for a in range(3):
        for b in range(3):
            product[a, b] = A[a, 0] * B[0, b] + A[a, 1] * B[1, b] + A[a, 2] * B[2, b]


@njit(inline="always", error_model="numpy")
def _dents(patches, R, basis, dented):
    """(c, 3, 3, 3 + n_e) of the series, turned by R, which the effectors are not."""
    last = dented.shape[-1]
    dents, E, half = np.zeros((len(patches), 3, 3, last)), np.empty((3, 3, last)), np.empty((3, 3, last))
    for i in range(len(patches)):
        E[:] = 0.0
        for term in range(len(basis)):
            series = dented[term, patches[i]]
            for a in range(3):
                for b in range(3):
                    for d in range(last):
                        E[a, b, d] += basis[term] * series[a, b, d]
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
                            dents[i, a, b, d] += R[i, a, p] * R[i, b, q] * half[p, q, d]
    return dents
