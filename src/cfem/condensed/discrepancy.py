"""Discrepancy of finite elements at a robot's effectors, a smooth function of its forces (Kennedy and O'Hagan, J. R.
Stat. Soc. B 63, 2001):

    delta(lambda) = sum_b phi_b(x) w_b        x_i = lambda_i / (largest force i of the calibration), within -1 and 1

with phi_b all x_i and x_i x_j: none without force, and no more beyond the calibration than at its largest forces."""

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from cfem.condensed.condensed import Condensed

Term = tuple[int, ...]
BEYOND = 1.03  # times the largest force of the calibration, from which on nothing tells what the model lacks


def terms_of(n: int) -> list[Term]:
    """The forces that each feature of n forces multiplies: each alone, then each pair."""
    return [term for degree in (1, 2) for term in combinations_with_replacement(range(n), degree)]


def features(x: np.ndarray) -> np.ndarray:
    """Features (m, n_b) of relative forces x (m, n), in the order of `terms_of`."""
    x = np.clip(x, -1.0, 1.0)
    return np.stack([x[:, list(term)].prod(axis=1) for term in terms_of(x.shape[1])], axis=1)


@dataclass(frozen=True)
class Discrepancy:
    """What is added to where finite elements have some rows of effectors.

    rows:    names of these rows
    largest: (n_a,) N or MPa, largest force of each actuator in the calibration
    weights: (n_b, len(rows)) mm, of the features in the order of `terms_of`"""

    rows: tuple[str, ...]
    largest: np.ndarray
    weights: np.ndarray

    def value(self, lambda_a: np.ndarray) -> np.ndarray:
        """Displacement (len(rows),) mm at forces lambda_a (n_a,)."""
        return features((lambda_a / self.largest)[None])[0] @ self.weights

    def slopes(self, lambda_a: np.ndarray) -> np.ndarray:
        """First derivatives (len(rows), n_a) mm/N by the forces."""
        x, rate = self._within(lambda_a)
        linear, quadratic = self._orders
        return (linear + 2 * quadratic @ x) * rate

    def curvatures(self, lambda_a: np.ndarray) -> np.ndarray:
        """Second derivatives (len(rows), n_a, n_a) mm/N^2 by the forces."""
        _, rate = self._within(lambda_a)
        return 2 * self._orders[1] * rate[:, None] * rate

    def _within(self, lambda_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Relative forces (n_a,), and their derivatives (n_a,) by the forces: none beyond the calibration."""
        x = lambda_a / self.largest
        return np.clip(x, -1.0, 1.0), np.where(np.abs(x) < 1.0, 1 / self.largest, 0.0)

    @property
    def _orders(self) -> tuple[np.ndarray, np.ndarray]:
        """Weights (len(rows), n_a) of the forces, and symmetric ones (len(rows), n_a, n_a) of their products."""
        n = len(self.largest)
        quadratic = np.zeros((len(self.rows), n, n))
        for (i, j), weights in zip(terms_of(n)[n:], self.weights[n:], strict=True):
            quadratic[:, i, j] += weights / 2
            quadratic[:, j, i] += weights / 2
        return self.weights[:n].T, quadratic

    def numbers(self, effectors: tuple[str, ...]) -> np.ndarray:
        """Numbers (len(rows),) of its rows among these."""
        return np.array([effectors.index(row) for row in self.rows])


def corrected(condensed: Condensed, lacks: Discrepancy, dW: np.ndarray | None) -> tuple[Condensed, np.ndarray | None]:
    """A condensed robot whose effectors are where the discrepancy puts them, and its dW (n_active, n, n).

    On the equilibria without contact the discrepancy is a function of the actuators' displacements, with the slopes
    S W_aa^-1 where S are those by the forces. As such it changes the rows of the effectors by T, and W to T W T^T: that
    stays symmetric and semidefinite, and effectors yield to loads as before where the actuators are held."""
    rows, lam, W = condensed.rows, condensed.lam, condensed.W
    e, K = lacks.numbers(rows.effectors)[:, None], np.linalg.inv(condensed.W_aa)
    a = np.arange(rows.a.start, rows.a.stop)
    slopes, curvatures = lacks.slopes(lam[: rows.n_a]), lacks.curvatures(lam[: rows.n_a])
    T = np.eye(rows.n)
    T[e, a] = slopes @ K
    delta = condensed.delta.copy()
    delta[e[:, 0]] += lacks.value(lam[: rows.n_a])
    moved = T @ W @ T.T
    if dW is not None:
        along = []
        for k, change in enumerate(dW):  # T' by the multiplier k
            turned = np.zeros_like(T)
            of_slopes = curvatures[:, :, k] if k < rows.n_a else 0.0
            turned[e, a] = (of_slopes - slopes @ K @ change[rows.a, rows.a]) @ K
            half = turned @ W @ T.T
            along.append(T @ change @ T.T + half + half.T)
        dW = np.stack(along)
    return Condensed(rows, moved, delta - moved[:, rows.active] @ lam, lam), dW
