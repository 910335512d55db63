"""Which points lie inside a body of tetrahedra or hexahedra."""

from dataclasses import dataclass

import numpy as np

from cfem.mechanics.mesh import HEX_TETS, Mesh

_PAIRS = 50_000  # of points and tetrahedra at a time, which stay in the cache
_SLACK = 1e-9


@dataclass(frozen=True)
class Interior:
    """Of m tetrahedra: low, high (m, 3) mm, boxes around them; slope (m, 3, 3) 1/mm and shift (m, 3), such that three
    of the barycentric coordinates of x are slope @ x + shift."""

    low: np.ndarray
    high: np.ndarray
    slope: np.ndarray
    shift: np.ndarray

    def near_plane(self, place: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The tetrahedra whose boxes meet the plane through `place` (3,) mm across `normal` (3,)."""
        middle, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        return np.flatnonzero(np.abs((middle - place) @ normal) <= half @ np.abs(normal) + 1e-12)

    def near_points(self, points: np.ndarray, reach: float) -> np.ndarray:
        """The tetrahedra whose boxes meet the box around points (k, 3) mm, which is larger by `reach` mm."""
        low, high = points.min(axis=0) - reach, points.max(axis=0) + reach
        return np.flatnonzero(((self.low <= high) & (self.high >= low)).all(axis=1))

    def contains(self, points: np.ndarray, among: np.ndarray) -> np.ndarray:
        """Mask (k,) of the points (k, 3) mm that lie in one of the tetrahedra `among`."""
        if len(among) == 0:
            return np.zeros(len(points), dtype=bool)
        slope, shift, contained = self.slope[among], self.shift[among], []
        for part in np.array_split(points, 1 + len(points) * len(among) // _PAIRS):
            inner = [part @ slope[:, side].T + shift[:, side] for side in range(3)]
            inside = inner[0] + inner[1] + inner[2] <= 1 + _SLACK
            for each in inner:
                inside &= each >= -_SLACK
            contained.append(inside.any(axis=1))
        return np.concatenate(contained)


def interior(mesh: Mesh) -> Interior:
    """Hexahedra as the tetrahedra that they are cut into."""
    cells = mesh.cells[:, HEX_TETS].reshape(-1, 4) if mesh.cells.shape[1] == 8 else mesh.cells[:, :4]
    X = mesh.X[cells]
    slope = np.linalg.inv((X[:, 1:] - X[:, :1]).transpose(0, 2, 1))
    return Interior(X.min(axis=1), X.max(axis=1), slope, -np.einsum("mij,mj->mi", slope, X[:, 0]))
