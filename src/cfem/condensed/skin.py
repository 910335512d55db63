"""The whole surface of a robot from a handful of rows: principal modes u_k of its displacement,

    s_k = sum_i w_i u_ki . (x_i - X_i)        x_i ~ X_i + sum_k u_ki s_k        sum_i w_i u_ki . u_li = delta_kl,

over all surface nodes i, w_i their shares of the surface. A row s_k (mm) is a linear functional of positions like an
effector's, its multiplier (N) a load spread over the surface: a force f at node i works on row k by u_ki . f."""

import io
import zipfile
import zlib
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from cfem.core.artefact.files import npz_bytes
from cfem.core.errors import InputError
from cfem.core.reading import read_npz, take

PREFIX = "skin"


@dataclass(frozen=True)
class Skin:
    """Modes of a surface.

    nodes: (m,) numbers in the mesh
    rest: (m, 3) mm
    triangles: (t, 3) indices into nodes, normals outward
    weights: (m,) shares of the surface, of sum 1
    modes: (k, m, 3), the strongest first
    front: (j, 2) mm, root mean square and largest distance of a surface node from its place by the first 0, 1, ...
    modes, in states that had no part in them (j - 1 may be more than k: what more modes would have given)
    inner_nodes: (p,) all other nodes of the mesh, where the inside was asked for, as in all that follows
    inner_rest: (p, 3) mm
    inner_modes: (k, p, 3), by which they move as the modes do
    inner_left: (2,) mm, root mean square and largest distance of an inner node from its place by the modes, in the
    states that they are made from"""

    nodes: np.ndarray
    rest: np.ndarray
    triangles: np.ndarray
    weights: np.ndarray
    modes: np.ndarray
    front: np.ndarray
    inner_nodes: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    inner_rest: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    inner_modes: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 3)))
    inner_left: np.ndarray = field(default_factory=lambda: np.zeros(2))

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"{PREFIX}.{number}" for number in range(1, len(self.modes) + 1))

    @cached_property
    def functionals(self) -> np.ndarray:
        """Weights (k, m, 3) of displacements in the rows: s_k = sum of these times the displacements."""
        return self.weights[:, None] * self.modes

    def rows(self, displacements: np.ndarray) -> np.ndarray:
        """Rows (..., k) mm of displacements (..., m, 3) mm."""
        return np.tensordot(displacements, self.functionals, axes=((-2, -1), (1, 2)))

    def displacements(self, rows: np.ndarray) -> np.ndarray:
        """Displacements (..., m, 3) mm of rows (..., k) mm."""
        return np.tensordot(rows, self.modes, axes=(-1, 0))

    def left(self, displacements: np.ndarray) -> tuple[float, float]:
        """Root mean square and largest distance mm of the surface nodes from where their own rows put them;
        displacements (m, 3)."""
        apart = displacements - self.displacements(self.rows(displacements))
        square = (apart**2).sum(axis=1)
        return float(np.sqrt(self.weights @ square)), float(np.sqrt(square.max()))


def skin_bytes(skin: Skin) -> bytes:
    """An .npz; equal arrays, equal bytes."""
    return npz_bytes({name: getattr(skin, name) for name in Skin.__dataclass_fields__})


def skin_from(data: bytes) -> Skin:
    """Skin from bytes that `skin_bytes` made in this run. ValueError where they are damaged."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            return Skin(**{name: stored[name] for name in Skin.__dataclass_fields__})
    except (OSError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise ValueError(str(error)) from None


def read_skin(path: Path) -> Skin:
    """Skin of a file of a dataset. InputError where it is damaged, or its arrays do not fit each other."""
    arrays = read_npz(path)
    try:
        return checked_skin(arrays)
    except InputError as error:
        raise InputError(f"is damaged: {error.what}", where=str(path), do="sample it again with --force") from None


def checked_skin(arrays: dict[str, np.ndarray]) -> Skin:
    """Skin from its arrays. InputError naming the array that is missing or does not fit the others."""
    m = len(take(arrays, "nodes", (None,), "iu"))
    triangles = take(arrays, "triangles", (None, 3), "iu")
    if triangles.min() < 0 or triangles.max() >= m:
        raise InputError(f"array 'triangles' names nodes that are not among the {m}")
    skin = Skin(
        arrays["nodes"],
        take(arrays, "rest", (m, 3)),
        triangles,
        take(arrays, "weights", (m,)),
        take(arrays, "modes", (None, m, 3)),
        take(arrays, "front", (None, 2)),
    )
    return skin if not arrays.get("inner_nodes", np.zeros(0)).size else replace(skin, **checked_inside(arrays))


def checked_inside(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Arrays of the inner nodes. InputError as `checked_skin`."""
    p = len(take(arrays, "inner_nodes", (None,), "iu"))
    return {
        "inner_nodes": arrays["inner_nodes"],
        "inner_rest": take(arrays, "inner_rest", (p, 3)),
        "inner_modes": take(arrays, "inner_modes", (len(arrays["modes"]), p, 3)),
        "inner_left": take(arrays, "inner_left", (2,)),
    }
