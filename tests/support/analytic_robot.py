"""Robots in closed form over shares of their strokes, in any units: an arm of constant curvature that cables, chambers
or pushes bend. Energy, effector and derivatives are those of the same formula, by complex steps."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed import Condensed, Rows
from cfem.core.errors import NumericalError

_H = 1e-30  # of a complex step, which has no rounding


@dataclass(frozen=True)
class Arm:
    """bend (2, n_a) rad about y and x that full shares make, and stretch (n_a,) of the length; stiffness (n_a, n_a) of
    the energy s . A s / 2 + quartic sum(s^4) / 4 over shares s (n_a,); low, high (n_a,) shares; unilateral (n_a,):
    actuators that only pull or inflate."""

    bend: np.ndarray
    stretch: np.ndarray
    stiffness: np.ndarray
    quartic: float
    low: np.ndarray
    high: np.ndarray
    unilateral: np.ndarray

    def effector(self, s: np.ndarray) -> np.ndarray:
        """(..., n_a) -> (..., 3) from rest, of an arm of length 1 along z."""
        kx, ky = np.moveaxis(s @ self.bend.T, -1, 0)
        square = kx**2 + ky**2 + 1e-24
        angle, length = np.sqrt(square), 1 + s @ self.stretch
        lever = 2 * length * np.sin(angle / 2) ** 2 / square  # (1 - cos) / angle^2 without cancellation
        return np.stack([kx * lever, ky * lever, length * np.sin(angle) / angle - 1], axis=-1)

    def slope(self, s: np.ndarray) -> np.ndarray:
        """(3, n_a)."""
        steps = s + 1j * _H * np.eye(len(s))
        return self.effector(steps).imag.T / _H

    def force(self, s: np.ndarray) -> np.ndarray:
        """(..., n_a) gradient of the energy."""
        return s @ self.stiffness + self.quartic * s**3

    def hessian(self, s: np.ndarray) -> np.ndarray:
        return self.stiffness + 3 * self.quartic * np.diag(s**2)


def cables() -> Arm:
    """Two antagonists and one across."""
    return Arm(
        bend=np.array([[1.6, -1.6, 0.0], [0.3, 0.3, 1.4]]),
        stretch=np.array([-0.1, -0.1, -0.08]),
        stiffness=np.array([[1.0, 0.3, 0.2], [0.3, 1.0, 0.2], [0.2, 0.2, 0.8]]),
        quartic=0.4,
        low=np.zeros(3),
        high=np.ones(3),
        unilateral=np.ones(3, bool),
    )


def chambers() -> Arm:
    """Three around the axis that lengthen the arm."""
    angles = 2 * np.pi * np.arange(3) / 3
    return Arm(
        bend=1.3 * np.array([np.cos(angles), np.sin(angles)]),
        stretch=np.full(3, 0.15),
        stiffness=np.eye(3) + 0.25,
        quartic=0.8,
        low=np.zeros(3),
        high=np.ones(3),
        unilateral=np.ones(3, bool),
    )


def bellows() -> Arm:
    """One chamber that curls the arm by three quarters of a turn."""
    return Arm(np.array([[4.7], [0.0]]), np.array([0.2]), np.eye(1), 1.0, np.zeros(1), np.ones(1), np.ones(1, bool))


def pushes() -> Arm:
    """Two that push and pull."""
    return Arm(
        bend=np.array([[1.2, 0.2], [-0.3, 1.0]]),
        stretch=np.array([0.05, -0.1]),
        stiffness=np.array([[1.0, -0.2], [-0.2, 0.7]]),
        quartic=0.5,
        low=-np.ones(2),
        high=np.ones(2),
        unilateral=np.zeros(2, bool),
    )


def redundant() -> Arm:
    """Four cables about a quarter turn from each other: more than coordinates of the effector."""
    return Arm(
        bend=1.5 * np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]]),
        stretch=np.full(4, -0.12),
        stiffness=np.eye(4) + 0.3,
        quartic=0.3,
        low=np.zeros(4),
        high=np.ones(4),
        unilateral=np.ones(4, bool),
    )


ARMS = {one.__name__: one() for one in (cables, chambers, bellows, pushes, redundant)}


class AnalyticRobot:
    """The protocol of a model. strokes (n_a,): a full share in the unit of each actuator; compliance: of them all, mm
    by N in shares; length: mm; form: what the model is a function of."""

    def __init__(
        self, arm: Arm, strokes: np.ndarray, compliance: float = 1.0, length: float = 100.0, form="displacement"
    ):
        n = len(arm.low)
        self.arm, self.length, self.form = arm, length, form
        self.strokes, self.energy = np.broadcast_to(np.asarray(strokes, float), n), length**2 / compliance
        self.rows = Rows(("tip.x", "tip.y", "tip.z"), tuple(f"a{i}" for i in range(n)))
        self.rest_e = np.array([0.0, 0.0, length])
        self.reach = np.column_stack([arm.low, arm.high]) * self.strokes[:, None]
        self.unilateral, self.queries = arm.unilateral, 0

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        self.queries += 1
        arm, D = self.arm, self.strokes
        s = np.asarray(delta_a, float) / D
        if not np.isfinite(s).all() or np.abs(s).max() > 2.0:
            raise NumericalError("beyond what the robot bears")
        lam = self.energy * arm.force(s) / D
        W_aa = np.linalg.inv(arm.hessian(s)) * np.outer(D, D) / self.energy
        J = self.length * arm.slope(s) / D
        W_ea, n_e = J @ W_aa, 3
        W = np.block([[1e-2 * self.length**2 / self.energy * np.eye(n_e) + W_ea @ J.T, W_ea], [W_ea.T, W_aa]])
        delta = np.concatenate([self.length * arm.effector(s), s * D])
        return Condensed(self.rows, W, delta - W[:, n_e:] @ lam, lam)

    def at_force(self, lambda_a: np.ndarray) -> Condensed:
        """By Newton's method on shares."""
        arm, wanted = self.arm, np.asarray(lambda_a, float) * self.strokes / self.energy
        s = np.linalg.solve(arm.stiffness, wanted)
        for _ in range(60):
            step = np.linalg.solve(arm.hessian(s), wanted - arm.force(s))
            s = s + step
            if np.abs(step).max() < 1e-15:
                break
        return self.at_displacement(s * self.strokes)

    def admissible(self, shares: np.ndarray) -> np.ndarray:
        """(..., n_a) -> (...) whether forces and displacements are within bounds."""
        arm = self.arm
        pulls = ~arm.unilateral | (arm.force(shares) >= 0)
        return (pulls & (shares >= arm.low) & (shares <= arm.high)).all(axis=-1)
