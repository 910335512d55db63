"""Cause of the end of a load path: limit point, bifurcation, or neither, from the softest mode of the tangent
stiffness.

At a critical state the tangent, restricted to motions that the actuation leaves free, has a vanishing eigenvalue with
mode v. Where the load works on v (b . v != 0) the path turns back: a limit point. Where it does not, another branch
crosses: a bifurcation (Wriggers, Nonlinear Finite Element Methods, 2008, section 7.1)."""

import numpy as np

from cfem.equilibrium.newton import NewtonResult
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Status

_ITERATIONS = 60
# What the load does on the mode, below which it does not drive it: meshes are not symmetric to the last digit.
_DRIVEN = 1e-2


def softest_mode(problem: Problem, result: NewtonResult, actuation: Actuation) -> tuple[float, np.ndarray, np.ndarray]:
    """Eigenvalue (N/mm) of the smallest magnitude of A on motions with C H^T v = 0, its unit mode v (n_dof,), and the
    reactions r (m,) with A v + H C^T r = eigenvalue v; by inverse iteration with the factor at hand."""
    solve = result.tangent.factor.solve
    HC = result.at.H @ actuation.C.T
    ZC = solve(HC) if HC.shape[1] else HC
    S = HC.T @ ZC

    def restricted(b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        v = solve(b[:, None])[:, 0]
        reactions = np.linalg.solve(S, HC.T @ v) if len(S) else np.zeros(0)
        return v - ZC @ reactions, reactions

    v, _ = restricted(np.cos(1.7 * np.arange(problem.pattern.n_dof)))
    v /= np.linalg.norm(v)
    inverse = np.inf
    for _ in range(_ITERATIONS):
        answer, reactions = restricted(v)
        before, inverse = inverse, float(v @ answer)
        v = answer / np.linalg.norm(answer)
        if abs(inverse - before) <= 1e-6 * abs(inverse):
            break
    return 1.0 / inverse, v, reactions / inverse


def classify(problem: Problem, result: NewtonResult, actuation: Actuation, stiffness: float) -> Status | None:
    """LIMIT_POINT or BIFURCATION where the state of `result` is near one, judged against `stiffness`, the softest
    eigenvalue at rest (N/mm); None where the softest mode is not soft."""
    try:
        value, mode, reactions = softest_mode(problem, result, actuation)
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(value) or abs(value) > 0.2 * abs(stiffness):
        return None
    forces = result.at.H @ actuation.offset
    if problem.loads is not None:
        forces = forces + actuation.load * problem.kinematics.reduce(result.at.x, problem.loads)
    by_force = abs(forces @ mode) > _DRIVEN * np.linalg.norm(forces) / np.sqrt(len(mode))
    reaction = np.linalg.norm(result.at.H @ (actuation.C.T @ reactions))
    by_displacement = reaction > _DRIVEN * abs(stiffness)
    return Status.LIMIT_POINT if by_force or by_displacement else Status.BIFURCATION
