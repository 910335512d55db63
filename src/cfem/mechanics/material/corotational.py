"""Corotational linear elasticity by polar decomposition F = R S: large rotation, small strain, with its exact tangent.

    psi = mu |F - R|^2 + lambda/2 (tr S - 3)^2

so theta = tr S - 3, bulk = lambda, g = R. McAdams et al., Efficient elasticity for character skinning, 2011, eqs 1-3;
dR = R Omega with (tr S 1 - S) omega = axial(R^T dF - dF^T R)."""

import numpy as np
from numba import njit

from cfem.mechanics.material.law import Law, shear_and_bulk
from cfem.mechanics.material.tensor import inverse, rotation


@njit(cache=True)
def response(D, parameters, psi, theta, P, g):
    """Fills psi_rest, theta, P_rest and g = R as `Law.response` states them."""
    shear = parameters[0]
    for k in range(D.shape[0]):
        R = g[k]
        rotation(D[k], R)
        square, trace = 0.0, 0.0
        for i in range(3):
            for j in range(3):
                delta = D[k, i, j] - (R[i, j] - (1.0 if i == j else 0.0))
                P[k, i, j] = 2.0 * shear * delta
                square += delta * delta
                trace += R[i, j] * delta
        psi[k] = shear * square
        theta[k] = trace  # R : (F - R) = tr S - 3


@njit(cache=True)
def curvature(D, parameters, pressure, C):
    """Fills C as `Law.curvature` states it: 2 mu (1 - d R / dF) and the turn of theta's gradient R."""
    shear = parameters[0]
    R, S, G, G_inverse = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    axial, omega = np.empty(3), np.empty(3)
    for k in range(D.shape[0]):
        rotation(D[k], R)
        for i in range(3):
            for j in range(3):
                S[i, j] = R[0, i] * D[k, 0, j] + R[1, i] * D[k, 1, j] + R[2, i] * D[k, 2, j] + R[j, i]
        trace = S[0, 0] + S[1, 1] + S[2, 2]
        for i in range(3):
            for j in range(3):
                G[i, j] = (trace if i == j else 0.0) - 0.5 * (S[i, j] + S[j, i])
        inverse(G, G_inverse)
        factor = pressure[k] - 2.0 * shear
        for a in range(3):
            for b in range(3):
                # R^T dF for dF = e_a e_b^T has the entries R[a, p] at (p, b); its axial part, then omega, then R Omega
                axial[:] = 0.0
                b1, b2 = (b + 1) % 3, (b + 2) % 3
                axial[b2] = R[a, b1]
                axial[b1] = -R[a, b2]
                for p in range(3):
                    omega[p] = G_inverse[p, 0] * axial[0] + G_inverse[p, 1] * axial[1] + G_inverse[p, 2] * axial[2]
                for i in range(3):
                    # row i of R Omega with Omega v = omega x v
                    C[k, 3 * i, 3 * a + b] = factor * (R[i, 1] * omega[2] - R[i, 2] * omega[1])
                    C[k, 3 * i + 1, 3 * a + b] = factor * (R[i, 2] * omega[0] - R[i, 0] * omega[2])
                    C[k, 3 * i + 2, 3 * a + b] = factor * (R[i, 0] * omega[1] - R[i, 1] * omega[0])
                C[k, 3 * a + b, 3 * a + b] += 2.0 * shear


LAW = Law("corotational", shear_and_bulk, response, curvature)
