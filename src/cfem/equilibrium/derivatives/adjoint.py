"""Gradients of numbers that depend on an equilibrium and on its W, by any parameters of the robot, from one state and
its factor: one solve with the factor a number, whatever the count of parameters (the adjoint method). jacobian.py has
the derivatives of all that a state gives, at one solve a parameter.

With B = H^T of all rows, Phi = B^T Z + Z^T B - Z^T A Z is W and stationary in Z, so that a number J(W, delta, lambda,
x) changes by the partial derivatives of

    G : Phi(x, lambda, q) + d . delta(x, q) + l . lambda + J_x . x,      G = dJ/dW, d = dJ/d delta, l = dJ/d lambda,

at Z held. Its gradients g_x and g_lambda, by x and lambda, give with s = A^-1 g_x and C the rows that are held

    m = (C W C^T)^-1 C (H^T s + g_lambda)        w = s - Z C^T m
    dJ/dq = d/dq [ G : Phi + d . delta - w . R - (C^T m) . delta_active ]    at fixed x, lambda, Z, w and m,

by central differences of the robots on either side of q (explicit.py). With G = sum g v v^T and z = Z v, W enters J as
sum g (2 (B v) . z - z^T A z): a column each, as many as G has eigenvalues beyond rounding. A enters g_x by its
derivative: a column adds g (2 d(B v) - d^2 R) along z, by differences of fourth order. Numbers that are such forms
themselves, as a frequency's (vibration.py), add columns of their own. Free nodes and held ones only: frames of rigid
groups turn, and their unknowns are no coordinates of a flat space."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cfem.core.errors import InputError
from cfem.equilibrium.derivatives.explicit import Changing, Columns, explicit, row_curvatures
from cfem.equilibrium.derivatives.parameter_slopes import Sides
from cfem.equilibrium.derivatives.solved import solved
from cfem.equilibrium.derivatives.third_order import steepest
from cfem.equilibrium.system.evaluation import Evaluation
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Linearisation

# Change of the displacement gradient, where it changes most, that a step along z makes. Truncation of fourth order,
# rounding 1e-16 over its square.
_STEP = 1e-3
# Of the largest eigenvalue of dJ/dW in units of W: those below are what differences of J by W leave.
_ROUNDING = 1e-9


class DifferentiableField(Changing, Protocol):
    """A number of the whole deformed body, such as its largest strain."""

    def gradient(self, problem: Problem, evaluation: Evaluation) -> np.ndarray:
        """Gradient (n, 3) by the positions of the nodes."""
        ...


@dataclass(frozen=True)
class Weights:
    """Derivatives of one number J.

    G: (n, n) = dJ/dW, symmetric
    d: (n,) = dJ/d delta of all rows e, a, c, displacements from where each rests
    rest: (n_e,) = dJ/d of where the effectors rest
    l: (n_active,) = dJ/d lambda
    fields: (dJ/d of its value, the field)
    forms: (dJ/d of each, the forms)"""

    G: np.ndarray
    d: np.ndarray
    l: np.ndarray
    rest: np.ndarray
    fields: tuple[tuple[float, DifferentiableField], ...] = ()
    forms: tuple[tuple[float, Columns], ...] = ()


@dataclass(frozen=True)
class Gradients:
    """Gradients of k numbers. dJ (k, n_q): by each parameter; refined: relative residual of the adjoint solves."""

    dJ: np.ndarray
    refined: float


def gradients(linear: Linearisation, asked: Sequence[Weights], sides: Sequence[Sides]) -> Gradients:
    """Gradients of the numbers that are asked, by the adjoint method, without factorisation. sides: of each
    parameter."""
    problem, evaluation, lam, Z = linear.problem, linear.at, linear.lam, linear.Z
    if problem.robot.rigid or problem.body.rod is not None:
        raise InputError("adjoint gradients of a robot with rigid groups are not implemented", do="use `jacobian`")
    act, n_w = problem.robot.rows.active, problem.robot.rows.watched.stop
    shares, forms = _columns(linear, asked)
    bent = (
        np.stack([_along(linear, *each) for each in zip(forms.v.T, forms.z.T, strict=True)], axis=1)
        if len(forms.m)
        else None
    )
    g_x = np.stack([_by_state(linear, weights) for weights in asked], axis=1)
    g_lam = np.stack([weights.l for weights in asked], axis=1)
    if bent is not None:
        g_x = g_x + bent @ shares.T
        g_lam = g_lam + _by_multipliers(linear, forms.z) @ shares.T
    s, _ = solved(linear, g_x)
    C = linear.C
    m = np.zeros((len(lam), len(asked)))
    if len(C):
        m = C.T @ np.linalg.solve(C @ linear.W[act, act] @ C.T, C @ (evaluation.H.T @ s + g_lam))
    w, left = solved(linear, g_x - evaluation.H @ m, s - Z[:, act] @ m)
    fields = list({field: None for weights in asked for c, field in weights.fields if c != 0.0})
    many = len(forms.m) > len(linear.W)  # forms: then all of W costs less
    explicit_part = explicit(linear, sides, fields, _beyond(forms) if many else forms, with_phi=many)
    by = np.array([[sum(c for c, each in weights.fields if each is field) for field in fields] for weights in asked])
    dJ = np.stack([weights.d @ explicit_part.delta + weights.rest @ explicit_part.rest_e for weights in asked])
    dJ += by.reshape(len(asked), len(fields)) @ explicit_part.numbers
    if many:
        dJ += np.stack([np.tensordot(weights.G, explicit_part.phi, 2) for weights in asked])
        shares = shares[:, forms.m != 0.0]
    return Gradients(
        dJ + shares @ explicit_part.forms - w.T @ explicit_part.residual - m.T @ explicit_part.delta[n_w:], left
    )


def _beyond(forms: Columns) -> Columns:
    """The forms that are not W's own."""
    beyond_W = forms.m != 0.0
    return Columns(forms.v[:, beyond_W], forms.z[:, beyond_W], forms.m[beyond_W])


def _columns(linear: Linearisation, asked: Sequence[Weights]) -> tuple[np.ndarray, Columns]:
    """Derivatives dJ (k, c) by each form, and the c forms: of the eigenvectors of each G in units of W, then those
    asked for."""
    size = np.sqrt(np.abs(np.diag(linear.W)))
    parts, owners, factors = [], [], []
    for number, weights in enumerate(asked):
        g, V = np.linalg.eigh(weights.G * np.outer(size, size))
        kept = np.abs(g) > _ROUNDING * np.abs(g).max(initial=0.0)
        v = V[:, kept] / np.where(size > 0, size, 1.0)[:, None]
        parts.append(Columns(v, linear.Z @ v, np.zeros(v.shape[1])))
        owners += [number] * v.shape[1]
        factors += [*g[kept]]
        for factor, forms in weights.forms:
            if factor != 0.0:
                parts.append(forms)
                owners += [number] * len(forms.m)
                factors += [factor] * len(forms.m)
    shares = np.zeros((len(asked), len(owners)))
    shares[owners, np.arange(len(owners))] = factors
    arrays = (np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in ("v", "z", "m"))
    return shares, Columns(*arrays)


def _by_state(linear: Linearisation, weights: Weights) -> np.ndarray:
    """Gradient g_x (n_dof,) of a number by the unknowns."""
    problem, evaluation = linear.problem, linear.at
    B = np.hstack([problem.gradients(problem.robot.watched, evaluation.x), evaluation.H])
    gradient = B @ weights.d
    for factor, field in weights.fields:
        if factor == 0.0:
            continue
        gradient = gradient + factor * problem.kinematics.reduce(evaluation.x, field.gradient(problem, evaluation))
    return gradient


def _along(linear: Linearisation, v: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Second derivative (n_dof,) along z: 2 d(B v) - d^2 R."""
    problem, evaluation = linear.problem, linear.at
    most = steepest(problem, problem.kinematics.spread(evaluation.x, z))
    if most == 0.0:
        return np.zeros(len(z))
    h = _STEP / most

    def parts(k: int) -> tuple[np.ndarray, np.ndarray]:
        moved = problem.evaluate(problem.kinematics.move(evaluation.x, k * h * z), np.empty(0), evaluation.load)
        rows = problem.gradients(problem.robot.watched, moved.x)
        return np.hstack([rows, moved.H]) @ v, moved.residual(linear.lam)

    (B2, R2), (B1, R1), (b1, r1), (b2, r2) = (parts(k) for k in (2, 1, -1, -2))
    middle = problem.evaluate(evaluation.x, np.empty(0), evaluation.load).residual(linear.lam)
    first = (8 * (B1 - b1) - (B2 - b2)) / (12 * h)
    second = (16 * (R1 + r1) - (R2 + r2) - 30 * middle) / (12 * h * h)
    return 2 * first - second


def _by_multipliers(linear: Linearisation, z: np.ndarray) -> np.ndarray:
    """(n_active, c) z^T hess delta_j z of the columns z (n_dof, c): A holds -lambda_j hess delta_j."""
    problem, x = linear.problem, linear.at.x
    forms = row_curvatures(problem, x, problem.kinematics.spread(x, z))
    return np.array([np.zeros(z.shape[1]) if form is None else np.diag(form) for form in forms])
