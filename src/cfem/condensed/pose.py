"""A rigid body's pose (u, theta): displacement of its origin (mm) and rotation vector (rad); how its points move."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed.rotation import turn

COORDINATES = ("x", "y", "z", "rx", "ry", "rz")


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
        """Displacements (3 k,) mm of the points from rest, at pose X (n,)."""
        r = self.points - self.origin
        turned = r @ turn(X[3:]).R.T - r if self.turns else np.zeros_like(r)
        return (turned + X[:3]).ravel()

    def jacobian(self, X: np.ndarray) -> np.ndarray:
        """Jacobian (3 k, n) of `displacement`."""
        k = len(self.points)
        shift = np.tile(np.eye(3), (k, 1))
        if not self.turns:
            return shift
        turned = np.einsum("jab,kb->kaj", turn(X[3:]).first, self.points - self.origin)
        return np.hstack([shift, turned.reshape(3 * k, 3)])

    def curvature(self, X: np.ndarray, lam: np.ndarray) -> np.ndarray:
        """Second derivative (n, n) of lam . displacement, lam (3 k,) N."""
        out = np.zeros((self.n, self.n))
        if self.turns:
            pulled = lam.reshape(-1, 3).T @ (self.points - self.origin)
            out[3:, 3:] = np.tensordot(turn(X[3:]).second, pulled, 2)
        return out
