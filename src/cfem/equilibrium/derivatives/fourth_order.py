"""d2C/dw2: how the derivative D = dC/dw of the effectors' locked compliance changes with one more wrench, by the
factorisation at hand.

It is the central difference of D = `change` between two states under small wrenches +-h on one row, actuators held. A
motion along Q_l = dx/dw_l leads there, off equilibrium by h^2 on either side, which the difference cancels. So it does
with what one correction by the factor of the middle leaves of the motions Q there. The wrench itself pulls at these
states: its curvature, the second and third derivatives of the rows, joins A."""

from functools import cached_property
from itertools import permutations

import numpy as np

from cfem.condensed.packing import packed_indices
from cfem.equilibrium.derivatives.solved import solved
from cfem.equilibrium.derivatives.third_order import steepest
from cfem.equilibrium.system.evaluation import Evaluation
from cfem.equilibrium.system.solution import Linearisation

# Changes of the displacement gradient, where it changes most, of the outer difference and of the inner ones. Truncation
# grows with the square of the outer one, rounding with its inverse, both with what is stiff: of d2C at most 2e-3, 5 %
# at nu = 0.49 (bars of four cells along their length, which lock).
OUTER, INNER = 1e-5, 2e-5
ENOUGH = 1e-5  # of what is left of the motions: the residual of their correction
LOCKED = 1e-3  # of what a wrench on a row strains with the actuators free: steps are of no less, as Q may be rounding


def load_curvatures(linear: Linearisation) -> np.ndarray:
    """Second derivatives (n_e (n_e + 1) (n_e + 2) (n_e + 3) / 24,) mm/N^3, d2C/dw2, symmetric in all four indices, as
    the entries i <= j <= k <= l (`packing.packed_indices`); linear: what a solve without contacts has kept."""
    pulled, n = _Pulled(linear), linear.problem.robot.rows.n_e
    changes = np.full((n, n, n, n), np.nan)
    for row, h in enumerate(pulled.steps * OUTER / INNER):
        changes[row, : row + 1] = 0.0
        if h > 0:
            changes[row, : row + 1] = (pulled.change(row, h) - pulled.change(row, -h)) / (2 * h)
    each = np.stack([changes.transpose(order) for order in permutations(range(4))])
    return np.nanmean(each[:, *packed_indices(n, 4)], axis=0)


class _Pulled:
    """States under a small wrench on one row each.

    Q: (n_dof, n_e) motions that a wrench makes, actuators held
    pulls: (n_a, n_e) additional forces of the actuators
    steps: (n_e,) N of inner differences, 0 for a row that moves nothing even with the actuators free"""

    def __init__(self, linear: Linearisation):
        self.at, rows, W = linear, linear.problem.robot.rows, linear.W
        self.stiffness = np.linalg.inv(W[rows.a, rows.a])
        self.pulls = self.stiffness @ W[rows.a, rows.e]
        self.Q = linear.Z[:, rows.e] - linear.Z[:, rows.a] @ self.pulls
        steepness = np.maximum(self._steepness(self.Q), LOCKED * self._steepness(linear.Z[:, rows.e]))
        self.steps = np.divide(INNER, steepness, out=np.zeros(rows.n_e), where=steepness > 0)

    def _steepness(self, motions: np.ndarray) -> np.ndarray:
        spread = self.at.problem.kinematics.spread
        return np.array([steepest(self.at.problem, spread(self.at.at.x, q)) for q in motions.T])

    def change(self, row: int, h: float) -> np.ndarray:
        """(row + 1, n_e, n_e): D[k] of k <= row, under h N on the row."""
        x, lam = self._moved(self.at.at.x, self.Q, row, h), self._forces(self.at.lam, self.pulls, row, h)
        Q, pulls = self._motions(row, h, x, lam)
        changes = self._bends(x, Q)[: row + 1]
        for k, step in enumerate(self.steps[: row + 1]):
            if step > 0:
                ahead, behind = (self._compliance(x, lam, Q, pulls, k, side * step) for side in (1, -1))
                changes[k] += (ahead - behind) / (2 * step) + h * self._twisting[k, row]
        return changes

    def _motions(self, row: int, h: float, x: np.ndarray, lam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Q and pulls at x, by one correction with the factor of the middle."""
        AQ, rows, Z = np.zeros_like(self.Q), self.at.problem.robot.rows, self.at.Z
        for k, step in enumerate(self.steps):
            if step > 0:
                ahead, behind = (
                    self._residual(self._moved(x, self.Q, k, side * step), lam, row, h) for side in (1, -1)
                )
                AQ[:, k] = (ahead - behind) / (2 * step)
        H = self._evaluated(x).H[:, : rows.n_a]
        left = self._gradients(x) - AQ - H @ self.pulls
        more = self.stiffness @ (Z[:, rows.a].T @ left + H.T @ self.Q)
        moved, _ = solved(self.at, left, enough=ENOUGH)
        return self.Q + moved - Z[:, rows.a] @ more, self.pulls + more

    def _residual(self, x: np.ndarray, lam: np.ndarray, row: int, h: float) -> np.ndarray:
        return self._evaluated(x).residual(lam) - h * self._gradients(x)[:, row]

    def _compliance(
        self, x: np.ndarray, lam: np.ndarray, Q: np.ndarray, pulls: np.ndarray, k: int, h: float
    ) -> np.ndarray:
        """Compliance of `third_order.load_derivatives`, h N further along row k."""
        moved = self._evaluated(self._moved(x, Q, k, h))
        BQ = self._gradients(moved.x).T @ Q - pulls.T @ (moved.H[:, : len(pulls)].T @ Q)
        return BQ + BQ.T - self.at.problem.form(moved, self._forces(lam, pulls, k, h), Q)

    def _bends(self, x: np.ndarray, Q: np.ndarray) -> np.ndarray:
        """(n_e, n_e, n_e): [m, i, j] the second derivative of row m along Q_i and Q_j."""
        n = Q.shape[1]
        curvatures = np.zeros((n, n, n))
        for k, step in enumerate(self.steps):
            if step > 0:
                ahead, behind = (self._gradients(self._moved(x, Q, k, side * step)) for side in (1, -1))
                curvatures[:, k] = (ahead - behind).T @ Q / (2 * step)
        return (curvatures + curvatures.swapaxes(1, 2)) / 2

    @cached_property
    def _twisting(self) -> np.ndarray:
        """(n_e, n_e, n_e, n_e): [k, m, i, j] the third derivative of row m."""
        thirds, x = [], self.at.at.x
        for k, step in enumerate(self.steps * OUTER / INNER):
            ahead, behind = (self._bends(self._moved(x, self.Q, k, side * step), self.Q) for side in (1, -1))
            thirds.append((ahead - behind) / (2 * step) if step > 0 else np.zeros_like(ahead))
        return np.stack(thirds)

    def _moved(self, x: np.ndarray, Q: np.ndarray, row: int, h: float) -> np.ndarray:
        return self.at.problem.kinematics.move(x, h * Q[:, row])

    @staticmethod
    def _forces(lam: np.ndarray, pulls: np.ndarray, row: int, h: float) -> np.ndarray:
        forces = lam.copy()
        forces[: len(pulls)] -= h * pulls[:, row]
        return forces

    def _gradients(self, x: np.ndarray) -> np.ndarray:
        return self.at.problem.gradients(self.at.problem.robot.effectors, x)

    def _evaluated(self, x: np.ndarray) -> Evaluation:
        return self.at.problem.evaluate(x, np.empty(0), self.at.at.load)
