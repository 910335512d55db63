"""dW/dlambda: how the compliance changes along the equilibrium path, without a new factorisation.

With B = H^T (all rows as columns) and Z = A^-1 B, the expression B^T Z + Z^T B - Z^T A Z is W, and stationary in Z: its
derivative along the path, where one multiplier changes and x follows by dx/dlambda = Z_k, is that of W even with Z
held. It is a central difference on the straight line x + h Z_k, off equilibrium by h^2 alike on either side. Z^T A Z is
summed from strains (Problem.form): with A itself the difference would lose three digits more to rounding."""

import numpy as np

from cfem.equilibrium.problem import Evaluation, Problem

# Change of the displacement gradient, where it changes most, that a step makes. Truncation grows with its square,
# rounding with its inverse, both with the bulk modulus: of dW 2e-8 at nu = 0.3, 3e-7 at 0.49, 1e-6 at 0.499 (finger).
_STEP = 2e-5


def compliance_derivatives(problem: Problem, at: Evaluation, lam: np.ndarray, Z: np.ndarray) -> np.ndarray:
    """(n_active, n, n): dW/dlambda_k of all rows e, a, c at an equilibrium, total, other multipliers constant; mm/N^2
    for cables. Z (n_dof, n) = A^-1 H^T of all rows there, to 1e-7 or better."""
    motions = Z[:, problem.robot.rows.active].T
    return np.stack([_along(problem, at, lam, Z, k, motion) for k, motion in enumerate(motions)])


def _along(problem: Problem, at: Evaluation, lam: np.ndarray, Z: np.ndarray, k: int, motion: np.ndarray) -> np.ndarray:
    """(n, n): by multiplier k, with which the unknowns move by `motion` (n_dof,) mm/N."""

    def compliance(h: float) -> np.ndarray:
        """B^T Z + Z^T B - Z^T A Z, with the element pressures that x demands."""
        there = problem.evaluate(problem.kinematics.move(at.x, h * motion), np.empty(0), at.load)
        changed = lam.copy()
        changed[k] += h
        BZ = np.hstack([problem.gradients(problem.robot.effectors, there.x), there.H]).T @ Z
        return BZ + BZ.T - problem.form(there, changed, Z)

    steepest = _steepest(problem, problem.kinematics.spread(at.x, motion))
    if steepest == 0.0:
        return np.zeros((Z.shape[1], Z.shape[1]))  # attached to held nodes only
    h = _STEP / steepest
    return (compliance(h) - compliance(-h)) / (2 * h)


def _steepest(problem: Problem, moved: np.ndarray) -> float:
    """1/N: largest change of a cell's displacement gradient, about, with the nodes' motion (n, 3) mm/N."""
    sections = problem.body.sections
    if sections is not None:
        apart = np.diff(moved[sections.nodes], axis=0) / sections.apart[:, None, None]
        return float(np.sqrt((apart**2).sum(axis=2).max()))
    cells, X = problem.body.cells, problem.rest
    spans = np.linalg.norm(np.ptp(moved[cells], axis=1), axis=1)
    return float((spans / np.linalg.norm(np.ptp(X[cells], axis=1), axis=1)).max())
