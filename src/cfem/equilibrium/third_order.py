"""dW/dlambda: how the compliance changes along the equilibrium path, without a new factorisation.

With B = H^T (all rows as columns) and Z = A^-1 B, the expression B^T Z + Z^T B - Z^T A Z is W, and stationary in Z: its
derivative along the path, where one multiplier changes and x follows by dx/dlambda = Z_k, is that of W even with Z
held. It is a central difference on the straight line x + h Z_k, off equilibrium by h^2 alike on either side. Z^T A Z is
summed from strains (Problem.form): with A itself the difference would lose three digits more to rounding."""

import numpy as np
import scipy.sparse as sp

from cfem.equilibrium.problem import Evaluation, Problem

# Change of the displacement gradient, where it changes most, that a step makes. Truncation grows with its square,
# rounding with its inverse, both with the bulk modulus: of dW 2e-8 at nu = 0.3, 3e-7 at 0.49, 1e-6 at 0.499 (finger).
_STEP = 2e-5


def compliance_derivatives(
    problem: Problem,
    at: Evaluation,
    lam: np.ndarray,
    Z: np.ndarray,
    Y: np.ndarray | None = None,
    mass: sp.csr_array | None = None,
) -> tuple[np.ndarray, np.ndarray | None]:
    """(n_active, n, n): dW/dlambda_k of all rows at an equilibrium, total, other multipliers constant; mm/N^2
    for cables. Z (n_dof, n) = A^-1 H^T of all rows there, to 1e-7 or better. With Y = A^-1 M Z and the mass M also
    dV/dlambda_k of V = Z^T M Z, whose expression Z^T M Z + Y^T (B - A Z) + (B - A Z)^T Y is stationary in Z."""
    motions = Z[:, problem.robot.rows.active].T
    units = np.eye(len(motions))
    found = [derivative_along(problem, at, lam, Z, *each, Y, mass) for each in zip(units, motions, strict=True)]
    n = Z.shape[1]
    dW = np.stack([each[:, :n] for each in found])
    return dW, None if Y is None else np.stack([each[:, n:] for each in found])


def derivative_along(
    problem: Problem,
    at: Evaluation,
    lam: np.ndarray,
    Z: np.ndarray,
    changing: np.ndarray,
    motion: np.ndarray,
    Y: np.ndarray | None = None,
    mass: sp.csr_array | None = None,
) -> np.ndarray:
    """(n, n) of W, or (n, 2 n) of W and V: where the multipliers change by `changing` (n_active,) and the unknowns move
    by `motion` (n_dof,)."""
    n, q = Z.shape[1], Z if Y is None else np.hstack([Z, Y])

    def compliance(h: float) -> np.ndarray:
        """B^T Z + Z^T B - Z^T A Z, with the element pressures that x demands; and that of V."""
        there = problem.evaluate(problem.kinematics.move(at.x, h * motion), np.empty(0), at.load)
        changed = lam + h * changing
        B = np.hstack([problem.gradients(problem.robot.watched, there.x), there.H])
        BZ, form = B.T @ Z, problem.form(there, changed, q)
        W = BZ + BZ.T - form[:n, :n]
        if Y is None:
            return W
        YB = Y.T @ B - form[n:, :n]
        moved = problem.kinematics.spread(there.x, Z)
        own = np.tensordot(moved, (mass @ moved.reshape(len(moved), -1)).reshape(moved.shape), axes=((0, 1), (0, 1)))
        return np.hstack([W, own + YB + YB.T])

    most = steepest(problem, problem.kinematics.spread(at.x, motion))
    if most == 0.0:
        return np.zeros((n, q.shape[1]))  # attached to held nodes only
    h = _STEP / most
    return (compliance(h) - compliance(-h)) / (2 * h)


def steepest(problem: Problem, moved: np.ndarray) -> float:
    """1/N: largest change of a cell's displacement gradient, about, with the nodes' motion (n, 3) mm/N."""
    sections = problem.body.sections
    if sections is not None:
        apart = np.diff(moved[sections.nodes], axis=0) / sections.apart[:, None, None]
        return float(np.sqrt((apart**2).sum(axis=2).max()))
    cells, X = problem.body.cells, problem.rest
    spans = np.linalg.norm(np.ptp(moved[cells], axis=1), axis=1)
    return float((spans / np.linalg.norm(np.ptp(X[cells], axis=1), axis=1)).max())
