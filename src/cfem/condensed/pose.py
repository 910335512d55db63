"""A rigid body's pose (u, theta): displacement of its origin (mm) and rotation vector (rad); how its points move, and
robots condensed onto the pose of their contact points.

With delta_c = g(X) the energy of the actuators and the pose is Psi(delta_a, g(X)); by the chain rule, T = diag(1, g'):

    wrench = g'^T lambda_c        hess = T^T W_act^-1 T + lambda_c . g''        grad e = W_e,act W_act^-1 T

and C_ee = W_ee - W_e,act W_act^-1 W_act,e stays; e are the effectors, and the skin's rows with them. W of the
rows e, a, pose follows as W of any energy does."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.condensed.condensed import Condensed, by_displacement
from cfem.condensed.rotation import turn
from cfem.condensed.rows import Rows

COORDINATES = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class Patch:
    """Points of a robot that move as one rigid body.

    points: (k, 3) mm at rest
    origin: (3,) mm, the point whose displacement is u
    turns: whether it can turn, so that a pose X has six coordinates (u, theta), else three"""

    points: np.ndarray
    origin: np.ndarray
    turns: bool

    @property
    def n(self) -> int:
        return 6 if self.turns else 3

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"patch.{axis}" for axis in COORDINATES[: self.n])

    def displacement(self, X: np.ndarray) -> np.ndarray:
        """Displacements (3 k,) mm of the points from rest, at pose X (n,)."""
        r = self.points - self.origin
        turned = r @ turn(X[3:]).R.T - r if self.turns else np.zeros_like(r)
        return (turned + X[:3]).ravel()

    def jacobian(self, X: np.ndarray) -> np.ndarray:
        """Jacobian (3 k, n) of `displacement`."""
        k = len(self.points)
        shift = np.tile(np.eye(3), (k, 1))
        if not self.turns:
            return shift
        turned = np.einsum("jab,kb->kaj", turn(X[3:]).first, self.points - self.origin)
        return np.hstack([shift, turned.reshape(3 * k, 3)])

    def curvature(self, X: np.ndarray, lam: np.ndarray) -> np.ndarray:
        """Second derivative (n, n) of lam . displacement, lam (3 k,) N."""
        out = np.zeros((self.n, self.n))
        if self.turns:
            pulled = lam.reshape(-1, 3).T @ (self.points - self.origin)
            out[3:, 3:] = np.tensordot(turn(X[3:]).second, pulled, 2)
        return out


def onto_patch(condensed: Condensed, patch: Patch, X: np.ndarray) -> Condensed:
    """The condensed robot whose contact rows are the coordinates of the pose X, at a state whose contact points stand
    there; its multipliers by them are the wrench that holds the patch (N, N mm)."""
    rows, n_a = condensed.rows, condensed.rows.n_a
    act, e = rows.active, rows.watched
    T = np.zeros((n_a + rows.n_c, n_a + patch.n))
    T[:n_a, :n_a] = np.eye(n_a)
    T[n_a:, n_a:] = patch.jacobian(X)
    K = np.linalg.inv(condensed.W[act, act])
    hessian = T.T @ ((K + K.T) / 2) @ T
    hessian[n_a:, n_a:] += patch.curvature(X, condensed.lam[n_a:])
    gradient_e = condensed.W[e, act] @ K
    locked = condensed.W[e, e] - gradient_e @ condensed.W[act, e]
    delta = np.concatenate([condensed.delta[e], condensed.delta[rows.a], X])
    return from_energy(
        Rows(rows.effectors, rows.actuators, patch.names, rows.skin),
        delta,
        T.T @ condensed.lam,
        hessian,
        gradient_e @ T,
        locked,
    )


def slopes_onto_patch(condensed: Condensed, dW: np.ndarray, patch: Patch, X: np.ndarray) -> np.ndarray:
    """Derivatives dW/dlambda (n_a + n, rows, rows) of the rows of `onto_patch`, from dW (n_a + n_c, rows, rows) of all
    rows of `condensed`: the chain rule once more, with the third derivative of g by central differences of the
    second."""
    rows, n_a = condensed.rows, condensed.rows.n_a
    act, e, n = rows.active, rows.watched, n_a + patch.n
    T = np.zeros((n_a + rows.n_c, n))
    T[:n_a, :n_a] = np.eye(n_a)
    T[n_a:, n_a:] = patch.jacobian(X)
    units = np.eye(rows.n_c)
    second = np.zeros((n_a + rows.n_c, n, n))
    second[n_a:, n_a:, n_a:] = [patch.curvature(X, unit) for unit in units]
    lam = condensed.lam
    third = np.zeros((n, n, n))
    third[n_a:, n_a:, n_a:] = _slope(lambda pose: patch.curvature(pose, lam[n_a:]), X)
    K = np.linalg.inv(condensed.W[act, act])
    W_ea = condensed.W[e, act]
    G = W_ea @ K
    d_K, d_G, d_C = (slope[0] for slope in by_displacement(dW[None], e, act, K[None], G[None], W_ea[None]))
    KT = K @ T
    bent = np.einsum("iuw,iv->wuv", second, KT)
    by_hessian = np.einsum("lij,lw,iu,jv->wuv", d_K, T, T, T, optimize=True)
    by_hessian += bent + bent.swapaxes(1, 2) + np.einsum("iw,iuv->wuv", KT, second) + third
    by_gradient = np.einsum("lei,lw,iu->weu", d_G, T, T, optimize=True) + np.einsum("ei,iuw->weu", G, second)
    by_locked = np.einsum("lef,lw->wef", d_C, T)
    on_patch = onto_patch(condensed, patch, X)
    W_act, W_ea = on_patch.W[act.start :, act.start :], on_patch.W[e, act.start :]
    gradient = G @ T
    d_W = np.empty((n, on_patch.rows.n, on_patch.rows.n))
    d_act = -W_act @ by_hessian @ W_act
    d_ea = by_gradient @ W_act + gradient @ d_act
    active = on_patch.rows.active
    d_W[:, active, active], d_W[:, e, active] = d_act, d_ea
    d_W[:, active, e] = d_ea.swapaxes(1, 2)
    d_W[:, e, e] = by_locked + d_ea @ gradient.T + W_ea @ by_gradient.swapaxes(1, 2)
    return np.einsum("wk,wij->kij", W_act, d_W)


def _slope(function, X: np.ndarray, h: float = 1e-4) -> np.ndarray:
    """Central differences (n, ...) of a function by X (n,)."""
    return np.stack([(function(X + step) - function(X - step)) / (2 * h) for step in h * np.eye(len(X))])


def from_energy(
    rows: Rows, delta: np.ndarray, lam: np.ndarray, hessian: np.ndarray, gradient_e: np.ndarray, locked: np.ndarray
) -> Condensed:
    """The condensed model of one state of an energy Psi of the active displacements: delta (n,), lam = grad Psi, its
    Hessian, grad e (n_e, n_act) and C_ee = locked, of effectors and skin."""
    act, e = rows.active, rows.watched
    W = np.empty((rows.n, rows.n))
    W_act = np.linalg.inv(hessian)
    W[act, act] = (W_act + W_act.T) / 2
    W[e, act] = gradient_e @ W[act, act]
    W[act, e] = W[e, act].T
    W_ee = locked + W[e, act] @ gradient_e.T
    W[e, e] = (W_ee + W_ee.T) / 2
    return Condensed(rows, W, delta - W[:, act] @ lam, lam)


def resting(W: np.ndarray, n_a: int, free: Sequence[int]) -> np.ndarray:
    """Rest of the coordinates `free` of a pose (n,) to first order: (n, n_a + n), zero rows for the others, times
    (forces of the n_a actuators in N, pose in mm and rad).

    W (n_a + n, n_a + n): compliance of actuators and pose. With forces w on the other coordinates o and none on the
    free ones f, p_o = W_oa lambda_a + W_oo w and p_f = W_fa lambda_a + W_fo w; w eliminated."""
    n = len(W) - n_a
    free = list(free)
    held = [i for i in range(n) if i not in free]
    a, f, o = np.arange(n_a), n_a + np.array(free, dtype=int), n_a + np.array(held, dtype=int)
    by_pose = np.linalg.solve(W[np.ix_(o, o)], W[np.ix_(o, f)]).T
    out = np.zeros((n, n_a + n))
    out[np.ix_(free, a)] = W[np.ix_(f, a)] - by_pose @ W[np.ix_(o, a)]
    out[np.ix_(free, o)] = by_pose
    return out
