"""Modules in a row under loads, each known by one unloaded model of its own.

Module i answers to the wrench w_i at its end (force, and moment conjugate to the rotation vector) with the pose
e_i = E_i(delta_i, w_i) of that end, in the frame at its base (`cfem.predict.wrench_series`). The loads have the
potential V(e_1, ..., e_k) = -sum F . y of the points y that carry forces F: w_i = -dV/de_i, and the poses follow from

    e - E(delta, -dV/de) = 0        Newton, with the Jacobian 1 + C V_ee

where C = dE/dw is of blocks. With S = (1 + C V_ee)^-1, G = dE/d delta, K = d lambda / d delta of the modules and
B = dy/de of the tip, the condensed row of modules has (implicit differentiation)

    d lambda / d delta = K + G^T V_ee S G        dy / d delta = B S G        dy / dF = B S C B^T"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed.pose import turn
from cfem.core.errors import InputError, NumericalError
from cfem.predict.energy import THIRD, condense
from cfem.predict.serial import SerialPredictor
from cfem.predict.wrench_series import Loaded, WrenchSeries

POSE = 6
ITERATIONS = 50
STEP = 1e-5  # of the reach: by which shapes are differenced
STATES = 16  # at which the error is estimated
FARTHEST = 4.0  # lengths and radians: no pose of a module is farther away
TOLERANCE = 1e-11  # of the length and of a radian: largest Newton step of a converged row


@dataclass(frozen=True)
class Row:
    """The ends of the modules. P (k + 1, 3) mm: of the base and of each end; B (k, 3, N), H (k, 3, N, N): first and
    second derivatives of each end by all N = 6 k coordinates e."""

    P: np.ndarray
    B: np.ndarray
    H: np.ndarray


def row_of(e: np.ndarray, rest: np.ndarray) -> Row:
    """e (k, 6): displacement of each module's end from `rest` (3,) mm and rotation vector, in the frame at its base."""
    k, N = len(e), e.size
    A, dA, d2A = np.eye(3), np.zeros((N, 3, 3)), np.zeros((N, N, 3, 3))
    P, B, H = np.zeros((k + 1, 3)), np.zeros((k + 1, 3, N)), np.zeros((k + 1, 3, N, N))
    for i, one in enumerate(e):
        x, place, angle = rest + one[:3], slice(POSE * i, POSE * i + 3), slice(POSE * i + 3, POSE * (i + 1))
        P[i + 1] = P[i] + A @ x
        B[i + 1] = B[i] + (dA @ x).T
        B[i + 1][:, place] += A
        H[i + 1] = H[i] + np.moveaxis(d2A @ x, -1, 0)
        mixed = np.moveaxis(dA, 0, 1)  # (3, N, 3): by any coordinate, and by x
        H[i + 1][:, :, place] += mixed
        H[i + 1][:, place, :] += mixed.swapaxes(1, 2)
        R, first, second = turn(one[3:])
        new, new2 = dA @ R, d2A @ R
        cross = np.einsum("nab,jbc->njac", dA, first)
        new2[:, angle] += cross
        new2[angle, :] += cross.swapaxes(0, 1)
        new2[angle, angle] += A @ second
        new[angle] += A @ first
        A, dA, d2A = A @ R, new, new2
    return Row(P, B[1:], H[1:])


class LoadedSerialPredictor(SerialPredictor):
    """forces: (k, 3) N on the end of each module, in the frame of the trunk's base."""

    def __init__(self, meta: dict, arrays: dict[str, np.ndarray], forces: np.ndarray):
        super().__init__(meta, arrays)
        self.forces = np.asarray(forces, float)
        if self.forces.shape != (len(self._softer), 3) or not np.isfinite(self.forces).all():
            raise InputError(f"expected finite forces on the ends of {len(self._softer)} modules")
        self._series = WrenchSeries(self.module)

    def learned(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = [self._one(one) for one in s.reshape(-1, s.shape[-1])]
        W, free = (np.array(each).reshape(*s.shape[:-1], *each[0].shape) for each in zip(*found, strict=True))
        return W, free

    def error(self) -> float:
        """mm: about how far the tip is wrong where that is worst among the training states, as
        `cfem.predict.loaded.wrench_error`."""
        n_a = self.rows.n_a
        none = LoadedSerialPredictor(self.meta, self.arrays, np.zeros_like(self.forces))
        without = {name: values for name, values in self.arrays.items() if name != THIRD}
        linear = self if len(without) == len(self.arrays) else LoadedSerialPredictor(self.meta, without, self.forces)
        worst = 0.0
        for delta in self.domain.states[:: max(1, len(self.domain.states) // STATES), :n_a]:
            rest, bent, here = (one.tip(delta) for one in (none, linear, self))
            first, second = np.linalg.norm(bent - rest), np.linalg.norm(here - bent)
            worst = max(worst, first**2 / self.length if linear is self else second**2 / max(first, 1e-300))
        return float(worst)

    def shape(self, delta_a: ArrayLike, p: ArrayLike | None = None) -> np.ndarray:
        """As that of the unloaded row; the modules' own surfaces to first order in the wrenches at their ends."""
        delta, whole = np.asarray(delta_a, float), self.surface
        found = [self._shape(one) for one in delta.reshape(-1, delta.shape[-1])]
        return np.array(found).reshape(*delta.shape[:-1], *whole.rest.shape)

    def _shape(self, delta: np.ndarray) -> np.ndarray:
        each = delta.reshape(len(self._softer), -1)
        modules = [self._series.at(one) for one in each]
        row, parts = self._settle([one.e[0] for one in modules], modules)
        e, skin, none = np.array([one.e for one in parts]), self.surface.module, np.zeros(0)
        w = np.einsum("kj,kjn->n", self.forces, row.B).reshape(e.shape)
        loads = zip(each, self._softer[:, None] * w, strict=True)
        rows = np.array([skin.rows(one, none) + load @ skin.compliance(one, none)[0] for one, load in loads])
        turns = np.array([turn(one)[0] for one in e[:, 3:]])
        P, R = self._frames(e[:, :3], turns)
        return self.surface.surface(rows, P[:-1], R)

    def surface_gradient(self, delta_a: ArrayLike, nodes: np.ndarray) -> np.ndarray:
        """By central differences of `shape`."""
        delta, found = np.asarray(delta_a, float), []
        for step in np.diag(STEP * np.abs(self.reach).max(axis=1)):
            ahead, behind = (self.shape(delta + side * step)[nodes] for side in (1, -1))
            found.append((ahead - behind) / (2 * step.max()))
        return np.stack(found, axis=-1)

    def tip(self, delta: np.ndarray) -> np.ndarray:
        """(3,) mm, at displacements (n_a,)."""
        modules = [self._series.at(one) for one in delta.reshape(len(self._softer), -1)]
        return self._settle([one.e[0] for one in modules], modules)[0].P[-1]

    def _one(self, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        k = len(self._softer)
        modules = [self._series.at(one) for one in delta.reshape(k, -1)]
        row, parts = self._settle([one.e[0] for one in modules], modules)
        N = POSE * k
        V = -np.einsum("kj,kjmn->mn", self.forces, row.H)
        C, G, K = (_diagonal([getattr(one, name) for one in parts]) for name in "CGK")
        S = np.linalg.inv(np.eye(N) + C @ V)
        B = row.B[-1]
        part = {
            "gradient": np.concatenate([one.lam for one in parts]),
            "hessian": _symmetric(K + G.T @ V @ S @ G),
            "effector": row.P[-1] - self.rest_e,
            "effector_gradient": B @ S @ G,
            "effector_compliance": _symmetric(B @ S @ C @ B.T),
        }
        sizes = None if self.module.sizes is None else self.module.sizes[:3]  # of the end that modules and whole have
        return condense("displacement", self.rows, delta, part, sizes)

    def _settle(self, e: list[np.ndarray], modules: list) -> tuple[Row, list[Loaded]]:
        """The row in equilibrium, from the poses e of its unloaded modules."""
        e = np.array(e)
        size = np.array([self.length] * 3 + [1.0] * 3)
        for _ in range(ITERATIONS):
            row = row_of(e, self.module.rest_e[:3])
            w = np.einsum("kj,kjn->n", self.forces, row.B).reshape(e.shape)
            parts = [self._under(*each) for each in zip(modules, w, self._softer, strict=True)]
            V = -np.einsum("kj,kjmn->mn", self.forces, row.H)
            missing = (np.array([one.e for one in parts]) - e).ravel()
            C = _diagonal([one.C for one in parts])
            step = np.linalg.solve(np.eye(len(missing)) + C @ V, missing)
            step = step.reshape(e.shape)
            e = e + step
            if np.abs(step / size).max() <= TOLERANCE:
                return row, parts
            if not np.abs(e / size).max() < FARTHEST:
                break
        raise NumericalError("modules in a row find no equilibrium under these loads", do="take smaller loads")

    @staticmethod
    def _under(module, w: np.ndarray, softer: float) -> Loaded:
        """Of a module `softer` times as compliant as the one that was sampled: W ~ 1/E is exact."""
        found = module.under(softer * w)
        return Loaded(found.lam / softer, found.K / softer, found.e, found.G, found.C * softer)


def _diagonal(blocks: list[np.ndarray]) -> np.ndarray:
    height, width = blocks[0].shape
    out = np.zeros((height * len(blocks), width * len(blocks)))
    for i, one in enumerate(blocks):
        out[i * height : (i + 1) * height, i * width : (i + 1) * width] = one
    return out


def _symmetric(M: np.ndarray) -> np.ndarray:
    return (M + M.T) / 2
