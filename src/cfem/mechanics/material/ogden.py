"""Ogden's law of nearly incompressible rubber in the isochoric principal stretches lbar_i = J^(-1/3) l_i; J > 0 only.

    psi = sum_p mu_p / alpha_p (lbar_1^alpha_p + lbar_2^alpha_p + lbar_3^alpha_p - 3) + kappa/2 (J - 1)^2

with kappa = lambda + 2 mu/3, split into theta = J - 1 with bulk = lambda, and a rest that holds mu/3 (J - 1)^2 (why:
law.py). The shape numbers are w_1, alpha_1, w_2, alpha_2, ... with sum w = 1 and mu_p = 2 mu w_p / alpha_p, whatever
mu; by default those of Ogden's natural rubber, mu_p = 6.3, 0.012, -0.1 kg/cm^2, alpha_p = 1.3, 5, -2. Ogden, Large
deformation isotropic elasticity, Proc. R. Soc. A 326, 1972; Holzapfel, Nonlinear Solid Mechanics, 2000, sections 6.5
(energy) and 6.6 (tangent in principal axes).

All is formed from h_i = ln l_i, the logarithms being of 1 + the eigenvalues of 2 E, so that small strains keep their
digits. Divided differences of equal stretches need no threshold: both numerator and denominator are sinh of h_i - h_j
times smooth factors."""

import math

import numpy as np
from numba import njit

from cfem.mechanics.material.eigen3 import eigen3
from cfem.mechanics.material.law import Law, lame
from cfem.mechanics.material.scalar import expm1_less
from cfem.mechanics.material.tensor import add_identity, cofactor_change, double_strain, volume_change


def parameters(young: float, poisson: float, shape: tuple[float, ...]) -> tuple[np.ndarray, float]:
    """Parameters ([mu, mu_1, alpha_1, mu_2, alpha_2, ...], lambda), moduli in MPa."""
    weights, powers = np.array(shape[0::2], float), np.array(shape[1::2], float)
    if len(weights) != len(powers) or len(weights) == 0 or abs(weights.sum() - 1.0) > 1e-9 or not powers.all():
        raise ValueError(
            f"ogden's shape numbers are w_1, alpha_1, w_2, alpha_2, ... with sum w = 1 and no alpha zero; got {shape}"
        )
    lam, mu = lame(young, poisson)
    terms = np.stack([2.0 * mu * weights / powers, powers], axis=1)
    return np.concatenate([[mu], terms.ravel()]), lam


@njit(cache=True, error_model="numpy")
def _principal(D, M, stretch2, vectors, h, hbar):
    """Squared stretches, their axes (columns), ln l and ln lbar; M (3, 3) is scratch."""
    double_strain(D, M)
    eigen3(M, stretch2, vectors)
    for i in range(3):
        h[i] = 0.5 * math.log1p(stretch2[i])
        stretch2[i] += 1.0
    mean = (h[0] + h[1] + h[2]) / 3.0
    for i in range(3):
        hbar[i] = h[i] - mean


@njit(cache=True, error_model="numpy")
def response(D, parameters, psi, theta, P, g):
    """Fills psi_rest, theta, P_rest and g as `Law.response` states them, NaN where det F <= 0."""
    volumetric = 2.0 / 3.0 * parameters[0]
    M, N, n = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))  # n serves for cof D first
    stretch2, h, hbar, tau, power = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(D.shape[0]):
        trace, higher = volume_change(D[k], n)
        change = trace + higher
        if not 1.0 + change > 0.0:
            psi[k], theta[k], P[k], g[k] = np.nan, np.nan, np.nan, np.nan
            continue
        _principal(D[k], M, stretch2, N, h, hbar)
        theta[k] = change
        for i in range(3):
            for j in range(3):
                g[k, i, j] = cofactor_change(D[k], n, trace, i, j) + (1.0 if i == j else 0.0)
        energy = 0.5 * volumetric * change * change
        tau[:] = 0.0
        for p in range(1, len(parameters), 2):
            mu, alpha = parameters[p], parameters[p + 1]
            for i in range(3):
                x = alpha * hbar[i]
                less = expm1_less(x)  # the x add up to nothing
                energy += mu / alpha * less
                power[i] = less + x
            mean = (power[0] + power[1] + power[2]) / 3.0
            for i in range(3):
                tau[i] += mu * (power[i] - mean)
        psi[k] = energy
        add_identity(D[k], M)
        for i in range(3):
            for j in range(3):
                n[i, j] = (M[i, 0] * N[0, j] + M[i, 1] * N[1, j] + M[i, 2] * N[2, j]) * tau[j] / stretch2[j]
        for i in range(3):
            for j in range(3):
                P[k, i, j] = volumetric * change * g[k, i, j]
                for q in range(3):  # sum of tau_q / l_q^2 (F N_q) N_q^T
                    P[k, i, j] += n[i, q] * N[j, q]


@njit(cache=True, error_model="numpy")
def _sinhc(x: float) -> float:
    return math.sinh(x) / x if x != 0.0 else 1.0


@njit(cache=True, error_model="numpy")
def _stress_in_logarithms(parameters, slope, hessian, h, hbar, tau, dtau, ratio, power):
    """Fills tau_i = d psi / d h_i, dtau = d tau_i / d h_j, and ratio_r = (tau_i - tau_j) / sinh(h_i - h_j) of the other
    two. slope, hessian: of the volumetric energy by ln J; power (3,) is scratch."""
    tau[:] = slope
    dtau[:, :] = hessian
    ratio[:] = 0.0
    for p in range(1, len(parameters), 2):
        mu, alpha = parameters[p], parameters[p + 1]
        for i in range(3):
            power[i] = math.exp(alpha * hbar[i])
        mean = (power[0] + power[1] + power[2]) / 3.0
        for i in range(3):
            tau[i] += mu * (power[i] - mean)
            dtau[i, i] += mu * alpha * power[i]
            for j in range(3):
                dtau[i, j] -= mu * alpha / 3.0 * (power[i] + power[j] - mean)
            i1, i2 = (i + 1) % 3, (i + 2) % 3
            between = math.sqrt(power[i1] * power[i2])
            ratio[i] += mu * alpha * between * _sinhc(0.5 * alpha * (h[i1] - h[i2]))


@njit(cache=True, error_model="numpy")
def curvature(D, parameters, pressure, C):
    """Fills C as `Law.curvature` states it, NaN where det F <= 0, from the axes V_r = F N_r N_r^T and the pairs W_r of
    the other two."""
    volumetric = 2.0 / 3.0 * parameters[0]
    M, N, n, S = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    stretch2, h, hbar, tau, power = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    dtau, ratio = np.empty((3, 3)), np.empty(3)
    V, U, W = np.empty((3, 9)), np.empty((3, 9)), np.empty((3, 9))
    for k in range(D.shape[0]):
        trace, higher = volume_change(D[k], M)
        J = 1.0 + (trace + higher)
        if not J > 0.0:
            C[k] = np.nan
            continue
        _principal(D[k], M, stretch2, N, h, hbar)
        slope = J * (pressure[k] + volumetric * (J - 1.0))
        _stress_in_logarithms(parameters, slope, slope + volumetric * J * J, h, hbar, tau, dtau, ratio, power)
        add_identity(D[k], M)
        for i in range(3):
            for j in range(3):
                n[i, j] = M[i, 0] * N[0, j] + M[i, 1] * N[1, j] + M[i, 2] * N[2, j]
                S[i, j] = 0.0
        for r in range(3):
            r1, r2 = (r + 1) % 3, (r + 2) % 3
            s = tau[r] / stretch2[r]
            for i in range(3):
                for j in range(3):
                    S[i, j] += s * N[i, r] * N[j, r]
                    V[r, 3 * i + j] = n[i, r] * N[j, r]
                    W[r, 3 * i + j] = n[i, r1] * N[j, r2] + n[i, r2] * N[j, r1]
            # half of (s_1 - s_2) / (E_1 - E_2) with s = tau / l^2
            d = h[r1] - h[r2]
            ratio[r] = ratio[r] * math.cosh(d) / _sinhc(d) - tau[r1] - tau[r2]
            ratio[r] *= 0.5 / (stretch2[r1] * stretch2[r2])
            dtau[r, r] -= 2.0 * tau[r]
        for r in range(3):
            for c in range(9):
                U[r, c] = 0.0
                for q in range(3):
                    U[r, c] += dtau[r, q] / (stretch2[r] * stretch2[q]) * V[q, c]
        for row in range(9):
            for column in range(9):
                value = 0.0
                for r in range(3):
                    value += V[r, row] * U[r, column] + ratio[r] * W[r, row] * W[r, column]
                C[k, row, column] = value
        for i in range(3):
            for j in range(3):
                for m in range(3):
                    C[k, 3 * i + j, 3 * i + m] += S[j, m]


LAW = Law("ogden", parameters, response, curvature, shape=(0.819 / 0.845, 1.3, 0.006 / 0.845, 5.0, 0.02 / 0.845, -2.0))
