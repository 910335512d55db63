"""Compressible neo-Hookean law with logarithms, which resist compression to nothing; for J > 0 only.

    psi = mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)^2

so theta = ln J, bulk = lambda, g = F^-T. Bonet and Wood, Nonlinear Continuum Mechanics for Finite Element Analysis,
2nd ed., section 6.4."""

import math

import numpy as np
from numba import njit

from cfem.mechanics.material.law import Law, shear_and_bulk
from cfem.mechanics.material.scalar import expm1_less
from cfem.mechanics.material.tensor import add_identity, cofactor_change, inverse, volume_change


@njit(cache=True, error_model="numpy")
def response(D, parameters, psi, theta, P, g):
    """Fills psi_rest, theta, P_rest and g as `Law.response` states them, NaN where det F <= 0."""
    shear = parameters[0]
    cof_D = np.empty((3, 3))
    for k in range(D.shape[0]):
        trace, higher = volume_change(D[k], cof_D)
        change = trace + higher
        J = 1.0 + change
        if not J > 0.0:
            psi[k], theta[k], P[k], g[k] = np.nan, np.nan, np.nan, np.nan
            continue
        square = 0.0
        for i in range(3):
            for j in range(3):
                F = D[k, i, j] + (1.0 if i == j else 0.0)
                square += D[k, i, j] * D[k, i, j]
                cof_less_1 = cofactor_change(D[k], cof_D, trace, i, j)
                # F - F^-T = (J F - cof F) / J
                P[k, i, j] = shear * (change * F + D[k, i, j] - cof_less_1) / J
                g[k, i, j] = (cof_less_1 + (1.0 if i == j else 0.0)) / J
        theta[k] = math.log1p(change)
        psi[k] = shear * (0.5 * square - higher + expm1_less(theta[k]))  # expm1_less: J - 1 - ln J


@njit(cache=True, error_model="numpy")
def curvature(D, parameters, pressure, C):
    """Fills C as `Law.curvature` states it, NaN where det F <= 0."""
    shear = parameters[0]
    F, G = np.empty((3, 3)), np.empty((3, 3))
    for k in range(D.shape[0]):
        add_identity(D[k], F)
        if not inverse(F, G) > 0.0:
            C[k] = np.nan
            continue
        factor = shear - pressure[k]
        for i in range(3):
            for j in range(3):
                for a in range(3):
                    for b in range(3):
                        C[k, 3 * i + j, 3 * a + b] = factor * G[b, i] * G[j, a]
                C[k, 3 * i + j, 3 * i + j] += shear


LAW = Law("neo-hookean-log", shear_and_bulk, response, curvature)
