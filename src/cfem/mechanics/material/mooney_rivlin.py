"""Mooney-Rivlin law of nearly incompressible rubber, in the isochoric invariants I1bar = J^(-2/3) I1 and
I2bar = J^(-4/3) I2; for J > 0 only.

    psi = c10 (I1bar - 3) + c01 (I2bar - 3) + kappa/2 (J - 1)^2        mu = 2 (c10 + c01), kappa = lambda + 2 mu/3

split into theta = J - 1 with bulk = lambda, and a rest that holds mu/3 (J - 1)^2 (why: law.py). Its one shape number is
the share of c01 in c10 + c01. Holzapfel, Nonlinear Solid Mechanics, 2000, section 6.5. isochoric.py says
how small strains keep their digits."""

import math

import numpy as np
from numba import njit

from cfem.mechanics.material.isochoric import first_invariant
from cfem.mechanics.material.law import Law, lame
from cfem.mechanics.material.tensor import add_identity, inverse


def parameters(young: float, poisson: float, shape: tuple[float, ...]) -> tuple[np.ndarray, float]:
    """Parameters ([c10, c01], lambda) in MPa."""
    if len(shape) != 1:
        raise ValueError(f"mooney-rivlin has one shape number, the share of c01 in c10 + c01; got {len(shape)}")
    lam, mu = lame(young, poisson)
    return 0.5 * mu * np.array([1.0 - shape[0], shape[0]]), lam


@njit(cache=True, error_model="numpy")
def response(D, parameters, psi, theta, P, g):
    """Fills psi_rest, theta, P_rest and g as `Law.response` states them, NaN where det F <= 0."""
    c10, c01 = parameters[0], parameters[1]
    volumetric = 4.0 / 3.0 * (c10 + c01)  # 2 mu / 3
    M, T = np.empty((3, 3)), np.empty((3, 3))  # T serves for cof D first
    for k in range(D.shape[0]):
        change, mean, square, y, e1 = first_invariant(D[k], T, M, g[k])
        J = 1.0 + change
        if not J > 0.0:
            psi[k], theta[k], P[k], g[k] = np.nan, np.nan, np.nan, np.nan
            continue
        scale = 1.0 + mean
        r1 = 1.0 + e1
        psi[k] = 3.0 * c10 * e1 + c01 * (3.0 * e1 * (1.0 + r1) + r1 * r1 * y) + 0.5 * volumetric * change * change
        theta[k] = change
        # P = F^-T T + ..., with T = 2 dev(C d psi / dC)
        t1 = 2.0 * c10 * r1 / scale + 2.0 * c01 * r1 * r1 / scale
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
    c10, c01 = parameters[0], parameters[1]
    volumetric = 4.0 / 3.0 * (c10 + c01)
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
        p1, p2 = 2.0 * c10 * a, 2.0 * c01 * a * a
        # J^(-2/3) I1 and J^(-4/3) I2 by the product rule, with d J = J G:dF, d2 I1 = 2 |dF|^2 and
        # d2 I2 = 2 (I1 |dF|^2 + 2 (F:dF)^2 - dF C:dF - F dF^T F:dF - F F^T dF:dF), d I2 = 2 (I1 F - F C):dF
        slope = J * (pressure[k] + volumetric * (J - 1.0))
        outer = 2.0 / 9.0 * p1 * I1 + 8.0 / 9.0 * p2 * I2 + slope + volumetric * J * J
        crossed = p1 * I1 / 3.0 + 2.0 / 3.0 * p2 * I2 - slope
        both = p1 + p2 * I1
        for i in range(3):
            for j in range(3):
                FC = F[i, 0] * right[0, j] + F[i, 1] * right[1, j] + F[i, 2] * right[2, j]
                X[i, j] = 0.5 * outer * G[i, j] - 2.0 / 3.0 * p1 * F[i, j] - 4.0 / 3.0 * p2 * (I1 * F[i, j] - FC)
        for i in range(3):
            for m in range(3):
                for j in range(3):
                    for n in range(3):
                        value = X[i, j] * G[m, n] + G[i, j] * X[m, n] + crossed * G[i, n] * G[m, j]
                        value += p2 * (2.0 * F[i, j] * F[m, n] - F[i, n] * F[m, j])
                        if i == m:
                            value -= p2 * right[j, n]
                        if j == n:
                            value -= p2 * left[i, m]
                        if i == m and j == n:
                            value += both
                        C[k, 3 * i + j, 3 * m + n] = value


LAW = Law("mooney-rivlin", parameters, response, curvature, shape=(0.2,))
