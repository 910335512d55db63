"""What the condensed model needs to move: mass and viscosity on the motions that its rows make, at one equilibrium.

With B = H^T (all rows as columns) and Z = A^-1 B, the dynamic compliance at angular frequency w is

    B^T (A - w^2 M)^-1 B = W + w^2 V + w^4 V2 + w^6 V3 + ...    V = Z^T M Z,  V2 = Z^T M Y,  V3 = Y^T M Y,  Y = A^-1 M Z

On the motions (Z, Y) stiffness is [[W, V], [V, V2]] and mass [[V, V2], [V2, V3]]: a Galerkin model whose lowest
frequencies are from above, exact to the fourth moment (Craig, Int. J. Numer. Methods Eng. 1968; Bai, Appl. Numer. Math.
43, 2002). Y costs a few triangular solves more than Z, and no factorisation.

A robot of sections in a row has inner motions instead (inner_motions.py), which cost a few solves, and V alone of the
rows."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cfem.core.errors import InputError
from cfem.equilibrium.condensation import ENOUGH, Condensation, refined
from cfem.equilibrium.system.evaluation import Evaluation, SolveCost
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics import viscosity as viscous
from cfem.mechanics.mass import mass_matrix

# Residual of Y, and what a correction of it may leave: of (Z, Y) the softest motions are 1e9 times as soft as the
# stiffest that are kept (cfem.surrogate.inner_motions), and an error of V3 makes vibrations of these that are none
RESIDUAL, PAYS = 1e-10, 0.5


@dataclass(frozen=True)
class Inertia:
    """Mass and viscosity of the condensed model.

    V, V2, V3: (n, n) symmetric, of rows e, a, c; an entry has the unit of W's times s^2, s^4, s^6
    loss: (k, 2 n, 2 n), for each viscous material the stiffness that resists shear, on the motions (Z, Y): times
    Viscosity.modulus it is storage and loss
    dV: (n_active, n, n) dV/dlambda along the equilibrium path, None where it was not asked for
    V2, V3, loss: None where there are inner motions"""

    V: np.ndarray
    V2: np.ndarray | None
    V3: np.ndarray | None
    loss: np.ndarray | None
    dV: np.ndarray | None = None
    inner: "Inner | None" = None


@dataclass(frozen=True)
class Inner:
    """Quasi-static motions of the actuators, a unit of displacement each, and k inner motions that leave the actuators
    alone.

    K: (k, k) N mm, stiffness of the inner motions
    M: (n_a + k, n_a + k), mass of both
    loss: (j, n_a + k, n_a + k) of each viscous material, as in `Inertia`
    e: (n_e, k) mm, motion of the effectors by the inner ones"""

    K: np.ndarray
    M: np.ndarray
    loss: np.ndarray
    e: np.ndarray


def mass_of(robot: Robot) -> sp.csr_array:
    """Mass (n, n) t, the same in each direction. InputError where a material has no density."""
    if robot.density is None:
        raise InputError(
            f"robot {robot.name} has no density, and what moves needs its mass",
            do="give each material of the scene its density, such as '1070 kg/m^3'",
        )
    return mass_matrix(robot.body, robot.density)


def inertia(
    problem: Problem,
    mass: sp.csr_array,
    evaluation: Evaluation,
    condensation: Condensation,
    stressed: tuple[np.ndarray, np.ndarray] | None = None,
    derivatives: bool = False,
    cost: SolveCost | None = None,
) -> tuple[Inertia, np.ndarray | None]:
    """Inertia of the equilibrium that was condensed, and Y (n_dof, n), None where it is not needed. A factorisation is
    made only where that of the condensation is too far from the state.

    mass: of `mass_of`
    stressed: for inner motions, the forces (n_dof, k) of the stresses of `inner_motions.rod_stresses` and A^-1 of them
    derivatives: whether dV will be asked for; cost: counts the work"""
    Z, Y, symmetric = condensation.Z, None, lambda each: (each + each.T) / 2
    G = None if stressed is None else _answers(problem, evaluation, condensation, *stressed)
    heavy = times_mass(problem, mass, evaluation.x, Z if G is None else np.hstack([Z, G.motions]))
    by_rows = heavy[:, : Z.shape[1]]
    if G is None or derivatives:
        Y, rest, error = refined(problem, condensation.data, condensation.factor, by_rows, RESIDUAL, pays=PAYS)
        if error > ENOUGH:
            factor = problem.factor(evaluation, condensation.condensed.lam, cost or SolveCost()).factor
            Y, rest, _ = refined(problem, condensation.data, factor, by_rows, RESIDUAL, Y, PAYS)
    V = symmetric(Z.T @ by_rows)
    if G is not None:
        return Inertia(V, None, None, None, inner=_inner(problem, evaluation, condensation, G, heavy)), Y
    V2 = Y.T @ (heavy + rest)  # stationary in Y, as W is in Z
    V3 = Y.T @ times_mass(problem, mass, evaluation.x, Y)
    return Inertia(V, symmetric(V2), symmetric(V3), loss_forms(problem, evaluation, np.hstack([Z, Y]))), Y


@dataclass(frozen=True)
class _Answers:
    """Answers to stresses: motions (n_dof, k) that leave the actuators alone, under the forces (n_dof, k) of stresses;
    quasi (n_dof, n_a): quasi-static motions of the actuators."""

    motions: np.ndarray
    pulls: np.ndarray
    quasi: np.ndarray


def _answers(
    problem: Problem, evaluation: Evaluation, condensation: Condensation, pulls: np.ndarray, G: np.ndarray
) -> _Answers:
    rows, W = problem.robot.rows, condensation.condensed.W
    X = condensation.Z[:, rows.a] @ np.linalg.inv(W[rows.a, rows.a])
    return _Answers(G - X @ (evaluation.H[:, : rows.n_a].T @ G), pulls, X)


def _inner(
    problem: Problem, evaluation: Evaluation, condensation: Condensation, answers: _Answers, heavy: np.ndarray
) -> Inner:
    """Quasi-static and inner motions. heavy: mass times Z of all rows and the inner motions."""
    rows, n = problem.robot.rows, condensation.Z.shape[1]
    K_aa = np.linalg.inv(condensation.condensed.W[rows.a, rows.a])
    both = np.hstack([answers.quasi, answers.motions])
    M, K = both.T @ np.hstack([heavy[:, rows.a] @ K_aa, heavy[:, n:]]), answers.pulls.T @ answers.motions
    e = problem.gradients(problem.robot.effectors, evaluation.x).T @ answers.motions
    return Inner((K + K.T) / 2, (M + M.T) / 2, loss_forms(problem, evaluation, both), e)


def times_mass(problem: Problem, mass: sp.csr_array, x: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Products (n_dof, k) T^T M T q with changes q (n_dof, k) of the unknowns."""
    heavy = np.diff(mass.indptr) > 0  # of the nodes of a rod's section, three
    motions = problem.kinematics.spread(x, q, heavy)
    return problem.kinematics.reduce(x, (mass @ motions.reshape(len(x), -1)).reshape(motions.shape), heavy)


def loss_forms(problem: Problem, evaluation: Evaluation, q: np.ndarray) -> np.ndarray:
    """Forms (k, m, m) N mm of changes q (n_dof, m) in each viscous material's resistance to shear."""
    body, numbers = problem.body, viscous_materials(problem.robot)
    forms = np.zeros((len(numbers), q.shape[1], q.shape[1]))
    if not len(numbers):
        return forms
    motions = problem.kinematics.spread(evaluation.x, q) if body.solids else np.zeros((0, 3, q.shape[1]))
    for index, number in enumerate(numbers):
        unit = viscous.damping(body, evaluation.response, number)
        forms[index] = viscous.solid_form(body, evaluation.response, unit, motions)
        if evaluation.response.rod is not None:
            forms[index] += problem.rod_form(viscous.rod_stiffness(body, evaluation.response, unit), q)
    return forms


def viscous_materials(robot: Robot) -> list[int]:
    """Numbers of the materials that are viscous."""
    return [number for number, each in enumerate(robot.viscosity) if not each.none]
