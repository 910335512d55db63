"""How an equilibrium follows a parameter q of its robot, at constant delta_a, from one state and its factor.

With R, delta and the Lagrangian L = U - f_ext . u - lambda . delta of robots on either side differenced at the fixed
state (x, lambda), element pressures eliminated in each:

    dPsi/dq = dL/dq        dlambda/dq = -W_aa^-1 (ddelta/dq - H_a^T y)        du/dq = -y + A^-1 H_a dlambda/dq,

y = A^-1 dR/dq; the first because L is stationary in the state (envelope theorem). Effectors and skin move as du/dq
moves them and as they themselves differ. Contacts stay free of force."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.equilibrium.system.evaluation import Evaluation
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import watched_displacements
from cfem.equilibrium.system.solution import ParameterSlopes


@dataclass(frozen=True)
class Sides:
    """Two problems that differ from the one at hand in one parameter, on either side of it, by `width` in all."""

    behind: Problem
    ahead: Problem
    width: float


@dataclass(frozen=True)
class Differences:
    """Derivatives at the fixed state by each parameter.

    residual: (n_dof, n_q) of R
    delta: (n_active, n_q)
    watched: (n_e + n_s, n_q) of the effectors and the skin
    lagrangian: (n_q,)"""

    residual: np.ndarray
    delta: np.ndarray
    watched: np.ndarray
    lagrangian: np.ndarray


def differences(problem: Problem, evaluation: Evaluation, lam: np.ndarray, sides: Sequence[Sides]) -> Differences:
    """Derivatives at the fixed state, by central differences of the robots on either side, at the same displacements of
    the nodes from their rest."""

    def parts(side: Problem) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        x = evaluation.x if side.rest is problem.rest else evaluation.x + (side.rest - problem.rest)
        moved = side.evaluate(x, np.empty(0), evaluation.load)
        lagrangian = side.potential(moved) - float(lam @ moved.delta)
        return moved.residual(lam), moved.delta, watched_displacements(side.robot, x), lagrangian

    pairs = [(parts(side.behind), parts(side.ahead), side.width) for side in sides]
    columns = [
        [(after - before) / width for before, after in zip(behind, ahead, strict=True)]
        for behind, ahead, width in pairs
    ]
    return Differences(*(np.stack(column, axis=-1) for column in zip(*columns, strict=True)))


def parameter_slopes(
    problem: Problem, evaluation: Evaluation, W: np.ndarray, Z: np.ndarray, fixed: Differences, y: np.ndarray
) -> ParameterSlopes:
    """Slopes of an equilibrium by parameters. W (n, n) and Z (n_dof, n) = A^-1 H^T of all rows; y (n_dof, n_q) = A^-1
    of the differences of R."""
    a = problem.robot.rows.a
    n_a = a.stop - a.start
    lam = -np.linalg.solve(W[a, a], fixed.delta[:n_a] - evaluation.H[:, :n_a].T @ y)
    motion = Z[:, a] @ lam - y
    watched = fixed.watched + problem.gradients(problem.robot.watched, evaluation.x).T @ motion
    delta_e, delta_s = np.split(watched, [problem.robot.rows.n_e])
    return ParameterSlopes(fixed.lagrangian, lam, delta_e, problem.kinematics.spread(evaluation.x, motion), delta_s)
