"""Polynomial compressible neo-Hookean law: no logarithm, defined for J <= 0, linearises to Hooke's law.

    psi = mu/2 (I1 - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)^2

split into theta = J - 1 with bulk = lambda, and a rest that holds mu/2 (J - 1)^2: without it the rest would soften
under dilatation, and an element whose theta is averaged would be unstable. Bonet and Wood, Nonlinear Continuum
Mechanics for Finite Element Analysis, 2nd ed., section 6.4, with (J - 1) - (J - 1)^2 / 2 in the place of ln J. With
D = F - 1 all terms are formed from D, so that small strains keep their digits: I1 - 3 = 2 tr D + |D|^2 and
J - 1 = tr D + tr cof D + det D."""

import numpy as np
from numba import njit

from cfem.mechanics.material.law import Law, lame


def moduli(young: float, poisson: float) -> tuple[float, float]:
    lam, mu = lame(young, poisson)
    return mu, lam


@njit(cache=True)
def _cofactor(F: np.ndarray, cof: np.ndarray) -> None:
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            cof[i, j] = F[i1, j1] * F[i2, j2] - F[i1, j2] * F[i2, j1]


@njit(cache=True)
def response(D, shear, psi, theta, P, g):
    cof_D = np.empty((3, 3))
    for k in range(D.shape[0]):
        d = D[k]
        _cofactor(d, cof_D)
        trace = d[0, 0] + d[1, 1] + d[2, 2]
        det_D = d[0, 0] * cof_D[0, 0] + d[0, 1] * cof_D[0, 1] + d[0, 2] * cof_D[0, 2]
        theta[k] = trace + cof_D[0, 0] + cof_D[1, 1] + cof_D[2, 2] + det_D
        square = 0.0
        for i in range(3):
            for j in range(3):
                square += d[i, j] * d[i, j]
                # cof(1 + D) = (1 + tr D) 1 - D^T + cof D
                cof_less_1 = cof_D[i, j] - d[j, i] + (trace if i == j else 0.0)
                g[k, i, j] = cof_less_1 + (1.0 if i == j else 0.0)
                P[k, i, j] = shear * (d[i, j] - cof_less_1 + theta[k] * g[k, i, j])
        psi[k] = shear * (trace + 0.5 * square - theta[k] + 0.5 * theta[k] ** 2)


@njit(cache=True)
def curvature(D, shear, pressure, C):
    F, cof = np.empty((3, 3)), np.empty((3, 3))
    for k in range(D.shape[0]):
        for i in range(3):
            for j in range(3):
                F[i, j] = D[k, i, j] + (1.0 if i == j else 0.0)
        _cofactor(F, cof)
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


LAW = Law("neo-hookean", moduli, response, curvature)
