"""Which points lie inside a body of tetrahedra or hexahedra."""

from dataclasses import dataclass

import numpy as np

from cfem.mechanics.mesh import HEX_TETS, Mesh

_PAIRS = 2_000_000  # of points and tetrahedra at a time
_SLACK = 1e-9


@dataclass(frozen=True)
class Interior:
    """Of m tetrahedra: low, high (m, 3) mm, boxes around them; slope (m, 3, 3) 1/mm and shift (m, 3), such that three
    of the barycentric coordinates of x are slope @ x + shift."""

    low: np.ndarray
    high: np.ndarray
    slope: np.ndarray
    shift: np.ndarray

    def near(self, axis: int, at: float, reach: float = 0.0) -> np.ndarray:
        """The tetrahedra with a part within `reach` mm of a plane."""
        return np.flatnonzero((self.low[:, axis] <= at + reach) & (self.high[:, axis] >= at - reach))

    def contains(self, points: np.ndarray, among: np.ndarray) -> np.ndarray:
        """(k,) whether each point (k, 3) mm lies in one of the tetrahedra `among`."""
        if len(among) == 0:
            return np.zeros(len(points), dtype=bool)
        slope, shift = self.slope[among].reshape(-1, 3).T, self.shift[among].ravel()
        found = []
        for part in np.array_split(points, 1 + len(points) * len(among) // _PAIRS):
            inner = (part @ slope + shift).reshape(len(part), -1, 3)
            inside = (inner >= -_SLACK).all(axis=2) & (inner.sum(axis=2) <= 1 + _SLACK)
            found.append(inside.any(axis=1))
        return np.concatenate(found)


def interior(mesh: Mesh) -> Interior:
    """Hexahedra as the tetrahedra that they are cut into."""
    cells = mesh.cells[:, HEX_TETS].reshape(-1, 4) if mesh.cells.shape[1] == 8 else mesh.cells[:, :4]
    X = mesh.X[cells]
    slope = np.linalg.inv((X[:, 1:] - X[:, :1]).transpose(0, 2, 1))
    return Interior(X.min(axis=1), X.max(axis=1), slope, -np.einsum("mij,mj->mi", slope, X[:, 0]))
