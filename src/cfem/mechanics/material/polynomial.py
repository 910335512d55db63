"""Nearly incompressible rubber by a polynomial of the isochoric invariants I1bar = J^(-2/3) I1 and I2bar = J^(-4/3) I2,
compiled; for J > 0 only.

    psi = c1 (I1bar - 3) + c2 (I1bar - 3)^2 + c3 (I1bar - 3)^3 + c01 (I2bar - 3) + kappa/2 (J - 1)^2

with mu = 2 (c1 + c01) and kappa = lambda + 2 mu/3, split into theta = J - 1 with bulk = lambda, and a rest that holds
mu/3 (J - 1)^2 (why: law.py). The parameters are [c1, c2, c3, c01]. Holzapfel, Nonlinear Solid Mechanics, 2000, section
6.5.

The displacement gradient keeps the digits of small strains: with 2 E = m 1 + M, tr M = 0, I1 = 3 (1 + m),
I2 = 3 (1 + m)^2 - |M|^2/2 and J^2 = (1 + m)^3 (1 + x), x = y + det M / (1 + m)^3, y = -|M|^2/2 / (1 + m)^2."""

import math

import numpy as np
from numba import njit

from cfem.mechanics.material.tensor import add_identity, cofactor_change, double_strain, inverse, volume_change


@njit(cache=True, error_model="numpy")
def response(D, parameters, psi, theta, P, g):
    """Fills psi_rest, theta, P_rest and g as `Law.response` states them, NaN where det F <= 0."""
    c1, c2, c3, c01 = parameters[0], parameters[1], parameters[2], parameters[3]
    volumetric = 4.0 / 3.0 * (c1 + c01)  # 2 mu / 3
    M, T = np.empty((3, 3)), np.empty((3, 3))  # T serves for cof D first
    for k in range(D.shape[0]):
        change, mean, square, y, e1 = _first_invariant(D[k], T, M, g[k])
        J = 1.0 + change
        if not J > 0.0:
            psi[k], theta[k], P[k], g[k] = np.nan, np.nan, np.nan, np.nan
            continue
        scale, r1, e = 1.0 + mean, 1.0 + e1, 3.0 * e1
        psi[k] = (
            e * (c1 + e * (c2 + e * c3)) + c01 * (e * (1.0 + r1) + r1 * r1 * y) + 0.5 * volumetric * change * change
        )
        theta[k] = change
        # P = F^-T T + ..., with T = 2 dev(C d psi / dC)
        t1 = 2.0 * (c1 + e * (2.0 * c2 + 3.0 * c3 * e)) * r1 / scale + 2.0 * c01 * r1 * r1 / scale
        t2 = -2.0 * c01 * (r1 / scale) ** 2
        for i in range(3):
            for j in range(i, 3):
                T[i, j] = t1 * M[i, j] + t2 * (M[i, 0] * M[0, j] + M[i, 1] * M[1, j] + M[i, 2] * M[2, j])
                T[j, i] = T[i, j]
            T[i, i] -= t2 * square / 3.0
        for i in range(3):
            for j in range(3):
                P[k, i, j] = (g[k, i, 0] * T[0, j] + g[k, i, 1] * T[1, j] + g[k, i, 2] * T[2, j]) / J
                P[k, i, j] += volumetric * change * g[k, i, j]


@njit(cache=True, error_model="numpy")
def curvature(D, parameters, pressure, C):
    """Fills C as `Law.curvature` states it, NaN where det F <= 0."""
    c1, c2, c3, c01 = parameters[0], parameters[1], parameters[2], parameters[3]
    volumetric = 4.0 / 3.0 * (c1 + c01)
    F, G, X, right, left = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for k in range(D.shape[0]):
        add_identity(D[k], F)
        J = inverse(F, X)
        if not J > 0.0:
            C[k] = np.nan
            continue
        for i in range(3):
            for j in range(3):
                G[i, j] = X[j, i]
                right[i, j] = F[0, i] * F[0, j] + F[1, i] * F[1, j] + F[2, i] * F[2, j]
                left[i, j] = F[i, 0] * F[j, 0] + F[i, 1] * F[j, 1] + F[i, 2] * F[j, 2]
        I1 = right[0, 0] + right[1, 1] + right[2, 2]
        I2 = right[0, 0] * right[1, 1] + right[1, 1] * right[2, 2] + right[2, 2] * right[0, 0]
        I2 -= right[0, 1] ** 2 + right[1, 2] ** 2 + right[2, 0] ** 2
        a = math.exp(-2.0 / 3.0 * math.log(J))
        e = a * I1 - 3.0
        p1, p2 = 2.0 * (c1 + e * (2.0 * c2 + 3.0 * c3 * e)) * a, 2.0 * c01 * a * a
        second = 4.0 * a * a * (2.0 * c2 + 6.0 * c3 * e)
        # J^(-2/3) I1 and J^(-4/3) I2 by the product rule, with d J = J G:dF, d2 I1 = 2 |dF|^2 and
        # d2 I2 = 2 (I1 |dF|^2 + 2 (F:dF)^2 - dF C:dF - F dF^T F:dF - F F^T dF:dF), d I2 = 2 (I1 F - F C):dF, and with
        # second (d I1bar)^2 of d I1bar = 2 a (F - I1/3 G):dF
        slope = J * (pressure[k] + volumetric * (J - 1.0))
        outer = 2.0 / 9.0 * p1 * I1 + 8.0 / 9.0 * p2 * I2 + second * I1 * I1 / 9.0 + slope + volumetric * J * J
        crossed = p1 * I1 / 3.0 + 2.0 / 3.0 * p2 * I2 - slope
        both, mixed, twice = p1 + p2 * I1, 2.0 / 3.0 * p1 + second * I1 / 3.0, 2.0 * p2 + second
        for i in range(3):
            for j in range(3):
                FC = F[i, 0] * right[0, j] + F[i, 1] * right[1, j] + F[i, 2] * right[2, j]
                X[i, j] = 0.5 * outer * G[i, j] - mixed * F[i, j] - 4.0 / 3.0 * p2 * (I1 * F[i, j] - FC)
        for i in range(3):
            for m in range(3):
                for j in range(3):
                    for n in range(3):
                        value = X[i, j] * G[m, n] + G[i, j] * X[m, n] + crossed * G[i, n] * G[m, j]
                        value += twice * F[i, j] * F[m, n] - p2 * F[i, n] * F[m, j]
                        if i == m:
                            value -= p2 * right[j, n]
                        if j == n:
                            value -= p2 * left[i, m]
                        if i == m and j == n:
                            value += both
                        C[k, 3 * i + j, 3 * m + n] = value


@njit(cache=True, error_model="numpy")
def _first_invariant(D, cof_D, M, g):
    """Invariants (J - 1, m, |M|^2, y, I1bar / 3 - 1); fills cof D, M and g = cof F, all (3, 3). Where J <= 0 the first
    alone means anything."""
    trace, higher = volume_change(D, cof_D)
    change = trace + higher
    if not 1.0 + change > 0.0:
        return change, 0.0, 0.0, 0.0, 0.0
    double_strain(D, M)
    mean = (M[0, 0] + M[1, 1] + M[2, 2]) / 3.0
    square = 0.0
    for i in range(3):
        M[i, i] -= mean
        for j in range(3):
            g[i, j] = cofactor_change(D, cof_D, trace, i, j) + (1.0 if i == j else 0.0)
            square += M[i, j] * M[i, j]
    det = (
        M[0, 0] * (M[1, 1] * M[2, 2] - M[1, 2] * M[1, 2])
        - M[0, 1] * (M[0, 1] * M[2, 2] - M[1, 2] * M[0, 2])
        + M[0, 2] * (M[0, 1] * M[1, 2] - M[1, 1] * M[0, 2])
    )
    scale = 1.0 + mean
    y = -0.5 * square / scale**2
    x = y + det / scale**3
    log = math.log1p(x) if x > -0.5 else 2.0 * math.log1p(change) - 3.0 * math.log1p(mean)
    return change, mean, square, y, math.expm1(-log / 3.0)
