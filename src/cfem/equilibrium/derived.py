"""What is asked of a converged state beside the state itself: W, its derivatives, inertia, slopes by parameters. All of
it comes from the one factorisation of the condensation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from cfem.condensed import Condensed
from cfem.condensed.discrepancy import corrected
from cfem.constraint.protocol import Watched
from cfem.equilibrium.condensation import condense, response
from cfem.equilibrium.derivatives.fourth_order import load_curvatures
from cfem.equilibrium.derivatives.parameter_slopes import ParameterSlopes, Sides, differences, parameter_slopes
from cfem.equilibrium.derivatives.third_order import compliance_derivatives, load_derivatives
from cfem.equilibrium.motion.inertia import Inertia, inertia
from cfem.equilibrium.newton import NewtonResult
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.evaluation import SolveCost
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import demand_without_discrepancy
from cfem.equilibrium.system.solution import Linearisation


@dataclass(frozen=True)
class Wanted:
    """What is asked of a converged state beside itself.

    condense: W and delta_free
    third_order: the derivatives of W
    sides: the slopes by the parameters in which these problems differ from that of the state
    mass: (n, n) t of the nodes, for what the rows need to move (motion/inertia.py)
    pushed: rows; about how all nodes yield to forces on them, by the factor at hand
    keep: what further derivatives start from
    loads: so many derivatives, of at most two, of the effectors' compliance by loads on them
    stresses: with mass, of the inner motions of a robot of sections in a row (motion/inner_motions.py)"""

    condense: bool = True
    third_order: bool = False
    sides: Sequence[Sides] = ()
    mass: sp.csr_array | None = None
    pushed: Watched | None = None
    keep: bool = False
    loads: int = 0
    stresses: np.ndarray | None = None


W_ALONE = Wanted()


@dataclass(frozen=True)
class Derived:
    """Fields of `Equilibrium` with these names; None where not asked for."""

    condensed: Condensed | None = None
    response: np.ndarray | None = None
    push_response: np.ndarray | None = None
    dW: np.ndarray | None = None
    dC: np.ndarray | None = None
    d2C: np.ndarray | None = None
    slopes: ParameterSlopes | None = None
    inertia: Inertia | None = None
    linear: Linearisation | None = None


def derive(
    problem: Problem, result: NewtonResult, actuation: Actuation, wanted: Wanted, enough: float, cost: SolveCost
) -> tuple[Derived, bool]:
    """Derived quantities of a converged state, and whether it is stable with the rows of the actuation held; W alone
    where it is not. enough: relative error of A^-1 H^T. Raises SingularMatrixError."""
    evaluation, lam, active = result.at, result.lam, problem.robot.rows.active
    by_q = differences(problem, evaluation, lam, wanted.sides) if wanted.sides else None
    by_sides = by_q.residual if by_q else np.zeros((problem.pattern.n_dof, 0))
    pulls = by_sides[:, :0] if wanted.stresses is None else problem.rod_forces(evaluation, wanted.stresses)
    condensation = condense(problem, evaluation, lam, result.tangent, cost, np.hstack([by_sides, pulls]), enough)
    W, moved_by_sides, answers = condensation.condensed.W, *np.split(condensation.y, [by_sides.shape[1]], axis=1)
    pushed = None
    if wanted.pushed is not None:
        moved = condensation.factor.solve(problem.gradients((wanted.pushed,), evaluation.x))
        pushed = problem.kinematics.spread(evaluation.x, moved)
    seen, lacks = condensation.condensed, problem.robot.discrepancy
    if lacks is not None:
        asked = {
            "contact points": len(problem.robot.contacts) > 0,
            "slopes by parameters": len(wanted.sides) > 0,
            "mass": wanted.mass is not None,
            "loads": wanted.loads > 0,
        }
        for what in (name for name, is_asked in asked.items() if is_asked):
            demand_without_discrepancy(problem.robot, what)
        seen, _ = corrected(condensation.condensed, lacks, None)
    derived = Derived(seen, response(problem, evaluation, condensation.Z, active), pushed)
    # stable with those rows held if A has no more negative eigenvalues than C W C^T (Haynsworth's inertia)
    held = actuation.C @ W[active, active] @ actuation.C.T
    if condensation.factor.negative > (np.linalg.eigvalsh(held) < 0).sum():
        return derived, False
    moves = Y = dW = dC = None
    if wanted.mass is not None:
        stressed = None if wanted.stresses is None else (pulls, answers)
        moves, Y = inertia(problem, wanted.mass, evaluation, condensation, stressed, wanted.third_order, cost)
    if wanted.third_order:
        dW, dV = compliance_derivatives(problem, evaluation, lam, condensation.Z, Y, wanted.mass)
        moves = moves and replace(moves, dV=dV)
        if lacks is not None:
            _, dW = corrected(condensation.condensed, lacks, dW)
    if wanted.loads:
        dC = load_derivatives(problem, evaluation, lam, condensation.Z, W)
    slopes = parameter_slopes(problem, evaluation, W, condensation.Z, by_q, moved_by_sides) if by_q else None
    linear = Linearisation(
        problem, evaluation, lam, condensation.Z, condensation.factor, condensation.data, actuation.C, W
    )
    d2C = load_curvatures(linear) if wanted.loads > 1 else None
    kept = linear if wanted.keep else None
    return replace(derived, dW=dW, dC=dC, d2C=d2C, slopes=slopes, inertia=moves, linear=kept), True
