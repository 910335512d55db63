"""dW/dlambda: how the compliance changes along the equilibrium path, without a new factorisation.

With B = H^T (all rows as columns) and Z = A^-1 B, the expression B^T Z + Z^T B - Z^T A Z is W, and stationary in Z: its
derivative along the path, where one multiplier changes and x follows by dx/dlambda = Z_k, is that of W even with Z
held. It is a central difference on the straight line x + h Z_k, off equilibrium by h^2 alike on either side. Z^T A Z is
summed from strains (Problem.form): with A itself the difference would lose three digits more to rounding."""

from itertools import permutations

import numpy as np
import scipy.sparse as sp

from cfem.equilibrium.system.evaluation import Evaluation
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Linearisation
from cfem.mechanics.kinematics import change_of_work, levers

# Change of the displacement gradient, where it changes most, that a step makes. Truncation grows with its square,
# rounding with its inverse, both with the bulk modulus: of dW 2e-8 at nu = 0.3, 3e-7 at 0.49, 1e-6 at 0.499 (finger).
STEP = 2e-5


def compliance_derivatives(
    problem: Problem,
    evaluation: Evaluation,
    lam: np.ndarray,
    Z: np.ndarray,
    Y: np.ndarray | None = None,
    mass: sp.csr_array | None = None,
) -> tuple[np.ndarray, np.ndarray | None]:
    """Derivatives dW/dlambda_k (n_active, n, n) of all rows at an equilibrium, total, other multipliers constant;
    mm/N^2 for cables. Z (n_dof, n) = A^-1 H^T of all rows there, to 1e-7 or better. With Y = A^-1 M Z and the mass M
    also dV/dlambda_k of V = Z^T M Z, whose expression Z^T M Z + Y^T (B - A Z) + (B - A Z)^T Y is stationary in Z."""
    motions = Z[:, problem.robot.rows.active].T
    units, skin = np.eye(len(motions)), SkinRowsChange(problem, evaluation)
    along = [
        derivative_along(problem, evaluation, lam, Z, *each, Y, mass, skin) for each in zip(units, motions, strict=True)
    ]
    n = Z.shape[1]
    dW = np.stack([each[:, :n] for each in along])
    return dW, None if Y is None else np.stack([each[:, n:] for each in along])


class SkinRowsChange:
    """Rows of a skin in the derivative: their forces on nodes are constant, so that their columns of B change by the
    turning of rigid groups alone, exactly."""

    def __init__(self, problem: Problem, evaluation: Evaluation):
        self.rows, self._kinematics, skin = problem.robot.rows.s, problem.kinematics, problem.robot.skin
        self.levers = None
        if skin is not None and problem.robot.rigid:
            self.levers = levers(problem.kinematics, evaluation.x, skin.nodes, skin.gradient(evaluation.x))

    def change(self, motion: np.ndarray, q: np.ndarray) -> np.ndarray | float:
        """(n_s, c): of B_s^T q with the motion (n_dof,) of the unknowns; q (n_dof, c)."""
        return 0.0 if self.levers is None else change_of_work(self._kinematics, self.levers, motion, q)


def load_derivatives(
    problem: Problem, evaluation: Evaluation, lam: np.ndarray, Z: np.ndarray, W: np.ndarray, loaded: int | None = None
) -> np.ndarray:
    """(l, l, n_e) mm/N^2: D = dC/dw, how the effectors' compliance C, actuators held and contacts free, changes with a
    wrench w on the first `loaded` of their rows (all unless given); symmetric, as the third derivative of an energy
    (`cfem.predict.loads.loaded`). Z and W as for `compliance_derivatives`.

    With the motions Q that a wrench makes while the actuators hold, and the rows B that go with them, C is B^T Q and
    2 B^T Q - Q^T A Q stationary in Q: its derivative along Q_k needs no solve. The wrench's own curvature joins A."""
    rows, kinematics = problem.robot.rows, problem.kinematics
    pulls = np.linalg.solve(W[rows.a, rows.a], W[rows.a, rows.e])  # (n_a, n_e) with which the actuators hold
    Q = Z[:, rows.e] - Z[:, rows.a] @ pulls

    def moved(k: int, h: float) -> np.ndarray:
        return kinematics.move(evaluation.x, h * Q[:, k])

    def gradients(x: np.ndarray) -> np.ndarray:
        return problem.gradients(problem.robot.effectors, x).T @ Q

    def compliance(k: int, h: float) -> np.ndarray:
        forces = lam.copy()
        forces[: rows.n_a] -= h * pulls[:, k]
        state = problem.evaluate(moved(k, h), np.empty(0), evaluation.load)
        BQ = gradients(state.x) - pulls.T @ (state.H[:, : rows.n_a].T @ Q)
        return BQ + BQ.T - problem.form(state, forces, Q)

    many = rows.n_e if loaded is None else loaded
    D, turned = np.zeros((many, rows.n_e, rows.n_e)), np.zeros((many, rows.n_e, rows.n_e))
    for k in range(rows.n_e):
        most = steepest(problem, kinematics.spread(evaluation.x, Q[:, k]))
        if most == 0.0:
            continue  # attached to held nodes only
        h = STEP / most
        turned[:, k] = (gradients(moved(k, h)) - gradients(moved(k, -h)))[:many] / (2 * h)  # the wrench's direction
        if k < many:
            D[k] = (compliance(k, h) - compliance(k, -h)) / (2 * h)
    D += (turned + turned.swapaxes(1, 2)) / 2
    loaded_rows, seen = np.split(D[:, :many], [many], axis=2)
    loaded_rows = sum(loaded_rows.transpose(order) for order in permutations(range(3))) / 6
    return np.concatenate([loaded_rows, (seen + seen.swapaxes(0, 1)) / 2], axis=2)


def skin_load_derivatives(linear: Linearisation) -> np.ndarray:
    """Change (n_s, n_e + n_s, n_e + n_s) mm/N^2 of the compliance of effectors and skin, actuators held, with a load on
    each row of the skin; linear: what a solve without contacts has kept."""
    rows = linear.problem.robot.rows
    seen, a, change = slice(0, rows.a.start), rows.a, SkinRowsChange(linear.problem, linear.at)
    K = np.linalg.inv(linear.W[a, a])
    G, changes, turning = linear.W[seen, a] @ K, [], None
    if change.levers is not None:  # of rigid groups: the load's own curvature joins A
        turning = np.stack([change.change(z, linear.Z) for z in linear.Z.T], axis=1)
    for number, k in enumerate(range(rows.s.start, rows.s.stop)):
        taken = -K @ linear.W[a, k]  # the actuators take up forces so that they stay
        dW = derivative_along(
            linear.problem, linear.at, linear.lam, linear.Z, taken, linear.Z[:, k] + linear.Z[:, a] @ taken, skin=change
        )
        if turning is not None:
            dW += (turning[number] + turning[number].T) / 2
        across = dW[seen, a] @ G.T
        changes.append(dW[seen, seen] - across - across.T + G @ dW[a, a] @ G.T)
    return np.stack(changes)


def derivative_along(
    problem: Problem,
    evaluation: Evaluation,
    lam: np.ndarray,
    Z: np.ndarray,
    changing: np.ndarray | float,
    motion: np.ndarray,
    Y: np.ndarray | None = None,
    mass: sp.csr_array | None = None,
    skin: SkinRowsChange | None = None,
) -> np.ndarray:
    """Derivative (n, n) of W, or (n, 2 n) of W and V, where the multipliers change by `changing` (n_active,) and the
    unknowns move by `motion` (n_dof,). Z (n_dof, n) of the effectors, of the skin's rows where `skin` is given, and of
    as many active rows as are wanted."""
    n, q = Z.shape[1], Z if Y is None else np.hstack([Z, Y])
    e, s = problem.robot.rows.e, slice(0, 0) if skin is None else skin.rows
    kept = np.r_[e, max(e.stop, s.stop) : n]

    def compliance(h: float) -> np.ndarray:
        """B^T Z + Z^T B - Z^T A Z, with the element pressures that x demands; and that of V."""
        state = problem.evaluate(problem.kinematics.move(evaluation.x, h * motion), np.empty(0), evaluation.load)
        changed = lam + h * changing
        B = np.hstack([problem.gradients(problem.robot.effectors, state.x), state.H])[:, : len(kept)]
        BZ, form = np.zeros((n, n)), problem.form(state, changed, q)
        BZ[kept] = B.T @ Z
        W = BZ + BZ.T - form[:n, :n]
        if Y is None:
            return W
        YB = -form[n:, :n]
        YB[:, kept] += Y.T @ B
        moved = problem.kinematics.spread(state.x, Z)
        heavy = np.tensordot(moved, (mass @ moved.reshape(len(moved), -1)).reshape(moved.shape), axes=((0, 1), (0, 1)))
        return np.hstack([W, heavy + YB + YB.T])

    most = steepest(problem, problem.kinematics.spread(evaluation.x, motion))
    if most == 0.0:
        return np.zeros((n, q.shape[1]))  # attached to held nodes only
    h = STEP / most
    slope = (compliance(h) - compliance(-h)) / (2 * h)
    if skin is not None:
        change = skin.change(motion, q)
        for part in range(0, q.shape[1], n):  # of W, and of V
            block = change[:, part : part + n] if np.ndim(change) else change
            slope[s, part : part + n] += block
            slope[:, part : part + n][:, s] += np.transpose(block)
    return slope


def steepest(problem: Problem, moved: np.ndarray) -> float:
    """1/N: largest change of a cell's displacement gradient, about, with the nodes' motion (n, 3) mm/N."""
    sections = problem.body.sections
    if sections is not None:
        apart = np.diff(moved[sections.nodes], axis=0) / sections.spacing[:, None, None]
        return float(np.sqrt((apart**2).sum(axis=2).max()))
    return steepest_of(problem.rest, problem.body.cells, moved)


def steepest_of(rest: np.ndarray, cells: np.ndarray, moved: np.ndarray) -> float:
    """1/N: the same of some cells (m, n_nodes), nodes at rest (n, 3) mm."""
    return float((_spans(moved, cells) / _spans(rest, cells)).max())


def _spans(places: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(m,): diagonal of the box around the nodes of each cell."""
    corners = np.ascontiguousarray(places[cells].transpose(1, 2, 0))
    return np.linalg.norm(corners.max(axis=0) - corners.min(axis=0), axis=0)
