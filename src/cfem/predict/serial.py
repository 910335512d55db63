"""Modules in a row, each known by one model of its own: a trunk of k modules from a model of one.

Without external load nothing passes from module to module but the place where the next one begins: W_aa is of blocks,
and the tip is a product of rigid motions. With p, Q the end of a module in the frame at its base, P and R those of the
frames in the trunk, and a = R^T (y - P) the arm from a module's end to the tip y,

    T_i = R_(i-1) [1, -[a_i]]        W_ea,i = T_i W_i,ea        W_ee = sum over modules, T_i W_i,ee T_i^T

where W_i is of the module's end, its rows of rotation turned from rotation vectors to spins by the left Jacobian of
SO(3). The modules are alike but for a factor of compliance: where only Young's modulus differs, W ~ 1/E is exact."""

import numpy as np

from cfem.predict.protocol import ArrayPredictor, Predictor, build


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
        bases, P = [np.broadcast_to(np.eye(3), turns[..., 0, :, :].shape)], np.zeros((*s.shape[:-1], k + 1, 3))
        for i in range(k):
            P[..., i + 1, :] = P[..., i, :] + (bases[i] @ (self.module.rest_e[:3] + end[..., i, :3])[..., None])[..., 0]
            bases.append(bases[i] @ turns[..., i, :, :])
        R = np.stack(bases[:-1], axis=-3)
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
