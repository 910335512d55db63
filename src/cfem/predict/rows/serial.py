"""Modules in a row, each known by a model of its own: a trunk of k modules from models of one.

Without external load nothing passes from module to module but the place where the next one begins: W_aa is of blocks,
and the tip is a product of rigid motions. With p, Q the end of a module in the frame at its base, P and R those of the
frames in the trunk, and a = R^T (y - P) the arm from a module's end to the tip y,

    T_i = R_(i-1) [1, -[a_i]]        W_ea,i = T_i W_i,ea        W_ee = sum over modules, T_i W_i,ee T_i^T

where W_i is of the module's end, its rows of rotation turned from rotation vectors to spins by the left Jacobian of
SO(3). The centre of mass of the whole is the mean of the modules' own, weighted with their masses: it moves with the
ends before it, and with the rows of a module's own centre. Modules that differ in Young's modulus alone share one
model: W ~ 1/E is exact."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed.rotation import cross_matrix, left_jacobian
from cfem.core.errors import InputError
from cfem.predict.array_predictor import ArrayPredictor, build
from cfem.predict.protocol import Predictor
from cfem.predict.rows.patches import RowPatches
from cfem.predict.rows.serial_skin import SerialSkin, in_a_row
from cfem.predict.series.skin import LearnedSkin

END, CENTRE = 6, 3  # rows of a module: the pose of its end, and the place of its centre of mass


@dataclass(frozen=True)
class ModuleState:
    """State of one module of a row.

    pose: (..., 6 or 9) of its end, and of its centre of mass, from rest, in the frame at its base
    W_ee, W_ea, W_aa: blocks of W, rows of rotation as spins
    lam: (..., n)"""

    pose: np.ndarray
    W_ee: np.ndarray
    W_ea: np.ndarray
    W_aa: np.ndarray
    lam: np.ndarray


class SerialPredictor(ArrayPredictor):
    """Predictor of modules in a row.

    meta: modules, model.json of each model of a module, whose effectors are its end with its orientation and perhaps
    its centre of mass; row, of each module from the base on: which of these models it is, and how much softer
    arrays: of the models, by the names of `module_arrays`
    patches: forces on its surface, None without any"""

    patches: RowPatches | None = None

    def __init__(self, meta: dict, arrays: dict[str, np.ndarray]):
        """Builds the models, and places the modules of the row."""
        super().__init__(meta)
        self.arrays = arrays
        self.models: list[Predictor] = [
            build(card, module_arrays(arrays, number)) for number, card in enumerate(meta["modules"])
        ]
        self.which = [place["model"] for place in meta["row"]]
        self.softer = np.array([place["softer"] for place in meta["row"]])
        self.heavy = self.rows.n_e > 3  # whether the centre of mass of the whole is an effector
        self.pose = END + CENTRE * self.heavy
        ends = np.cumsum([0, *(module.rows.n_a for module in self.modules)])
        self.columns = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self.rests = np.array([module.rest_e[: self.pose] for module in self.modules])
        masses = np.array([sum(module.meta.get("masses", {}).values()) for module in self.modules])
        self.shares = masses / masses.sum() if self.heavy else np.zeros(len(masses))

    @property
    def modules(self) -> list[Predictor]:
        """Model of each module, from the base on."""
        return [self.models[number] for number in self.which]

    def learned(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """W and delta_free of the row: the modules' blocks, moved to the effectors by the rigid motions of those
        behind."""
        parts = self._parts(s)
        P, R, c = self._places([part.pose for part in parts])
        n_e, n = self.rows.n_e, self.rows.n
        out, lam = np.zeros((*s.shape[:-1], n, n)), np.concatenate([part.lam for part in parts], axis=-1)
        for i, (part, T) in enumerate(zip(parts, self._moving(P, R, c), strict=True)):
            mine = slice(n_e + self.columns[i].start, n_e + self.columns[i].stop)
            out[..., :n_e, :n_e] += T @ part.W_ee @ T.swapaxes(-1, -2)
            out[..., mine, mine] = part.W_aa
            out[..., :n_e, mine] = T @ part.W_ea
            out[..., mine, :n_e] = out[..., :n_e, mine].swapaxes(-1, -2)
        delta = np.concatenate([self._watched(P, c) - self.rest_e, s], axis=-1)
        return out, delta - (out[..., n_e:] @ lam[..., None])[..., 0]

    def _parts(self, s: np.ndarray) -> list[ModuleState]:
        """States of the modules at s (..., n_a); those of one model are asked together."""
        states: list[ModuleState] = [None] * len(self.which)
        for number, model in enumerate(self.models):
            places = [i for i, model_number in enumerate(self.which) if model_number == number]
            each = np.stack([s[..., self.columns[i]] for i in places])
            W, free = model.evaluate(each)
            p, e, a = self.pose, slice(0, self.pose), model.rows.a
            lam = np.linalg.solve(W[..., a, a], (each - free[..., a])[..., None])
            pose = free[..., e] + (W[..., e, a] @ lam)[..., 0]
            L = np.broadcast_to(np.eye(p), (*pose.shape, p)).copy()
            L[..., 3:END, 3:END] = left_jacobian(pose[..., 3:END])
            W_ee, W_ea = L @ W[..., e, e] @ L.swapaxes(-1, -2), L @ W[..., e, a]
            for k, i in enumerate(places):
                soft = self.softer[i]
                states[i] = ModuleState(
                    pose[k], soft * W_ee[k], soft * W_ea[k], soft * W[k][..., a, a], lam[k, ..., 0] / soft
                )
        return states

    def _places(self, poses: list[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
        """P: (..., 3) mm of the base and of each end; R: (..., 3, 3) frames at the modules' bases; c: (..., 3) mm of
        their centres of mass, where these are known."""
        size = poses[0].shape[:-1]
        P, R, c = [np.zeros((*size, 3))], [np.broadcast_to(np.eye(3), (*size, 3, 3))], []
        for pose, rest in zip(poses, self.rests, strict=True):
            base, frame = P[-1], R[-1]
            P.append(base + _turned(frame, rest[:3] + pose[..., :3]))
            R.append(frame @ turns(pose[..., 3:END]))
            if self.heavy:
                c.append(base + _turned(frame, rest[END:] + pose[..., END:]))
        return P, R[:-1], c

    def _watched(self, P: list[np.ndarray], c: list[np.ndarray]) -> np.ndarray:
        """Places (..., n_e) mm of the tip, and of the centre of mass."""
        centre = (
            [sum(share * centre_of_mass for share, centre_of_mass in zip(self.shares, c, strict=True))]
            if self.heavy
            else []
        )
        return np.concatenate([P[-1], *centre], axis=-1)

    def _moving(self, P: list[np.ndarray], R: list[np.ndarray], c: list[np.ndarray]) -> list[np.ndarray]:
        """Matrices (..., n_e, 6 or 9) of each module: how the effectors move with the rows of its end, spins among
        them, and of its centre of mass, in the frame at its base."""
        motions = []
        for i, frame in enumerate(R):
            T = np.zeros((*frame.shape[:-2], self.rows.n_e, self.pose))
            T[..., :3, :3], T[..., :3, 3:END] = frame, -frame @ cross_matrix(_turned_back(frame, P[-1] - P[i + 1]))
            if self.heavy:
                after = range(i + 1, len(R))
                arm = sum((self.shares[j] * (c[j] - P[i + 1]) for j in after), np.zeros_like(P[0]))
                T[..., 3:, :3] = self.shares[i + 1 :].sum() * frame
                T[..., 3:, 3:END] = -frame @ cross_matrix(_turned_back(frame, arm))
                T[..., 3:, END:] = self.shares[i] * frame
            motions.append(T)
        return motions

    @property
    def skin(self) -> LearnedSkin:
        """InputError: the whole has a shape, but no modes of its own."""
        what = "modules in a row have a shape, but no rows of a skin of the whole"
        raise InputError(what, do="train a model of the whole robot, of kind spectral, say")

    @cached_property
    def surface(self) -> SerialSkin:
        """Surface of all modules. InputError where a module's model has no skin."""
        skins = self.skin_source()
        if skins is None:
            do = "train each module's model on samples with `skin: {}`, then this one again"
            raise InputError(f"the model of scene '{self.meta['scene']}' has no skin", do=do)
        return in_a_row([skins[number] for number in self.which], self.rests[:, :3])

    @property
    def facets(self) -> np.ndarray:
        return self.surface.triangles

    def shape(self, delta_a: ArrayLike, p: ArrayLike | None = None) -> np.ndarray:
        s = np.asarray(delta_a, float)
        P, R, _ = self._places([part.pose for part in self._parts(s)])
        none = s[..., :0]
        rows = [
            skin.rows(s[..., columns], none) for skin, columns in zip(self.surface.modules, self.columns, strict=True)
        ]
        return self.surface.surface(rows, P[:-1], R)

    def surface_gradient(self, delta_a: ArrayLike, nodes: np.ndarray) -> np.ndarray:
        """Gradient (c, 3, n_a) of the places of nodes (c,) of `shape` by the displacements (n_a,) of the actuators."""
        s, row_skin, none = np.asarray(delta_a, float), self.surface, np.zeros(0)
        parts = self._parts(s)
        P, R, _ = self._places([part.pose for part in parts])
        place, owner = self.shape(s)[nodes], row_skin.owner[nodes]
        gradients = np.zeros((len(nodes), 3, len(s)))
        for i, (part, skin, columns) in enumerate(zip(parts, row_skin.modules, self.columns, strict=True)):
            mine, after = owner == i, owner > i
            gradient = part.W_ea[:END] @ np.linalg.inv(part.W_aa)  # by spins
            moved = np.einsum(
                "rcj,rn->cjn", skin.modes[:, row_skin.number[nodes[mine]]], skin.gradient(s[columns], none)
            )
            gradients[mine, :, columns] = R[i] @ moved
            arm = (place[after] - P[i + 1]) @ R[i]
            gradients[after, :, columns] = R[i] @ (gradient[:3] - cross_matrix(arm) @ gradient[3:])
        return gradients


def module_arrays(arrays: dict[str, np.ndarray], number: int | str) -> dict[str, np.ndarray]:
    """Arrays of one model of a module: `<number>.<name>` among the arrays of the row."""
    start = f"{number}."
    return {name.removeprefix(start): array for name, array in arrays.items() if name.startswith(start)}


def joined(parts: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Arrays of a row from those of its models: the inverse of `module_arrays`."""
    return {f"{number}.{name}": array for number, arrays in enumerate(parts) for name, array in arrays.items()}


def turns(phi: np.ndarray) -> np.ndarray:
    """Rotations (..., 3, 3), exp [phi] = 1 + [phi] J, of rotation vectors (..., 3)."""
    return np.eye(3) + cross_matrix(phi) @ left_jacobian(phi)


def _turned(frame: np.ndarray, x: np.ndarray) -> np.ndarray:
    return (frame @ x[..., None])[..., 0]


def _turned_back(frame: np.ndarray, x: np.ndarray) -> np.ndarray:
    return (frame.swapaxes(-1, -2) @ x[..., None])[..., 0]
