"""Gradients of numbers that depend on an equilibrium and on its W, by any parameters of the robot, from one state and
its factor: one solve with the factor a number, whatever the count of parameters (the adjoint method). jacobian.py has
the derivatives of all that a state gives, at one solve a parameter.

With B = H^T of all rows, Phi = B^T Z + Z^T B - Z^T A Z is W and stationary in Z, so that a number J(W, delta, lambda,
x) changes by the partial derivatives of

    G : Phi(x, lambda, q) + d . delta(x, q) + l . lambda + J_x . x,      G = dJ/dW, d = dJ/d delta, l = dJ/d lambda,

at Z held. Its gradients g_x and g_lambda, by x and lambda, give with s = A^-1 g_x and C the rows that are held

    m = (C W C^T)^-1 C (H^T s + g_lambda)        w = s - Z C^T m
    dJ/dq = d/dq [ G : Phi + d . delta - w . R - (C^T m) . delta_active ]    at fixed x, lambda, Z, w and m,

by central differences of the robots on either side of q (explicit.py). A enters g_x by its derivative: with G = sum g v
v^T and z = Z v, it is sum g (2 d(B v) - d^2 R) along z, by differences of fourth order. Free nodes and held ones only:
frames of rigid groups turn, and their unknowns are no coordinates of a flat space."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cfem.core.errors import InputError
from cfem.equilibrium.condensation import ENOUGH, EXACT, refined
from cfem.equilibrium.explicit import explicit, row_curvatures
from cfem.equilibrium.parameter_slopes import Sides
from cfem.equilibrium.problem import Evaluation, Problem
from cfem.equilibrium.solution import Linear
from cfem.equilibrium.third_order import steepest

# Change of the displacement gradient, where it changes most, that a step along z makes. Truncation of fourth order,
# rounding 1e-16 over its square.
_STEP = 1e-3


class Field(Protocol):
    """A number of the whole deformed body, such as its largest strain."""

    def value(self, problem: Problem, at: Evaluation) -> float: ...

    def gradient(self, problem: Problem, at: Evaluation) -> np.ndarray:
        """(n, 3) by the positions of the nodes."""
        ...


@dataclass(frozen=True)
class Weights:
    """Of one number J: G (n, n) = dJ/dW, symmetric; d (n,) = dJ/d delta of all rows e, a, c, displacements from where
    each rests; rest (n_e,) = dJ/d of where the effectors rest; l (n_active,) = dJ/d lambda; fields: (dJ/d of its value,
    the field)."""

    G: np.ndarray
    d: np.ndarray
    l: np.ndarray
    rest: np.ndarray
    fields: tuple[tuple[float, Field], ...] = ()


@dataclass(frozen=True)
class Gradients:
    """dJ (k, n_q): by each parameter, of k numbers; refined: relative residual of the adjoint solves."""

    dJ: np.ndarray
    refined: float


def gradients(linear: Linear, asked: Sequence[Weights], sides: Sequence[Sides]) -> Gradients:
    """sides: of each parameter. No factorisation."""
    problem, at, lam, Z = linear.problem, linear.at, linear.lam, linear.Z
    if problem.robot.rigid or problem.body.beam is not None:
        raise InputError("adjoint gradients of a robot with rigid groups are not implemented", do="use `jacobian`")
    act, n_w = problem.robot.rows.active, problem.robot.rows.watched.stop
    g_x = np.stack([_by_state(linear, one) for one in asked], axis=1)
    s, _, _ = refined(problem, linear.data, linear.factor, g_x, EXACT)
    g_lam = np.stack([one.l + _by_multipliers(linear, one.G) for one in asked], axis=1)
    C = linear.C
    m = np.zeros((len(lam), len(asked)))
    if len(C):
        m = C.T @ np.linalg.solve(C @ linear.W[act, act] @ C.T, C @ (at.H.T @ s + g_lam))
    w, _, left = refined(problem, linear.data, linear.factor, g_x - at.H @ m, EXACT, s - Z[:, act] @ m)
    fields = list({field: None for one in asked for c, field in one.fields if c != 0.0})
    found = explicit(linear, sides, [field.value for field in fields])
    shares = np.array([[sum(c for c, each in one.fields if each is field) for field in fields] for one in asked])
    dJ = np.stack([np.tensordot(one.G, found.phi, 2) + one.d @ found.delta + one.rest @ found.rest_e for one in asked])
    of_fields = shares.reshape(len(asked), len(fields)) @ found.numbers
    return Gradients(dJ + of_fields - w.T @ found.residual - m.T @ found.delta[n_w:], left)


def accurate(found: Gradients) -> bool:
    """Whether the adjoint solves came down to what W's own solves do."""
    return found.refined <= 10 * ENOUGH


def _by_state(linear: Linear, one: Weights) -> np.ndarray:
    """(n_dof,) g_x."""
    problem, at = linear.problem, linear.at
    B = np.hstack([problem.gradients(problem.robot.watched, at.x), at.H])
    found = B @ one.d
    for factor, field in one.fields:
        if factor == 0.0:
            continue
        found = found + factor * problem.kinematics.reduce(at.x, field.gradient(problem, at))
    g, V = np.linalg.eigh(one.G)
    for share, v in zip(g, V.T, strict=True):
        if abs(share) > 1e-14 * np.abs(g).max(initial=0.0):
            found = found + share * _along(linear, v)
    return found


def _along(linear: Linear, v: np.ndarray) -> np.ndarray:
    """(n_dof,): 2 d(B v) - d^2 R along z = Z v."""
    problem, at = linear.problem, linear.at
    z = linear.Z @ v
    most = steepest(problem, problem.kinematics.spread(at.x, z))
    if most == 0.0:
        return np.zeros(len(z))
    h = _STEP / most

    def parts(k: int) -> tuple[np.ndarray, np.ndarray]:
        there = problem.evaluate(problem.kinematics.move(at.x, k * h * z), np.empty(0), at.load)
        rows = problem.gradients(problem.robot.watched, there.x)
        return np.hstack([rows, there.H]) @ v, there.residual(linear.lam)

    (B2, R2), (B1, R1), (b1, r1), (b2, r2) = (parts(k) for k in (2, 1, -1, -2))
    here = problem.evaluate(at.x, np.empty(0), at.load).residual(linear.lam)
    first = (8 * (B1 - b1) - (B2 - b2)) / (12 * h)
    second = (16 * (R1 + r1) - (R2 + r2) - 30 * here) / (12 * h * h)
    return 2 * first - second


def _by_multipliers(linear: Linear, G: np.ndarray) -> np.ndarray:
    """(n_active,) d (G : Phi) / d lambda = tr(G Z^T hess delta_j Z): A holds -lambda_j hess delta_j."""
    problem, x = linear.problem, linear.at.x
    forms = row_curvatures(problem, x, problem.kinematics.spread(x, linear.Z))
    return np.array([0.0 if form is None else np.sum(G * form) for form in forms])
