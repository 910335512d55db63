"""The surface of modules in a row from the skin of one: module i moves with the frame at its base.

    y = P_i + R_i x_i(delta_i)        x_i: the surface of the module (cfem.predict.skin), in that frame

Where nodes of a module's end lie on nodes of the next one's base, they are one node, that of the end, and the faces
between them are left out."""

from dataclasses import dataclass

import numpy as np

from cfem.predict.skin import LearnedSkin

FILE = "module-skin.npz"  # of the folder of a serial model
SAME = 1e-6  # of the module's length: nodes that are one


@dataclass(frozen=True)
class SerialSkin:
    """module: of one; count: of modules. owner (m,): the module that each node of the whole moves with, own (m,): its
    number there; rest (m, 3) mm; triangles (t, 3), normals outward."""

    module: LearnedSkin
    count: int
    owner: np.ndarray
    own: np.ndarray
    rest: np.ndarray
    triangles: np.ndarray

    def surface(self, rows: np.ndarray, P: np.ndarray, R: np.ndarray) -> np.ndarray:
        """(..., m, 3) mm: rows (..., count, k) mm of the modules' skins; P (..., count, 3) mm and R (..., count, 3, 3)
        the frames at their bases."""
        placed = np.einsum("...cij,...cmj->...cmi", R, self.module.surface(rows)) + P[..., None, :]
        return placed[..., self.owner, self.own, :]


def in_a_row(module: LearnedSkin, count: int, end: np.ndarray) -> SerialSkin:
    """end (3,) mm: where a module ends at rest, from its base."""
    from scipy.spatial import cKDTree  # here, as a model of one module is read without SciPy

    m = len(module.rest)
    distance, at_end = cKDTree(module.rest).query(module.rest + end)  # of a base placed on the module's end
    base = np.flatnonzero(distance <= SAME * np.linalg.norm(end))
    at_end = at_end[base]
    number = np.arange(count * m).reshape(count, m)  # of all modules' nodes; those of a base become those of the end
    for i in range(1, count):
        number[i, base] = number[i - 1, at_end]
    joined = [np.isin(module.triangles, nodes).all(axis=1) for nodes in (base, at_end)]
    triangles = []
    for i in range(count):
        inner = (joined[0] & (i > 0)) | (joined[1] & (i < count - 1))
        triangles.append(number[i][module.triangles[~inner]])
    used, triangles = np.unique(np.concatenate(triangles), return_inverse=True)
    owner, own = np.divmod(used, m)
    rest = module.rest[own] + owner[:, None] * end
    return SerialSkin(module, count, owner, own, rest, triangles.reshape(-1, 3))
