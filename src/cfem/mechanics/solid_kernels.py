"""Sums over the quadrature points of solid elements, most of them compiled: what `cfem.mechanics.solid` adds up."""

import numpy as np
from numba import njit

AT_ONCE = 2**17  # strains and gradients of `strain_form`: as many as stay in a processor's cache


@njit(cache=True)
def smallest_J(D):
    """Smallest det F of the points, NaN where any is."""
    min_J = np.inf
    for k in range(len(D)):
        d = D[k]
        f00, f11, f22 = 1.0 + d[0, 0], 1.0 + d[1, 1], 1.0 + d[2, 2]
        J = (
            f00 * (f11 * f22 - d[1, 2] * d[2, 1])
            - d[0, 1] * (d[1, 0] * f22 - d[1, 2] * d[2, 0])
            + d[0, 2] * (d[1, 0] * d[2, 1] - f11 * d[2, 0])
        )
        if not (min_J <= J):  # a NaN ends up in min_J, where it is seen
            min_J = J
    return min_J


@njit(cache=True)
def displacement_gradients(u, cells, gradients):
    """D = F - 1 at every quadrature point, (m q, 3, 3), without bubbles."""
    m, q = gradients.shape[:2]
    n = cells.shape[1]
    D = np.zeros((m * q, 3, 3))
    for e in range(m):
        for point in range(q):
            d = D[e * q + point]
            for a in range(n):
                node = cells[e, a]
                for i in range(3):
                    for j in range(3):
                        d[i, j] += u[node, i] * gradients[e, point, a, j]
    return D


@njit(cache=True)
def scatter_force(P, g, pressure, gradients, weights, cells, force):
    """Adds to force (n, 3) the nodal forces of the stress P + pressure g (m q, 3, 3)."""
    m, q = weights.shape
    n = cells.shape[1]
    S = np.empty((3, 3))
    for e in range(m):
        for point in range(q):
            k = e * q + point
            for i in range(3):
                for j in range(3):
                    S[i, j] = (P[k, i, j] + pressure[k] * g[k, i, j]) * weights[e, point]
            for a in range(n):
                node = cells[e, a]
                for i in range(3):
                    force[node, i] += (
                        S[i, 0] * gradients[e, point, a, 0]
                        + S[i, 1] * gradients[e, point, a, 1]
                        + S[i, 2] * gradients[e, point, a, 2]
                    )


@njit(cache=True)
def add_bubbles(alpha, gradients, D):
    """Adds to D what amplitudes alpha (m, bubbles, 3) of the last shape functions make of it."""
    m, q, n, _ = gradients.shape
    count = alpha.shape[1]
    for e in range(m):
        for point in range(q):
            d = D[e * q + point]
            for b in range(count):
                dN = gradients[e, point, n - count + b]
                for i in range(3):
                    for j in range(3):
                        d[i, j] += alpha[e, b, i] * dN[j]


@njit(cache=True)
def bubble_forces(P, g, pressure, gradients, weights, forces, work):
    """Adds the forces (m, bubbles, 3) on the last shape functions, and to work (m,) their |stress| times volume."""
    m, q, n, _ = gradients.shape
    count = forces.shape[1]
    S = np.empty((3, 3))
    for e in range(m):
        for point in range(q):
            k = e * q + point
            for i in range(3):
                for j in range(3):
                    S[i, j] = (P[k, i, j] + pressure[k] * g[k, i, j]) * weights[e, point]
                    work[e] += abs(S[i, j])
            for b in range(count):
                dN = gradients[e, point, n - count + b]
                for i in range(3):
                    forces[e, b, i] += S[i, 0] * dN[0] + S[i, 1] * dN[1] + S[i, 2] * dN[2]


@njit(cache=True)
def element_stiffness(C, g, bulk, gradients, weights, first, K):
    """Adds to K (m, 3 k, 3 k) the stiffness of the k shape functions from `first` on."""
    m, q, n, _ = gradients.shape
    A, T = np.empty((9, 9)), np.empty((9, 3))
    for e in range(m):
        for point in range(q):
            k = e * q + point
            w = weights[e, point]
            for row in range(9):
                for column in range(9):
                    both = g[k, row // 3, row % 3] * g[k, column // 3, column % 3]
                    A[row, column] = w * (C[k, row, column] + bulk * both)
            for b in range(first, n):
                dN = gradients[e, point, b]
                for row in range(9):
                    for j in range(3):
                        c = 3 * j
                        T[row, j] = A[row, c] * dN[0] + A[row, c + 1] * dN[1] + A[row, c + 2] * dN[2]
                for a in range(first, n):
                    dN = gradients[e, point, a]
                    for i in range(3):
                        r, place = 3 * i, 3 * (a - first) + i
                        for j in range(3):
                            K[e, place, 3 * (b - first) + j] += (
                                dN[0] * T[r, j] + dN[1] * T[r + 1, j] + dN[2] * T[r + 2, j]
                            )


@njit(cache=True)
def scatter_pressure(dtheta, pressure, cells, force):
    for e in range(dtheta.shape[0]):
        for a in range(dtheta.shape[1]):
            node = cells[e, a]
            for i in range(3):
                force[node, i] += pressure[e] * dtheta[e, a, i]


@njit(cache=True)
def scatter_stiffness(C, g, bulk, mixed, gradients, weights, slots, data, dtheta):
    """Adds the element stiffness dN (C + bulk g g^T) dN, lower triangle, to `data` at its slots. mixed: bulk acts on
    the mean of theta, whose gradient dtheta (m, n, 3) it fills."""
    m, q, n, _ = gradients.shape
    K = np.empty((n, n, 3, 3))
    T = np.empty((9, 3))
    theta_a = np.empty((n, 3))
    for e in range(m):
        K[:] = 0.0
        volume = 0.0
        for point in range(q):
            k = e * q + point
            w = weights[e, point]
            volume += w
            dN = gradients[e, point]
            for a in range(n):
                for i in range(3):
                    theta_a[a, i] = g[k, i, 0] * dN[a, 0] + g[k, i, 1] * dN[a, 1] + g[k, i, 2] * dN[a, 2]
                    if mixed:
                        dtheta[e, a, i] += w * theta_a[a, i]
            for b in range(n):
                for row in range(9):
                    for i in range(3):
                        c = 3 * i
                        T[row, i] = w * (
                            C[k, row, c] * dN[b, 0] + C[k, row, c + 1] * dN[b, 1] + C[k, row, c + 2] * dN[b, 2]
                        )
                for a in range(b, n):
                    for i in range(3):
                        for j in range(3):
                            r = 3 * i
                            K[a, b, i, j] += dN[a, 0] * T[r, j] + dN[a, 1] * T[r + 1, j] + dN[a, 2] * T[r + 2, j]
                    if not mixed:
                        for i in range(3):
                            for j in range(3):
                                K[a, b, i, j] += w * bulk * theta_a[a, i] * theta_a[b, j]
        for b in range(n):
            for a in range(b, n):
                if mixed:
                    for i in range(3):
                        for j in range(3):
                            K[a, b, i, j] += bulk / volume * dtheta[e, a, i] * dtheta[e, b, j]
                if slots[e, a, b, 0] >= 0:
                    for j in range(3):
                        for i in range(j if a == b else 0, 3):
                            data[slots[e, a, b, j] + i] += K[a, b, i, j]
                elif slots[e, b, a, 0] >= 0:
                    for i in range(3):
                        for j in range(3):
                            data[slots[e, b, a, i] + j] += K[a, b, i, j]


def strain_form(
    C: np.ndarray,
    g: np.ndarray,
    bulk: float,
    mixed: bool,
    gradients: np.ndarray,
    weights: np.ndarray,
    cells: np.ndarray,
    motions: np.ndarray,
) -> np.ndarray:
    """Form M^T A M (k, k) of motions (n, 3, k) in the stiffness A that `scatter_stiffness` adds, from strains; by
    matrix products, which are faster than loops from three motions on."""
    q, n, k = *gradients.shape[1:3], motions.shape[2]
    form, flat, count = np.zeros((k, k)), motions.reshape(len(motions), -1), 1 + AT_ONCE // (q * (9 * k + 3 * n))
    for first in range(0, len(cells), count):
        some, points = slice(first, first + count), slice(first * q, (first + count) * q)
        w, dN = weights[some], gradients[some].swapaxes(2, 3).reshape(-1, 3 * q, n)
        by_axis = (dN @ flat[cells[some]]).reshape(-1, 3, 3, k)  # of each point: by X_j, of u_i
        strains = by_axis.swapaxes(1, 2).reshape(-1, 9, k)
        stresses = C[points] @ strains
        stresses *= w.reshape(-1, 1, 1)
        form += strains.reshape(-1, k).T @ stresses.reshape(-1, k)
        theta = (g[points].reshape(-1, 1, 9) @ strains).reshape(-1, q, k)
        if mixed:  # bulk acts on the mean of theta
            theta, w = np.einsum("eq,eqk->ek", w, theta) / w.sum(axis=1)[:, None], w.sum(axis=1)
        theta = theta.reshape(-1, k)
        form += theta.T @ (theta * (bulk * w.reshape(-1, 1)))
    return form
