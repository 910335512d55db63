"""The value that everything after mechanics works on: compliance and free displacement in constraint space."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cfem.condensed.rows import Rows


@dataclass(frozen=True)
class Condensed:
    """A robot condensed onto its rows: delta = W lambda + delta_free, linearised at one equilibrium or at each of a
    batch (Navez, Menager et al. 2025).

    rows:       names and order e, skin, a, c of the n scalar rows
    W:          (..., n, n) symmetric compliance, row unit per column's multiplier unit (mm/N for cables and effectors)
    delta_free: (..., n) displacement of each row with the active multipliers removed at this tangent
    lam:        (..., n_a + n_c) multipliers of the active rows at the state itself (N, or MPa for pressures)

    Effector rows are displacements from their reference: the robot's own rest position unless shifted by a goal. What
    is derived from the arrays is computed once and read-only, so the arrays themselves must not change."""

    rows: Rows
    W: np.ndarray
    delta_free: np.ndarray
    lam: np.ndarray

    @classmethod
    def batch(cls, states: "Sequence[Condensed]") -> "Condensed":
        """Batch of states of one robot, along a new first axis."""
        arrays = ([getattr(state, name) for state in states] for name in ("W", "delta_free", "lam"))
        return Condensed(states[0].rows, *map(np.array, arrays))

    def each(self) -> "list[Condensed]":
        """The states of a batch (m,), one by one."""
        return [Condensed(self.rows, *row) for row in zip(self.W, self.delta_free, self.lam, strict=True)]

    @cached_property
    def delta(self) -> np.ndarray:
        """Displacements (..., n) at the state itself."""
        delta = (self.W[..., self.rows.active] @ self.lam[..., None])[..., 0] + self.delta_free
        delta.flags.writeable = False
        return delta

    @property
    def delta_e(self) -> np.ndarray:
        return self.delta[..., self.rows.e]

    @property
    def delta_s(self) -> np.ndarray:
        """Displacements (..., n_s) mm of the skin's rows from rest."""
        return self.delta[..., self.rows.s]

    @property
    def delta_a(self) -> np.ndarray:
        return self.delta[..., self.rows.a]

    @property
    def lambda_a(self) -> np.ndarray:
        return self.lam[..., : self.rows.n_a]

    @property
    def W_ea(self) -> np.ndarray:
        return self.W[..., self.rows.e, self.rows.a]

    @property
    def W_aa(self) -> np.ndarray:
        return self.W[..., self.rows.a, self.rows.a]

    @property
    def locked_compliance(self) -> np.ndarray:
        """Compliance (..., n_e, n_e) mm/N of the effectors, actuators held where they are: W_ee - W_ea W_aa^-1 W_ae."""
        return locked_compliance(self.rows, self.W)

    @cached_property
    def effector_jacobian(self) -> np.ndarray:
        """Jacobian (..., n_e, n_a + n_c) d delta_e / d delta_act = W_e,act W_act,act^-1 (design identity 2)."""
        act = self.rows.active
        jacobian = np.linalg.solve(self.W[..., act, act], self.W[..., act, self.rows.e]).swapaxes(-1, -2)
        jacobian.flags.writeable = False
        return jacobian

    def towards(self, goal: np.ndarray) -> "Condensed":
        """Effector rows measured from `goal` (n_e,), in the frame of delta_e: shifts delta_free_e, nothing else."""
        delta_free = self.delta_free.copy()
        delta_free[self.rows.e] -= goal
        return replace(self, delta_free=delta_free)


def locked_compliance(rows: Rows, W: np.ndarray) -> np.ndarray:
    """Compliance (..., n_e, n_e) mm/N of the effectors where the actuators are held, from W (..., n, n)."""
    e, a = rows.e, rows.a
    return W[..., e, e] - W[..., e, a] @ np.linalg.solve(W[..., a, a], W[..., a, e])


def by_displacement(
    dW: np.ndarray, e: slice, a: slice, K: np.ndarray, G: np.ndarray, W_ea: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives (m, k, ...) by delta_k of K = W_aa^-1, G = W_ea K, C = W_ee - G W_ae, from those of W by lambda: dK =
    -K dW_aa K, dG = (dW_ea - G dW_aa) K, dC = dW_ee - dG W_ae - G dW_ae; d/ddelta_l = sum_k K_kl d/dlambda_k."""
    K_, G_ = K[:, None], G[:, None]
    d_K = -K_ @ dW[:, :, a, a] @ K_
    d_G = (dW[:, :, e, a] - G_ @ dW[:, :, a, a]) @ K_
    d_C = dW[:, :, e, e] - d_G @ W_ea[:, None].swapaxes(2, 3) - G_ @ dW[:, :, a, e]
    return tuple(np.einsum("mkl,mkij->mlij", K, slope) for slope in (d_K, d_G, d_C))
