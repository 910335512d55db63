"""A rigid body's pose (u, theta): displacement of its origin (mm) and rotation vector (rad), and how its points move.

Rodrigues' formula R = 1 + a [theta] + b [theta]^2 with a = sin t / t, b = (1 - cos t) / t^2, t = |theta|; both are
entire functions of s = t^2, so that derivatives are those of short power series, at rest too."""

from dataclasses import dataclass
from math import factorial
from typing import NamedTuple

import numpy as np

COORDINATES = ("x", "y", "z", "rx", "ry", "rz")
_TERMS = 20  # for |theta| up to 2 pi to rounding
_E = np.zeros((3, 3, 3))  # [e_i], so that [v] = v . _E and [v] w = v x w
_E[0, 2, 1] = _E[1, 0, 2] = _E[2, 1, 0] = 1.0
_E[0, 1, 2] = _E[1, 2, 0] = _E[2, 0, 1] = -1.0
_EE = np.einsum("iab,jbc->ijac", _E, _E)
_EE += _EE.swapaxes(0, 1)


def _derivatives(coefficients: list[float]) -> list[list[float]]:
    """Coefficients of a power series and of its first two derivatives, the highest first."""
    once = [k * c for k, c in enumerate(coefficients)][1:]
    twice = [k * c for k, c in enumerate(once)][1:]
    return [series[::-1] for series in (coefficients, once, twice)]


_A = _derivatives([(-1) ** k / factorial(2 * k + 1) for k in range(_TERMS)])
_B = _derivatives([(-1) ** k / factorial(2 * k + 2) for k in range(_TERMS)])


def _at(coefficients: list[float], s: float) -> float:
    value = 0.0
    for coefficient in coefficients:
        value = value * s + coefficient
    return value


def cross_matrix(v: np.ndarray) -> np.ndarray:
    """(3, 3) [v] with [v] w = v x w."""
    return np.tensordot(v, _E, 1)


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


@dataclass(frozen=True)
class Patch:
    """Points of a robot that move as one rigid body.

    points: (k, 3) mm at rest
    origin: (3,) mm, the point whose displacement is u
    turns: whether it can turn, so that a pose X has six coordinates (u, theta), else three"""

    points: np.ndarray
    origin: np.ndarray
    turns: bool

    @property
    def n(self) -> int:
        return 6 if self.turns else 3

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"patch.{axis}" for axis in COORDINATES[: self.n])

    def displacement(self, X: np.ndarray) -> np.ndarray:
        """(3 k,) mm of the points from rest, at pose X (n,)."""
        r = self.points - self.origin
        turned = r @ turn(X[3:]).R.T - r if self.turns else np.zeros_like(r)
        return (turned + X[:3]).ravel()

    def jacobian(self, X: np.ndarray) -> np.ndarray:
        """(3 k, n) of `displacement`."""
        k = len(self.points)
        shift = np.tile(np.eye(3), (k, 1))
        if not self.turns:
            return shift
        turned = np.einsum("jab,kb->kaj", turn(X[3:]).first, self.points - self.origin)
        return np.hstack([shift, turned.reshape(3 * k, 3)])

    def curvature(self, X: np.ndarray, lam: np.ndarray) -> np.ndarray:
        """(n, n) second derivative of lam . displacement, lam (3 k,) N."""
        out = np.zeros((self.n, self.n))
        if self.turns:
            pulled = lam.reshape(-1, 3).T @ (self.points - self.origin)
            out[3:, 3:] = np.tensordot(turn(X[3:]).second, pulled, 2)
        return out
