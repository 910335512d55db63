"""Natural frequencies and damping of small vibrations about an equilibrium, of the full model.

(A - omega^2 M) phi = 0 on motions that the actuation leaves free (equilibrium/motion/vibration.py).
Viscosity is taken in to first order: each mode keeps its shape, stiffened and damped by the moduli at its frequency."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed.viscosity import stiffened
from cfem.core.errors import NumericalError
from cfem.equilibrium.motion.vibration import lowest_modes
from cfem.equilibrium.system.actuation import Actuation, displacement
from cfem.equilibrium.system.evaluation import Evaluation, SolveCost
from cfem.equilibrium.system.solution import State
from cfem.fe_motion.problem import MovingProblem
from cfem.mechanics import viscosity as viscous
from cfem.mechanics.assembly import symmetric_product


@dataclass(frozen=True)
class Modes:
    """Small vibrations, lowest first.

    frequency: (k,) Hz, undamped where there is no viscosity
    damping: (k,) share of the critical
    shapes: (n, 3, k) mm of the nodes, of kinetic energy 1/2 at 1 mm/s, and mass 1 t"""

    frequency: np.ndarray
    damping: np.ndarray
    shapes: np.ndarray


def natural_modes(
    problem: MovingProblem, state: State, count: int = 3, held: Actuation | None = None, cost: SolveCost | None = None
) -> Modes:
    """Modes about an equilibrium, the `count` lowest. held: whose rows C are held still (all active rows unless given;
    `force(...)` leaves all free). NumericalError where the equilibrium is unstable with those rows held."""
    evaluation = problem.evaluate(state.x, np.empty(0), state.load)
    C = (displacement(np.zeros(problem.n_active)) if held is None else held.padded(problem.n_active)).C
    solve = problem.factor(evaluation, state.lam, cost or SolveCost()).factor.solve
    mass = problem.mass_data(evaluation.x)
    n = problem.pattern.n_dof

    def heavy(b: np.ndarray) -> np.ndarray:
        return symmetric_product(problem.pattern, mass, b.reshape(n, -1))

    squares, shapes, _ = lowest_modes(solve, evaluation.H @ C.T, heavy, n, count)
    count = len(squares)
    if not (squares > 0).all():
        raise NumericalError(
            f"{int((squares <= 0).sum())} of the {count} lowest modes grow instead of vibrating: the equilibrium is "
            "unstable",
            do="hold the actuators that it is stable with, or take another state",
        )
    squares, lost = _with_viscosity(problem, evaluation, squares, shapes)
    omega = np.sqrt(squares)
    return Modes(omega / (2 * np.pi), lost / (2 * squares), problem.kinematics.spread(evaluation.x, shapes))


def _with_viscosity(
    problem: MovingProblem, evaluation: Evaluation, squares: np.ndarray, shapes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Squares omega^2 (k,) with the stiffness that viscosity stores at each frequency, and phi . loss . phi (k,),
    1/s^2."""
    by_material = []
    for number in range(len(problem.viscosity)):
        data = problem.overstress_data(evaluation, viscous.damping(problem.body, evaluation.response, number))
        by_material.append((shapes * symmetric_product(problem.pattern, data, shapes)).sum(axis=0))
    return stiffened(squares, problem.viscosity, by_material)
