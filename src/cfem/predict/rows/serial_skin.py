"""The surface of modules in a row from the skins of the modules: module i moves with the frame at its base.

    y = P_i + R_i x_i(delta_i)        x_i: the surface of the module (cfem.predict.series.skin), in that frame

Where nodes of a module's end lie on nodes of the next one's base, they are one node, that of the end, and the faces
between them are left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.predict.series.skin import LearnedSkin

FILE = "module-skin.npz"  # of the folder of a serial model
SAME = 1e-6  # of the module's length: nodes that are one


@dataclass(frozen=True)
class SerialSkin:
    """Surface of modules in a row.

    modules: (k,) skin of each
    owner: (m,) the module that each node of the whole moves with
    number: (m,) of the node in its module
    rest: (m, 3) mm
    triangles: (t, 3), normals outward"""

    modules: tuple[LearnedSkin, ...]
    owner: np.ndarray
    number: np.ndarray
    rest: np.ndarray
    triangles: np.ndarray

    def surface(self, rows: Sequence[np.ndarray], P: Sequence[np.ndarray], R: Sequence[np.ndarray]) -> np.ndarray:
        """Places (..., m, 3) mm of the nodes. rows: (..., k) mm of the skin of each module; P (..., 3) mm and R (...,
        3, 3): place and frame at its base."""
        places = np.empty((*P[0].shape[:-1], len(self.owner), 3))
        for i, (skin, row, base, frame) in enumerate(zip(self.modules, rows, P, R, strict=True)):
            mine = self.owner == i
            placed = skin.surface(row)[..., self.number[mine], :] @ frame.swapaxes(-1, -2)
            places[..., mine, :] = placed + base[..., None, :]
        return places


def in_a_row(modules: Sequence[LearnedSkin], ends: np.ndarray) -> SerialSkin:
    """Surface of modules whose ends at rest are `ends` (k, 3) mm from their bases."""
    from scipy.spatial import cKDTree  # here, as a model of one module is read without SciPy

    numbers, triangles, first = [], [], 0
    bases = np.cumsum([np.zeros(3), *ends[:-1]], axis=0)
    inner = [np.zeros(len(skin.triangles), dtype=bool) for skin in modules]
    for i, skin in enumerate(modules):
        numbers.append(np.arange(first, first + len(skin.rest)))  # of all modules' nodes
        first += len(skin.rest)
        if i == 0:
            continue
        before, end = modules[i - 1], ends[i - 1]
        distance, at_end = cKDTree(before.rest).query(skin.rest + end)
        base = np.flatnonzero(distance <= SAME * np.linalg.norm(end))  # nodes that become those of the end before
        numbers[i][base] = numbers[i - 1][at_end[base]]
        inner[i] |= np.isin(skin.triangles, base).all(axis=1)
        inner[i - 1] |= np.isin(before.triangles, at_end[base]).all(axis=1)
    for skin, number, hidden in zip(modules, numbers, inner, strict=True):
        triangles.append(number[skin.triangles[~hidden]])
    used, triangles = np.unique(np.concatenate(triangles), return_inverse=True)
    starts = np.cumsum([0, *(len(skin.rest) for skin in modules)])
    owner = np.searchsorted(starts, used, side="right") - 1
    local = used - starts[owner]
    rest = np.array([modules[i].rest[node] + bases[i] for i, node in zip(owner, local, strict=True)])
    return SerialSkin(tuple(modules), owner, local, rest, triangles.reshape(-1, 3))
