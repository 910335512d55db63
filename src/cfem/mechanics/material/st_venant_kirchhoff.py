"""St Venant-Kirchhoff law, Hooke's in the Green strain E = (F^T F - 1)/2: large rotation, moderate strain.

    psi = mu |E|^2 + lambda/2 (tr E)^2

so theta = tr E, bulk = lambda, g = F. Under compression it softens, and gives no resistance at all at a stretch of zero
(its uniaxial force has its least value at the stretch 1/sqrt(3)). Bonet and Wood, Nonlinear Continuum Mechanics for
Finite Element Analysis, 2nd ed., chapter 6."""

import numpy as np
from numba import njit

from cfem.mechanics.material.law import Law, shear_and_bulk
from cfem.mechanics.material.tensor import add_identity, double_strain


@njit(cache=True)
def response(D, parameters, psi, theta, P, g):
    """Fills psi_rest, theta = tr E, P_rest = F S and g = F as `Law.response` states them."""
    shear = parameters[0]
    M = np.empty((3, 3))  # 2 E
    for k in range(D.shape[0]):
        double_strain(D[k], M)
        add_identity(D[k], g[k])
        square = 0.0
        for i in range(3):
            for j in range(3):
                square += M[i, j] * M[i, j]
                P[k, i, j] = shear * (g[k, i, 0] * M[0, j] + g[k, i, 1] * M[1, j] + g[k, i, 2] * M[2, j])
        psi[k] = 0.25 * shear * square
        theta[k] = 0.5 * (M[0, 0] + M[1, 1] + M[2, 2])


@njit(cache=True)
def curvature(D, parameters, pressure, C):
    """Fills C as `Law.curvature` states it."""
    shear = parameters[0]
    M, F = np.empty((3, 3)), np.empty((3, 3))
    for k in range(D.shape[0]):
        double_strain(D[k], M)
        add_identity(D[k], F)
        for i in range(3):
            for a in range(3):
                left = shear * (F[i, 0] * F[a, 0] + F[i, 1] * F[a, 1] + F[i, 2] * F[a, 2])
                if i == a:
                    left += pressure[k]
                for j in range(3):
                    for b in range(3):
                        value = shear * F[i, b] * F[a, j]
                        if j == b:
                            value += left
                        if i == a:
                            value += shear * M[b, j]
                        C[k, 3 * i + j, 3 * a + b] = value


LAW = Law("st-venant-kirchhoff", shear_and_bulk, response, curvature)
