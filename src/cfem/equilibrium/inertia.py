"""What the condensed model needs to move: mass and viscosity on the motions that its rows make, at one equilibrium.

With B = H^T (all rows as columns) and Z = A^-1 B, the dynamic compliance at angular frequency w is

    B^T (A - w^2 M)^-1 B = W + w^2 V + w^4 V2 + w^6 V3 + ...    V = Z^T M Z,  V2 = Z^T M Y,  V3 = Y^T M Y,  Y = A^-1 M Z

On the motions (Z, Y) stiffness is [[W, V], [V, V2]] and mass [[V, V2], [V2, V3]]: a Galerkin model whose lowest
frequencies are from above, exact to the fourth moment (Craig, Int. J. Numer. Methods Eng. 1968; Bai, Appl. Numer. Math.
43, 2002). Y costs as many triangular solves as Z, and no factorisation."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cfem.core.errors import InputError
from cfem.equilibrium.condensation import Condensation, refined
from cfem.equilibrium.problem import Evaluation, Problem
from cfem.equilibrium.robot import Robot
from cfem.mechanics import viscosity as viscous
from cfem.mechanics.mass import mass_matrix


@dataclass(frozen=True)
class Inertia:
    """V, V2, V3: (n, n) symmetric, of rows e, a, c; an entry has the unit of W's times s^2, s^4, s^6.
    loss: (k, 2 n, 2 n), for each viscous material the stiffness that resists shear, on the motions (Z, Y): times
    Viscosity.modulus it is storage and loss. dV: (n_active, n, n) dV/dlambda along the equilibrium path, None where it
    was not asked for."""

    V: np.ndarray
    V2: np.ndarray
    V3: np.ndarray
    loss: np.ndarray
    dV: np.ndarray | None = None


def mass_of(robot: Robot) -> sp.csr_array:
    """(n, n) t in each direction. InputError where a material has no density."""
    if robot.density is None:
        raise InputError(
            f"robot {robot.name} has no density, and what moves needs its mass",
            do="give each material of the scene its density, such as '1070 kg/m^3'",
        )
    return mass_matrix(robot.body, robot.density)


def inertia(
    problem: Problem, mass: sp.csr_array, at: Evaluation, condensation: Condensation
) -> tuple[Inertia, np.ndarray]:
    """Of the equilibrium that was condensed, without a factorisation, and Y (n_dof, n). mass: of `mass_of`."""
    Z = condensation.Z
    heavy = times_mass(problem, mass, at.x, Z)
    Y = refined(problem, condensation.data, condensation.factor, heavy)[0]
    V, V2, V3 = Z.T @ heavy, Y.T @ heavy, Y.T @ times_mass(problem, mass, at.x, Y)
    loss = loss_forms(problem, at, np.hstack([Z, Y]))
    return Inertia(*((each + each.T) / 2 for each in (V, V2, V3)), loss), Y


def times_mass(problem: Problem, mass: sp.csr_array, x: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(n_dof, k): T^T M T of changes q (n_dof, k) of the unknowns."""
    motions = problem.kinematics.spread(x, q)
    return problem.kinematics.reduce(x, (mass @ motions.reshape(len(x), -1)).reshape(motions.shape))


def loss_forms(problem: Problem, at: Evaluation, q: np.ndarray) -> np.ndarray:
    """(k, m, m) N mm: of changes q (n_dof, m) in each viscous material's resistance to shear."""
    body, numbers = problem.body, viscous_materials(problem.robot)
    forms = np.zeros((len(numbers), q.shape[1], q.shape[1]))
    if not len(numbers):
        return forms
    motions = problem.kinematics.spread(at.x, q)
    for index, number in enumerate(numbers):
        unit = viscous.damping(body, at.response, number)
        forms[index] = viscous.solid_form(body, at.response, unit, motions)
        if at.response.beam is not None:
            forms[index] += problem.rod_form(viscous.rod_stiffness(body, at.response, unit), q)
    return forms


def viscous_materials(robot: Robot) -> list[int]:
    """Numbers of the materials that are viscous."""
    return [number for number, each in enumerate(robot.viscosity) if not each.none]
