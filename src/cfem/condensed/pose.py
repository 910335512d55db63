"""A rigid body's pose (u, theta): displacement of its origin (mm) and rotation vector (rad), and how its points move.

Rodrigues' formula R r = r + a theta x r + b theta x (theta x r) with a = sin t / t, b = (1 - cos t) / t^2, t = |theta|;
both are entire functions of s = t^2, so that derivatives are those of short power series, at rest too."""

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.polynomial import Polynomial

_TERMS = 20  # for |theta| up to 2 pi to rounding
_A = Polynomial([(-1) ** k / factorial(2 * k + 1) for k in range(_TERMS)])
_B = Polynomial([(-1) ** k / factorial(2 * k + 2) for k in range(_TERMS)])
_SERIES = [(_A, _B), (_A.deriv(1), _B.deriv(1)), (_A.deriv(2), _B.deriv(2))]


def cross_matrix(v: np.ndarray) -> np.ndarray:
    """(3, 3) [v] with [v] w = v x w."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def rotated(theta: np.ndarray, r: np.ndarray) -> np.ndarray:
    """(k, 3) exp[theta] r of r (k, 3)."""
    a, b = (float(one(theta @ theta)) for one in _SERIES[0])
    once = np.cross(theta, r)
    return r + a * once + b * np.cross(theta, once)


def rotated_jacobian(theta: np.ndarray, r: np.ndarray) -> np.ndarray:
    """(k, 3, 3) d(exp[theta] r)/dtheta of r (k, 3)."""
    s = float(theta @ theta)
    (a, b), (a1, b1) = ([float(one(s)) for one in pair] for pair in _SERIES[:2])
    once = np.cross(theta, r)
    twice = np.cross(theta, once)
    along = r @ theta
    out = 2 * np.einsum("ki,j->kij", a1 * once + b1 * twice, theta)
    out -= a * np.array([cross_matrix(one) for one in r])
    out += b * np.einsum("i,kj->kij", theta, r) - 2 * b * np.einsum("ki,j->kij", r, theta)
    return out + b * along[:, None, None] * np.eye(3)


def rotated_curvature(theta: np.ndarray, r: np.ndarray, f: np.ndarray) -> np.ndarray:
    """(3, 3) second derivative by theta of sum_k f_k . exp[theta] r_k; r and f (k, 3)."""
    s = float(theta @ theta)
    (_, b), (a1, b1), (a2, b2) = ([float(one(s)) for one in pair] for pair in _SERIES)
    moment = np.cross(r, f).sum(axis=0)  # theta . moment = sum f . (theta x r)
    outer = f.T @ r
    square = outer + outer.T - 2 * np.trace(outer) * np.eye(3)  # of theta . square theta / 2 = f . theta x (theta x r)
    L, M, dM = float(theta @ moment), float(theta @ square @ theta) / 2, square @ theta
    tt = np.outer(theta, theta)
    out = (4 * a2 * tt + 2 * a1 * np.eye(3)) * L + 2 * a1 * (np.outer(theta, moment) + np.outer(moment, theta))
    out += (4 * b2 * tt + 2 * b1 * np.eye(3)) * M + 2 * b1 * (np.outer(theta, dM) + np.outer(dM, theta))
    return out + b * square


@dataclass(frozen=True)
class Patch:
    """Points of a robot that move as one rigid body. points (k, 3) mm at rest; origin (3,) mm, the point whose
    displacement is u; turns: whether it can turn, so that a pose X has six coordinates (u, theta), else three."""

    points: np.ndarray
    origin: np.ndarray
    turns: bool

    @property
    def n(self) -> int:
        return 6 if self.turns else 3

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"patch.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")[: self.n])

    def displacement(self, X: np.ndarray) -> np.ndarray:
        """(3 k,) mm of the points from rest, at pose X (n,)."""
        r = self.points - self.origin
        turned = rotated(X[3:], r) - r if self.turns else np.zeros_like(r)
        return (turned + X[:3]).ravel()

    def jacobian(self, X: np.ndarray) -> np.ndarray:
        """(3 k, n) of `displacement`."""
        k = len(self.points)
        shift = np.tile(np.eye(3), (k, 1))
        if not self.turns:
            return shift
        return np.hstack([shift, rotated_jacobian(X[3:], self.points - self.origin).reshape(3 * k, 3)])

    def curvature(self, X: np.ndarray, lam: np.ndarray) -> np.ndarray:
        """(n, n) second derivative of lam . displacement, lam (3 k,) N."""
        out = np.zeros((self.n, self.n))
        if self.turns:
            out[3:, 3:] = rotated_curvature(X[3:], self.points - self.origin, lam.reshape(-1, 3))
        return out
