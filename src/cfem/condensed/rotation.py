"""Rotations by their vector phi (rad), R = exp [phi], and their derivatives; [v] w = v x w.

`turn` takes Rodrigues' formula R = 1 + a [phi] + b [phi]^2 with a = sin t / t, b = (1 - cos t) / t^2, t = |phi|. Both
are entire functions of s = t^2, so that derivatives are those of short power series, at rest too."""

from math import factorial
from typing import NamedTuple

import numpy as np

_TERMS = 20  # for |theta| up to 2 pi to rounding
_E = np.zeros((3, 3, 3))  # [e_i], so that [v] = v . _E and [v] w = v x w
_E[0, 2, 1] = _E[1, 0, 2] = _E[2, 1, 0] = 1.0
_E[0, 1, 2] = _E[1, 2, 0] = _E[2, 0, 1] = -1.0
_EE = np.einsum("iab,jbc->ijac", _E, _E)
_EE += _EE.swapaxes(0, 1)


def _derivatives(coefficients: list[float]) -> list[list[float]]:
    """Coefficients of a power series and of its first two derivatives, the highest first."""
    first = [k * c for k, c in enumerate(coefficients)][1:]
    second = [k * c for k, c in enumerate(first)][1:]
    return [series[::-1] for series in (coefficients, first, second)]


_A = _derivatives([(-1) ** k / factorial(2 * k + 1) for k in range(_TERMS)])
_B = _derivatives([(-1) ** k / factorial(2 * k + 2) for k in range(_TERMS)])


def _at(coefficients: list[float], s: float) -> float:
    value = 0.0
    for coefficient in coefficients:
        value = value * s + coefficient
    return value


def cross_matrix(v: np.ndarray) -> np.ndarray:
    """Cross-product matrices [v] (..., 3, 3) of v (..., 3)."""
    out = np.zeros((*v.shape, 3))
    out[..., 2, 1], out[..., 0, 2], out[..., 1, 0] = np.moveaxis(v, -1, 0)
    return out - out.swapaxes(-1, -2)


def left_jacobian(phi: np.ndarray) -> np.ndarray:
    """Left Jacobian J (..., 3, 3) with exp [phi + d] = exp [J d] exp [phi] to first order: 1 + a [phi] + b [phi]^2,
    |phi| = t, a = (1 - cos t) / t^2, b = (t - sin t) / t^3. exp [phi] is 1 + [phi] J."""
    s = (phi**2).sum(axis=-1)[..., None, None]
    small = s < 1e-4
    safe = np.where(small, 1.0, s)
    t = np.sqrt(safe)
    a = np.where(small, 1 / 2 - s / 24 + s**2 / 720, (1 - np.cos(t)) / safe)
    b = np.where(small, 1 / 6 - s / 120 + s**2 / 5040, (t - np.sin(t)) / (safe * t))
    spin = cross_matrix(phi)
    return np.eye(3) + a * spin + b * (spin @ spin)


def inverse_left_jacobian(phi: np.ndarray) -> np.ndarray:
    """Inverse left Jacobian J_l^-1 (3, 3): d phi = J_l^-1 omega where dR = [omega] R and R = exp [phi], |phi| = t < 2
    pi (Sola, Deray and Atchuthan, A micro Lie theory, arXiv 1812.01537, 2018, eq. 146):

        J_l^-1 = 1 - [phi] / 2 + (1 - (t / 2) cot(t / 2)) / t^2 [phi]^2"""
    t = float(np.linalg.norm(phi))
    # up to 0.03 the series' next term, t^6 / 1209600, is under the rounding of the closed form
    factor = 1 / 12 + t**2 / 720 + t**4 / 30240 if t < 0.03 else (1 - t / 2 / np.tan(t / 2)) / t**2
    spin = cross_matrix(phi)
    return np.eye(3) - spin / 2 + factor * spin @ spin


class RotationDerivatives(NamedTuple):
    """A rotation R (3, 3), and its first (3, 3, 3) and second (3, 3, 3, 3) derivatives by the rotation vector, whose
    indices come first."""

    R: np.ndarray
    first: np.ndarray
    second: np.ndarray


def turn(theta: np.ndarray) -> RotationDerivatives:
    """Rotation exp[theta] and its derivatives, theta (3,) rad."""
    s = float(theta @ theta)
    a, a1, a2 = (_at(series, s) for series in _A)
    b, b1, b2 = (_at(series, s) for series in _B)
    S = cross_matrix(theta)
    SS = S @ S
    by_square = np.tensordot(theta, _EE, 1)  # derivatives of [theta]^2
    slope = a1 * S + b1 * SS
    first = (2.0 * theta)[:, None, None] * slope + a * _E + b * by_square
    mixed = (2.0 * theta)[:, None, None, None] * (a1 * _E + b1 * by_square)
    second = (4.0 * np.outer(theta, theta))[:, :, None, None] * (a2 * S + b2 * SS)
    second += mixed + mixed.swapaxes(0, 1) + b * _EE
    second[[0, 1, 2], [0, 1, 2]] += 2.0 * slope
    return RotationDerivatives(np.eye(3) + a * S + b * SS, first, second)
