"""The element of a geometrically exact rod (Reissner 1981; Simo, CMAME 49, 1985) whose strain is constant.

An element joins two rigid sections with frames (c, R), R turned since rest. Its strain is the logarithm of their
relative motion on SE(3), a screw along which all sections between them lie (Borri and Bottasso, IJNME 37, 1994;
Sonneville, Cardona and Bruls, CMAME 268, 2014):

    theta = log(Ra^T Rb)        V(theta) u = Ra^T (cb - ca) = p        e = (u - (h, 0, 0), theta)

with V the left Jacobian of SO(3), V^-1 p = p - theta x p / 2 + c theta x (theta x p). It is objective, needs no reduced
integration, and is exact where the strain is constant: under end moments, and under pressure in chambers along the rod.
Axes are those of the rest shape, x along the rod. Motions are (dc, omega) of either section, R -> exp[omega] R; all
arrays run over the m elements."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial.transform import Rotation
from scipy.special import zeta

from cfem.condensed.rotation import left_jacobian

_TERMS = 30  # for |theta| up to pi to rounding


_POWERS = np.arange(_TERMS)
# c(s), s = theta^2, of V^-1 = 1 - [theta] / 2 + c [theta]^2: c = (1 - (t / 2) cot(t / 2)) / t^2
_C = 2 * zeta(2 * _POWERS + 2) / (2 * np.pi) ** (2 * _POWERS + 2)
# columns: coefficients of c, c', c'' by the power of s
_SERIES = np.stack(
    [
        _C,
        np.append(_C[1:] * _POWERS[1:], 0.0),
        np.append(_C[2:] * _POWERS[2:] * _POWERS[1:-1], [0.0, 0.0]),
    ],
    axis=1,
)


@dataclass(frozen=True)
class RodStrain:
    """Strain of m elements. The fields after `gradient` are what `curvature` needs.

    e: (m, 6) mm, rad
    gradient: (m, 6, 12) by the motions of both sections
    Ra, Rb, theta, p: rotations (m, 3, 3), their relative vector and the place (m, 3)
    c: c, c', c'' (m, 3)"""

    e: np.ndarray
    gradient: np.ndarray
    Ra: np.ndarray
    Rb: np.ndarray
    theta: np.ndarray
    p: np.ndarray
    c: np.ndarray


def stretch(ca: np.ndarray, Ra: np.ndarray, cb: np.ndarray, Rb: np.ndarray, h: np.ndarray) -> RodStrain:
    """Strain of elements between sections at ca, cb (m, 3) mm with rotations Ra, Rb (m, 3, 3), h (m,) mm apart at
    rest."""
    m = len(h)
    e, gradient = np.empty((m, 6)), np.zeros((m, 6, 12))
    theta, p, c = np.empty((m, 3)), np.empty((m, 3)), np.empty((m, 3))
    _stretch(ca, Ra, cb, Rb, h, _SERIES, e, gradient, theta, p, c)
    return RodStrain(e, gradient, Ra, Rb, theta, p, c)


def curvature(strain: RodStrain, weights: np.ndarray) -> np.ndarray:
    """Second derivative (m, 12, 12) of weights . e, weights (m, 6), by the motions of both sections: of straight lines
    (dc, omega), R -> exp[omega] R. With (alpha, beta) = (Ra^T omega_a, Rb^T omega_b) and tau = Ra^T (dcb - dca),

        theta' = Jr^-1 beta - Jl^-1 alpha            theta'' = Jr^-1' beta - Jl^-1' alpha
        p' = tau - alpha x p                         p'' = alpha x (alpha x p) - 2 alpha x tau"""
    out = np.empty((len(weights), 12, 12))
    _curvature(strain.Ra, strain.Rb, strain.theta, strain.p, strain.c, weights, out)
    return out


def screw(e: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Relative motions, p (m, 3) mm and rotation (m, 3, 3), with stretch e (m, 6): the inverse of `stretch`."""
    theta, u = e[:, 3:], e[:, :3].copy()
    u[:, 0] += h
    turn = Rotation.from_rotvec(theta).as_matrix()
    return (left_jacobian(theta) @ u[:, :, None])[:, :, 0], turn


@njit(cache=True)
def _cross_into(v, scale, out):
    """Adds scale [v] to out (3, 3)."""
    out[2, 1] += scale * v[0]
    out[1, 2] -= scale * v[0]
    out[0, 2] += scale * v[1]
    out[2, 0] -= scale * v[1]
    out[1, 0] += scale * v[2]
    out[0, 1] -= scale * v[2]


@njit(cache=True)
def _inverse_jacobian(theta, c, side, out):
    """Fills out (3, 3) = 1 + side [theta] / 2 + c [theta]^2: side -1 the left one, +1 the right one."""
    s = theta[0] ** 2 + theta[1] ** 2 + theta[2] ** 2
    for i in range(3):
        for j in range(3):
            out[i, j] = c[0] * theta[i] * theta[j]
        out[i, i] += 1.0 - c[0] * s
    _cross_into(theta, side / 2, out)


@njit(cache=True)
def _slope(theta, v, c, half, out):
    """Fills out (3, 3) with the derivative by theta of -half theta x v + c theta x (theta x v)."""
    s, along = 0.0, 0.0
    for i in range(3):
        s += theta[i] * theta[i]
        along += theta[i] * v[i]
    for i in range(3):
        twice = theta[i] * along - v[i] * s
        for j in range(3):
            out[i, j] = c[0] * (theta[i] * v[j] - 2 * v[i] * theta[j]) + 2 * c[1] * twice * theta[j]
        out[i, i] += c[0] * along
    _cross_into(v, half, out)


@njit(cache=True)
def _second(theta, n, p, c, out):
    """Fills out (3, 3) with the second derivative by theta of n . V^-1 p, which is that of c Q, Q = n . (theta x (theta
    x p))."""
    s, n_theta, p_theta, n_p = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        s += theta[i] * theta[i]
        n_theta += n[i] * theta[i]
        p_theta += p[i] * theta[i]
        n_p += n[i] * p[i]
    Q = n_theta * p_theta - s * n_p
    for i in range(3):
        first_i = n[i] * p_theta + p[i] * n_theta - 2 * theta[i] * n_p
        for j in range(3):
            first_j = n[j] * p_theta + p[j] * n_theta - 2 * theta[j] * n_p
            out[i, j] = c[0] * (n[i] * p[j] + p[i] * n[j]) + 2 * c[1] * (theta[i] * first_j + first_i * theta[j])
            out[i, j] += 4 * c[2] * Q * theta[i] * theta[j]
        out[i, i] += 2 * c[1] * Q - 2 * c[0] * n_p


@njit(cache=True)
def _stretch(ca, Ra, cb, Rb, h, series, e, gradient, theta, p, c):
    """Fills e and its gradient: theta = log(Ra^T Rb), p = Ra^T (cb - ca), e = (V^-1 p - h, theta)."""
    Q, left, right = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    G, by_turn = np.empty((3, 3)), np.empty((3, 3))
    for k in range(len(h)):
        A, B = Ra[k], Rb[k]
        for i in range(3):
            p[k, i] = 0.0
            for a in range(3):
                p[k, i] += A[a, i] * (cb[k, a] - ca[k, a])
            for j in range(3):
                Q[i, j] = A[0, i] * B[0, j] + A[1, i] * B[1, j] + A[2, i] * B[2, j]
        # the logarithm of Q
        theta[k, 0], theta[k, 1], theta[k, 2] = (
            (Q[2, 1] - Q[1, 2]) / 2,
            (Q[0, 2] - Q[2, 0]) / 2,
            (Q[1, 0] - Q[0, 1]) / 2,
        )
        sine = np.sqrt(theta[k, 0] ** 2 + theta[k, 1] ** 2 + theta[k, 2] ** 2)
        if sine > 1e-8:
            factor = np.arctan2(sine, (Q[0, 0] + Q[1, 1] + Q[2, 2] - 1) / 2) / sine
            for i in range(3):
                theta[k, i] *= factor
        s = theta[k, 0] ** 2 + theta[k, 1] ** 2 + theta[k, 2] ** 2
        for order in range(3):
            c[k, order] = 0.0
            for term in range(len(series) - 1, -1, -1):
                c[k, order] = c[k, order] * s + series[term, order]
        _inverse_jacobian(theta[k], c[k], -1.0, left)
        _inverse_jacobian(theta[k], c[k], 1.0, right)
        _slope(theta[k], p[k], c[k], 0.5, G)
        # V^-1 [p] - G Jl^-1, by alpha
        for i in range(3):
            by_turn[i, 0] = left[i, 1] * p[k, 2] - left[i, 2] * p[k, 1]
            by_turn[i, 1] = left[i, 2] * p[k, 0] - left[i, 0] * p[k, 2]
            by_turn[i, 2] = left[i, 0] * p[k, 1] - left[i, 1] * p[k, 0]
            for j in range(3):
                by_turn[i, j] -= G[i, 0] * left[0, j] + G[i, 1] * left[1, j] + G[i, 2] * left[2, j]
        g = gradient[k]
        for i in range(3):
            e[k, i] = left[i, 0] * p[k, 0] + left[i, 1] * p[k, 1] + left[i, 2] * p[k, 2]
            e[k, 3 + i] = theta[k, i]
            for j in range(3):
                for a in range(3):
                    g[i, 6 + j] += left[i, a] * A[j, a]
                    g[i, 3 + j] += by_turn[i, a] * A[j, a]
                    g[3 + i, 9 + j] += right[i, a] * B[j, a]
                g[i, j] = -g[i, 6 + j]
                g[3 + i, 3 + j] = g[i, j]
        for i in range(3):
            for j in range(3):
                g[i, 9 + j] = G[i, 0] * g[3, 9 + j] + G[i, 1] * g[4, 9 + j] + G[i, 2] * g[5, 9 + j]
        e[k, 0] -= h[k]


@njit(cache=True)
def _curvature(Ra, Rb, theta, p, c, weights, out):
    """Fills the second derivatives of weights . e by (tau, alpha, beta), then by the motions of both sections
    (`curvature`)."""
    left, right, G, S = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    early, late = np.empty((3, 3)), np.empty((3, 3))
    by_p, by_theta = np.empty(3), np.empty(3)
    to_theta, to_p, half = np.zeros((3, 9)), np.zeros((3, 9)), np.empty((3, 9))
    H, L = np.empty((9, 9)), np.zeros((9, 9))
    for k in range(len(weights)):
        t, n = theta[k], weights[k]
        _inverse_jacobian(t, c[k], -1.0, left)
        _inverse_jacobian(t, c[k], 1.0, right)
        _slope(t, p[k], c[k], 0.5, G)
        for i in range(3):
            by_p[i] = right[i, 0] * n[0] + right[i, 1] * n[1] + right[i, 2] * n[2]  # V^-T n
            by_theta[i] = n[3 + i] + n[0] * G[0, i] + n[1] * G[1, i] + n[2] * G[2, i]
        to_p[:] = 0.0
        _cross_into(p[k], 1.0, to_p[:, 3:6])
        for i in range(3):
            to_p[i, i] = 1.0
            for j in range(3):
                to_theta[i, 3 + j], to_theta[i, 6 + j] = -left[i, j], right[i, j]
        # mixed terms: of p and theta, and of theta''; half of each, made symmetric
        _slope(t, n[:3], c[k], -0.5, G)
        _slope(t, by_theta, c[k], 0.5, late)
        _slope(t, by_theta, c[k], -0.5, early)
        _second(t, n[:3], p[k], c[k], S)
        for i in range(3):
            for j in range(9):
                half[i, j] = 0.0
                for a in range(3):
                    half[i, j] += G[i, a] * to_theta[a, j]
        for i in range(9):
            for j in range(9):
                H[i, j] = to_p[0, i] * half[0, j] + to_p[1, i] * half[1, j] + to_p[2, i] * half[2, j]
        for i in range(3):
            for j in range(9):
                for a in range(3):
                    H[6 + i, j] += late[i, a] * to_theta[a, j] / 2
                    H[3 + i, j] -= early[i, a] * to_theta[a, j] / 2
        for i in range(3):
            for j in range(9):
                half[i, j] = S[i, 0] * to_theta[0, j] + S[i, 1] * to_theta[1, j] + S[i, 2] * to_theta[2, j]
        for i in range(9):
            for j in range(i + 1):
                both = H[i, j] + H[j, i]
                both += to_theta[0, i] * half[0, j] + to_theta[1, i] * half[1, j] + to_theta[2, i] * half[2, j]
                H[i, j] = both
                H[j, i] = both
        # p''
        along = by_p[0] * p[k, 0] + by_p[1] * p[k, 1] + by_p[2] * p[k, 2]
        for i in range(3):
            for j in range(3):
                H[3 + i, 3 + j] += (by_p[i] * p[k, j] + p[k, i] * by_p[j]) / 2
            H[3 + i, 3 + i] -= along
        _cross_into(by_p, -1.0, H[:3, 3:6])
        _cross_into(by_p, 1.0, H[3:6, :3])
        _to_motions(Ra[k], Rb[k], H, L, out[k])


@njit(cache=True)
def _to_motions(Ra, Rb, H, L, out):
    """Fills out (12, 12) with H (9, 9), by (tau, alpha, beta) in the axes of the sections, by the motions in the axes
    at rest. H and L are overwritten."""
    for i in range(9):
        for block in range(3):
            R = Rb if block == 2 else Ra
            for j in range(3):
                L[i, 3 * block + j] = 0.0
                for a in range(3):
                    L[i, 3 * block + j] += H[i, 3 * block + a] * R[j, a]
    for block in range(3):
        R = Rb if block == 2 else Ra
        for i in range(3):
            for j in range(9):
                total = 0.0
                for a in range(3):
                    total += R[i, a] * L[3 * block + a, j]
                H[3 * block + i, j] = total
    for i in range(9):
        for j in range(9):
            # rows and columns tau stand for cb - ca
            row, column = (6 + i if i < 3 else i if i < 6 else 3 + i), (6 + j if j < 3 else j if j < 6 else 3 + j)
            out[row, column] = H[i, j]
            if i < 3:
                out[i, column] = -H[i, j]
            if j < 3:
                out[row, j] = -H[i, j]
            if i < 3 and j < 3:
                out[i, j] = H[i, j]
