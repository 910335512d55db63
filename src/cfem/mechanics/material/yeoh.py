"""Yeoh's law of nearly incompressible rubber, a cubic in the first isochoric invariant I1bar = J^(-2/3) I1; J > 0 only.

    psi = c1 (I1bar - 3) + c2 (I1bar - 3)^2 + c3 (I1bar - 3)^3 + kappa/2 (J - 1)^2

with mu = 2 c1 and kappa = lambda + 2 mu/3, split into theta = J - 1 with bulk = lambda, and a rest that holds
mu/3 (J - 1)^2 (why: law.py). The shape numbers are c2/c1 and c3/c1. Yeoh, Some forms of the strain energy function for
rubber, Rubber Chem. Technol. 66, 1993."""

import math

import numpy as np
from numba import njit

from cfem.mechanics.material.isochoric import first_invariant
from cfem.mechanics.material.law import Law, lame
from cfem.mechanics.material.tensor import add_identity, inverse


def parameters(young: float, poisson: float, shape: tuple[float, ...]) -> tuple[np.ndarray, float]:
    """Parameters ([c1, c2, c3], lambda) in MPa."""
    if len(shape) != 2:
        raise ValueError(f"yeoh has two shape numbers, c2/c1 and c3/c1; got {len(shape)}")
    lam, mu = lame(young, poisson)
    return 0.5 * mu * np.array([1.0, shape[0], shape[1]]), lam


@njit(cache=True, error_model="numpy")
def response(D, parameters, psi, theta, P, g):
    """Fills psi_rest, theta, P_rest and g as `Law.response` states them, NaN where det F <= 0."""
    c1, c2, c3 = parameters[0], parameters[1], parameters[2]
    volumetric = 4.0 / 3.0 * c1  # 2 mu / 3
    M, cof_D = np.empty((3, 3)), np.empty((3, 3))
    for k in range(D.shape[0]):
        change, mean, _, _, e1 = first_invariant(D[k], cof_D, M, g[k])
        J = 1.0 + change
        if not J > 0.0:
            psi[k], theta[k], P[k], g[k] = np.nan, np.nan, np.nan, np.nan
            continue
        e = 3.0 * e1
        psi[k] = e * (c1 + e * (c2 + e * c3)) + 0.5 * volumetric * change * change
        theta[k] = change
        # P = F^-T T + ..., with T = 2 dev(C d psi / dC) = 2 (d psi / d I1bar) J^(-2/3) M
        factor = 2.0 * (c1 + e * (2.0 * c2 + 3.0 * c3 * e)) * (1.0 + e1) / (1.0 + mean) / J
        for i in range(3):
            for j in range(3):
                P[k, i, j] = factor * (g[k, i, 0] * M[0, j] + g[k, i, 1] * M[1, j] + g[k, i, 2] * M[2, j])
                P[k, i, j] += volumetric * change * g[k, i, j]


@njit(cache=True, error_model="numpy")
def curvature(D, parameters, pressure, C):
    """Fills C as `Law.curvature` states it, NaN where det F <= 0."""
    c1, c2, c3 = parameters[0], parameters[1], parameters[2]
    volumetric = 4.0 / 3.0 * c1
    F, X, S = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    M, cof_D, g = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for k in range(D.shape[0]):
        e = 3.0 * first_invariant(D[k], cof_D, M, g)[4]
        add_identity(D[k], F)
        J = inverse(F, X)
        if not J > 0.0:
            C[k] = np.nan
            continue
        I1 = 0.0
        for i in range(3):
            for j in range(3):
                I1 += F[i, j] * F[i, j]
        # I1bar = J^(-2/3) I1 by the product rule, with G = F^-T, d J = J G:dF and d G = -G dF^T G
        a = math.exp(-2.0 / 3.0 * math.log(J))
        first, second = c1 + e * (2.0 * c2 + 3.0 * c3 * e), 2.0 * c2 + 6.0 * c3 * e
        slope = J * (pressure[k] + volumetric * (J - 1.0))
        outer = 4.0 / 9.0 * a * I1 * first + slope + volumetric * J * J
        crossed = 2.0 / 3.0 * a * I1 * first - slope
        for i in range(3):
            for j in range(3):
                S[i, j] = 2.0 * a * (F[i, j] - I1 / 3.0 * X[j, i])  # d I1bar / dF
        for i in range(3):
            for m in range(3):
                for j in range(3):
                    for n in range(3):
                        mixed = F[i, j] * X[n, m] + X[j, i] * F[m, n]
                        value = outer * X[j, i] * X[n, m] - 4.0 / 3.0 * a * first * mixed
                        value += crossed * X[n, i] * X[j, m] + second * S[i, j] * S[m, n]
                        if i == m and j == n:
                            value += 2.0 * a * first
                        C[k, 3 * i + j, 3 * m + n] = value


LAW = Law("yeoh", parameters, response, curvature, shape=(0.1, 0.01))
