"""Derivatives of all that a state gives, by each parameter q of its robot, from its factor: one solve with the factor a
parameter. With R, delta and Phi = W differenced at the fixed state (explicit.py), y = A^-1 dR/dq, C the rows held,

    dlambda = -C^T (C W C^T)^-1 C (ddelta - H^T y)        dx = A^-1 H dlambda - y        ddelta_all = ddelta + B^T dx

and dW = dPhi/dq and the derivative of Phi along (dx, dlambda) (third_order.py). Rigid groups and rods move as their
unknowns do: at the state itself R is 0, so that the turning of their frames leaves these derivatives alone."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.equilibrium.derivatives.explicit import explicit
from cfem.equilibrium.derivatives.parameter_slopes import Sides
from cfem.equilibrium.derivatives.solved import solved
from cfem.equilibrium.derivatives.third_order import SkinRowsChange, derivative_along
from cfem.equilibrium.system.solution import Linearisation


@dataclass(frozen=True)
class Jacobian:
    """Derivatives by each of n_q parameters: W (n, n, n_q), delta (n, n_q) of all rows, lam (n_active, n_q), rest_e
    (n_e, n_q)."""

    W: np.ndarray
    delta: np.ndarray
    lam: np.ndarray
    rest_e: np.ndarray


def jacobian(linear: Linearisation, sides: Sequence[Sides]) -> Jacobian:
    """Derivatives of a state by its robot's parameters, without factorisation."""
    problem, evaluation, Z, C = linear.problem, linear.at, linear.Z, linear.C
    act, n_w = problem.robot.rows.active, problem.robot.rows.watched.stop
    explicit_part = explicit(linear, sides)
    y, _ = solved(linear, explicit_part.residual)
    lam = np.zeros((len(linear.lam), len(sides)))
    if len(C):
        lam = -C.T @ np.linalg.solve(C @ linear.W[act, act] @ C.T, C @ (explicit_part.delta[n_w:] - evaluation.H.T @ y))
    right = evaluation.H @ lam - explicit_part.residual
    motion, _ = solved(linear, right, Z[:, act] @ lam - y)
    B = np.hstack([problem.gradients(problem.robot.watched, evaluation.x), evaluation.H])
    skin, directions = SkinRowsChange(problem, evaluation), zip(lam.T, motion.T, strict=True)
    along = [derivative_along(problem, evaluation, linear.lam, Z, *each, skin=skin) for each in directions]
    return Jacobian(
        explicit_part.phi + np.stack(along, axis=2), explicit_part.delta + B.T @ motion, lam, explicit_part.rest_e
    )
