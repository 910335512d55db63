"""Loops over the quadrature points of solid elements, compiled: what `cfem.mechanics.solid` adds up."""

import numpy as np
from numba import njit


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


@njit(cache=True)
def add_form(C, g, bulk, mixed, gradients, weights, cells, motions, form):
    """Adds to form (k, k) the work M^T A M of motions (n, 3, k), strain by strain."""
    m, q = weights.shape
    n, count = cells.shape[1], motions.shape[2]
    M, CM = np.empty((9, count)), np.empty((9, count))
    theta, theta_sum = np.empty(count), np.empty(count)
    for e in range(m):
        theta_sum[:] = 0.0
        volume = 0.0
        for point in range(q):
            k = e * q + point
            w = weights[e, point]
            volume += w
            M[:] = 0.0
            for a in range(n):
                node = cells[e, a]
                for i in range(3):
                    for j in range(3):
                        dN = gradients[e, point, a, j]
                        for c in range(count):
                            M[3 * i + j, c] += motions[node, i, c] * dN
            theta[:] = 0.0
            for row in range(9):
                CM[row] = 0.0
                for column in range(9):
                    for c in range(count):
                        CM[row, c] += C[k, row, column] * M[column, c]
                for c in range(count):
                    theta[c] += g[k, row // 3, row % 3] * M[row, c]
            for b in range(count):
                theta_sum[b] += w * theta[b]
                for c in range(count):
                    work = 0.0
                    for row in range(9):
                        work += M[row, b] * CM[row, c]
                    form[b, c] += w * work
                    if not mixed:
                        form[b, c] += w * bulk * theta[b] * theta[c]
        if mixed:
            for b in range(count):
                for c in range(count):
                    form[b, c] += bulk / volume * theta_sum[b] * theta_sum[c]


@njit(cache=True)
def add_form_of_few(C, g, bulk, mixed, gradients, weights, cells, motions, form):
    """Adds the same form as `add_form`, with loops that suit few motions."""
    m, q = weights.shape
    n, count = cells.shape[1], motions.shape[2]
    M, CM = np.empty((count, 9)), np.empty((9, count))
    moved = np.empty((count, n, 3))
    theta, theta_sum = np.empty(count), np.empty(count)
    for e in range(m):
        theta_sum[:] = 0.0
        volume = 0.0
        for a in range(n):
            for i in range(3):
                for c in range(count):
                    moved[c, a, i] = motions[cells[e, a], i, c]
        for point in range(q):
            k = e * q + point
            w = weights[e, point]
            volume += w
            for c in range(count):
                for i in range(3):
                    x, y, z = 0.0, 0.0, 0.0
                    for a in range(n):
                        u = moved[c, a, i]
                        x += u * gradients[e, point, a, 0]
                        y += u * gradients[e, point, a, 1]
                        z += u * gradients[e, point, a, 2]
                    M[c, 3 * i], M[c, 3 * i + 1], M[c, 3 * i + 2] = x, y, z
                total = 0.0
                for row in range(9):
                    work = 0.0
                    for column in range(9):
                        work += C[k, row, column] * M[c, column]
                    CM[row, c] = work
                    total += g[k, row // 3, row % 3] * M[c, row]
                theta[c] = total
                theta_sum[c] += w * total
            for b in range(count):
                for row in range(9):
                    share = w * M[b, row]
                    for c in range(count):
                        form[b, c] += share * CM[row, c]
                if not mixed:
                    for c in range(count):
                        form[b, c] += w * bulk * theta[b] * theta[c]
        if mixed:
            for b in range(count):
                for c in range(count):
                    form[b, c] += bulk / volume * theta_sum[b] * theta_sum[c]
