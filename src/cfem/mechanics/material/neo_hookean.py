"""Polynomial compressible neo-Hookean law: no logarithm, defined for J <= 0, linearises to Hooke's law.

    psi = mu/2 (I1 - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)^2

split into theta = J - 1 with bulk = lambda, and a rest that holds mu/2 (J - 1)^2: without it the rest would soften
under dilatation, and an element whose theta is averaged would be unstable. Bonet and Wood, Nonlinear Continuum
Mechanics for Finite Element Analysis, 2nd ed., section 6.4, with (J - 1) - (J - 1)^2 / 2 instead of ln J. With
D = F - 1 all terms are formed from D, so that small strains keep their digits: I1 - 3 = 2 tr D + |D|^2 and
J - 1 = tr D + tr cof D + det D."""

import numpy as np
from numba import njit

from cfem.mechanics.material.law import Law, shear_and_bulk
from cfem.mechanics.material.tensor import add_identity, cofactor, cofactor_change, volume_change


@njit(cache=True)
def response(D, parameters, psi, theta, P, g):
    """Fills psi_rest, theta, P_rest and g as `Law.response` states them."""
    shear = parameters[0]
    cof_D = np.empty((3, 3))
    for k in range(D.shape[0]):
        trace, higher = volume_change(D[k], cof_D)
        change = trace + higher
        square = 0.0
        for i in range(3):
            for j in range(3):
                square += D[k, i, j] * D[k, i, j]
                cof_less_1 = cofactor_change(D[k], cof_D, trace, i, j)
                g[k, i, j] = cof_less_1 + (1.0 if i == j else 0.0)
                P[k, i, j] = shear * (D[k, i, j] - cof_less_1 + change * g[k, i, j])
        theta[k] = change
        psi[k] = shear * (0.5 * (square + change * change) - higher)


@njit(cache=True)
def curvature(D, parameters, pressure, C):
    """Fills C as `Law.curvature` states it."""
    shear = parameters[0]
    F, cof = np.empty((3, 3)), np.empty((3, 3))
    for k in range(D.shape[0]):
        add_identity(D[k], F)
        cofactor(F, cof)
        theta = F[0, 0] * cof[0, 0] + F[0, 1] * cof[0, 1] + F[0, 2] * cof[0, 2] - 1.0
        factor = pressure[k] + shear * (theta - 1.0)
        for i in range(3):
            i1, i2 = (i + 1) % 3, (i + 2) % 3
            for j in range(3):
                j1, j2 = (j + 1) % 3, (j + 2) % 3
                row = 3 * i + j
                for a in range(3):
                    for b in range(3):
                        C[k, row, 3 * a + b] = shear * cof[i, j] * cof[a, b]
                C[k, row, row] += shear
                # second derivative of det F
                C[k, row, 3 * i1 + j1] += factor * F[i2, j2]
                C[k, row, 3 * i2 + j2] += factor * F[i1, j1]
                C[k, row, 3 * i1 + j2] -= factor * F[i2, j1]
                C[k, row, 3 * i2 + j1] -= factor * F[i1, j2]


LAW = Law("neo-hookean", shear_and_bulk, response, curvature)
