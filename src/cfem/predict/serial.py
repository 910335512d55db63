"""Modules in a row, each known by one model of its own: a trunk of k modules from a model of one.

Without external load nothing passes from module to module but the place where the next one begins: W_aa is of blocks,
and the tip is a product of rigid motions. With p, Q the end of a module in the frame at its base, P and R those of the
frames in the trunk, and a = R^T (y - P) the arm from a module's end to the tip y,

    T_i = R_(i-1) [1, -[a_i]]        W_ea,i = T_i W_i,ea        W_ee = sum over modules, T_i W_i,ee T_i^T

where W_i is of the module's end, its rows of rotation turned from rotation vectors to spins by the left Jacobian of
SO(3). The modules are alike but for a factor of compliance: where only Young's modulus differs, W ~ 1/E is exact."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from cfem.core.errors import InputError
from cfem.predict.protocol import ArrayPredictor, Predictor, build
from cfem.predict.serial_skin import SerialSkin, in_a_row
from cfem.predict.skin import LearnedSkin


class SerialPredictor(ArrayPredictor, kind="serial"):
    """meta: module, model.json of the module's model, whose effector is its end with its orientation; softer (k,): how
    compliant each module is relative to it. arrays: of the module's model."""

    def __init__(self, meta: dict, arrays: dict[str, np.ndarray]):
        super().__init__(meta)
        self.arrays = arrays
        self.module: Predictor = build(meta["module"], arrays)
        self._softer = np.asarray(meta["softer"], float)

    def learned(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        k, n = len(self._softer), self.module.rows.n_a
        each = s.reshape(*s.shape[:-1], k, n)
        W, free = self.module.evaluate(each)
        lam = np.linalg.solve(W[..., 6:, 6:], (each - free[..., 6:])[..., None])
        end = free[..., :6] + (W[..., :6, 6:] @ lam)[..., 0]
        lam, W = lam[..., 0] / self._softer[:, None], W * self._softer[:, None, None]
        phi = end[..., 3:]
        J = left_jacobian(phi)
        W_ee, W_ea = spun(W[..., :6, :6], J), np.concatenate([W[..., :3, 6:], J @ W[..., 3:6, 6:]], axis=-2)
        turns = np.eye(3) + cross(phi) @ J  # exp [phi] = 1 + [phi] J
        P, R = self._frames(end[..., :3], turns)
        arm = (R.swapaxes(-1, -2) @ (P[..., -1:, :] - P[..., 1:, :])[..., None])[..., 0]
        T = np.concatenate([R, -R @ cross(arm)], axis=-1)
        out = np.zeros((*s.shape[:-1], 3 + k * n, 3 + k * n))
        out[..., :3, :3] = (T @ W_ee @ T.swapaxes(-1, -2)).sum(axis=-3)
        pulled = T @ W_ea
        for i in range(k):
            mine = slice(3 + i * n, 3 + (i + 1) * n)
            out[..., mine, mine] = W[..., i, 6:, 6:]
            out[..., :3, mine] = pulled[..., i, :, :]
            out[..., mine, :3] = out[..., :3, mine].swapaxes(-1, -2)
        delta = np.concatenate([P[..., -1, :] - self.rest_e, s], axis=-1)
        return out, delta - (out[..., 3:] @ lam.reshape(*s.shape[:-1], k * n, 1))[..., 0]

    @property
    def skin(self) -> LearnedSkin:
        """InputError: the whole has a shape, but no modes of its own."""
        what = "modules in a row have a shape, but no rows of a skin of the whole"
        raise InputError(what, do="train a model of the whole robot, of kind spectral, say")

    @cached_property
    def surface(self) -> SerialSkin:
        """Of all modules. InputError where the module's model has no skin."""
        found = self.skin_source()
        if found is None:
            do = "train the module's model on samples with `skin: {}`, then this one again"
            raise InputError(f"the model of scene '{self.meta['scene']}' has no skin", do=do)
        return in_a_row(found, len(self._softer), self.module.rest_e[:3])

    @property
    def facets(self) -> np.ndarray:
        return self.surface.triangles

    def shape(self, delta_a: ArrayLike, p: ArrayLike | None = None) -> np.ndarray:
        each = self._each(delta_a)
        e = self._ends(each)
        P, R = self._frames(e[..., :3], _turns(e))
        return self.surface.surface(self.surface.module.rows(each, each[..., :0]), P[..., :-1, :], R)

    def surface_gradient(self, delta_a: ArrayLike, nodes: np.ndarray) -> np.ndarray:
        """(c, 3, n_a) of the places of nodes (c,) of `shape` by the displacements (n_a,) of the actuators."""
        each, whole, none = self._each(delta_a), self.surface, np.zeros(0)
        k, n = each.shape
        W, free = self.module.evaluate(each)
        gradient = W[:, :6, 6:] @ np.linalg.inv(W[:, 6:, 6:])
        e = free[:, :6] + (gradient @ (each - free[:, 6:])[..., None])[..., 0]
        P, R = self._frames(e[:, :3], _turns(e))
        place = whole.surface(whole.module.rows(each, each[:, :0]), P[:-1], R)[nodes]
        owner, found = whole.owner[nodes], np.zeros((len(nodes), 3, k * n))
        spin = left_jacobian(e[:, 3:]) @ gradient[:, 3:]
        for i in range(k):
            mine, after = owner == i, owner > i
            moved = np.einsum("rcj,rn->cjn", whole.module.modes[:, whole.own[nodes[mine]]],
                              whole.module.gradient(each[i], none))  # fmt: skip
            found[mine, :, i * n : (i + 1) * n] = R[i] @ moved
            arm = (place[after] - P[i + 1]) @ R[i]
            found[after, :, i * n : (i + 1) * n] = R[i] @ (gradient[i, :3] - cross(arm) @ spin[i])
        return found

    def _each(self, delta_a: ArrayLike) -> np.ndarray:
        """(..., k, n) mm: of the modules."""
        s = np.asarray(delta_a, float)
        return s.reshape(*s.shape[:-1], len(self._softer), self.module.rows.n_a)

    def _ends(self, each: np.ndarray) -> np.ndarray:
        """(..., k, 6) poses of the modules' ends, unloaded, each in the frame at its base."""
        W, free = self.module.evaluate(each)
        lam = np.linalg.solve(W[..., 6:, 6:], (each - free[..., 6:])[..., None])
        return free[..., :6] + (W[..., :6, 6:] @ lam)[..., 0]

    def _frames(self, moved: np.ndarray, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """P (..., k + 1, 3) mm: of the base and of each end; R (..., k, 3, 3) frames at the modules' bases. moved
        (..., k, 3) mm and turns (..., k, 3, 3) of the ends, each in the frame at its module's base."""
        k = moved.shape[-2]
        bases, P = [np.broadcast_to(np.eye(3), turns[..., 0, :, :].shape)], np.zeros((*moved.shape[:-2], k + 1, 3))
        for i in range(k):
            P[..., i + 1, :] = (
                P[..., i, :] + (bases[i] @ (self.module.rest_e[:3] + moved[..., i, :])[..., None])[..., 0]
            )
            bases.append(bases[i] @ turns[..., i, :, :])
        return P, np.stack(bases[:-1], axis=-3)


def _turns(e: np.ndarray) -> np.ndarray:
    """(..., 3, 3) rotations of poses (..., 6): exp [phi] = 1 + [phi] J."""
    return np.eye(3) + cross(e[..., 3:]) @ left_jacobian(e[..., 3:])


def spun(W_ee: np.ndarray, J: np.ndarray) -> np.ndarray:
    """(..., 6, 6) by spins and moments, of that by rotation vectors and what works on them."""
    L = np.zeros_like(W_ee)
    L[..., :3, :3], L[..., 3:, 3:] = np.eye(3), J
    return L @ W_ee @ L.swapaxes(-1, -2)


def cross(v: np.ndarray) -> np.ndarray:
    """(..., 3, 3) [v] of v (..., 3)."""
    out = np.zeros((*v.shape, 3))
    out[..., 2, 1], out[..., 0, 2], out[..., 1, 0] = np.moveaxis(v, -1, 0)
    return out - out.swapaxes(-1, -2)


def left_jacobian(phi: np.ndarray) -> np.ndarray:
    """(..., 3, 3) J with exp [phi + d] = exp [J d] exp [phi] to first order: 1 + a [phi] + b [phi]^2, |phi| = t,
    a = (1 - cos t) / t^2, b = (t - sin t) / t^3."""
    s = (phi**2).sum(axis=-1)[..., None, None]
    small = s < 1e-4
    safe = np.where(small, 1.0, s)
    t = np.sqrt(safe)
    a = np.where(small, 1 / 2 - s / 24 + s**2 / 720, (1 - np.cos(t)) / safe)
    b = np.where(small, 1 / 6 - s / 120 + s**2 / 5040, (t - np.sin(t)) / (safe * t))
    spin = cross(phi)
    return np.eye(3) + a * spin + b * (spin @ spin)
