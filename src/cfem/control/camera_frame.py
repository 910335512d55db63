"""The frame of a camera that was moved or turned since it was aligned: what it shows of the effectors.

An effector at x in the frame of the scene is seen at R x + t, R the rotation by a vector (rad) about the scene's
origin. Only groups of rows x, y, z are seen so; other rows are not."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.condensed import Rows

STEP = 1e-6  # rad: of differences by the rotation
AXES = (".x", ".y", ".z")


@dataclass(frozen=True)
class CameraFrame:
    """points (k, 3): numbers of the effector rows that are x, y and z of a point; rest_e (n_e,) mm."""

    points: np.ndarray
    rest_e: np.ndarray

    @classmethod
    def of(cls, rows: Rows, rest_e: np.ndarray) -> "CameraFrame":
        names = list(rows.effectors)
        starts = [name[:-2] for name in names if name.endswith(".x")]
        groups = [[f"{start}{axis}" for axis in AXES] for start in starts]
        whole = [[names.index(name) for name in group] for group in groups if set(group) <= set(names)]
        return cls(np.array(whole, dtype=int).reshape(-1, 3), np.asarray(rest_e, float))

    def shown(self, delta_e: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """(n_e,) mm from rest, as it is seen after the camera has moved by (6,): t in mm, then the rotation."""
        found = np.array(delta_e, float)
        x = self.rest_e[self.points] + found[self.points]
        found[self.points] = Rotation.from_rotvec(moved[3:]).apply(x) + moved[:3] - self.rest_e[self.points]
        return found

    def true(self, delta_e: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """The inverse of `shown`."""
        found = np.array(delta_e, float)
        x = self.rest_e[self.points] + found[self.points] - moved[:3]
        found[self.points] = Rotation.from_rotvec(-moved[3:]).apply(x) - self.rest_e[self.points]
        return found

    def turned(self, J: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """(n_e, k) derivatives of `shown` from those of delta_e."""
        found, R = J.copy(), Rotation.from_rotvec(moved[3:]).as_matrix()
        found[self.points] = np.einsum("ij,pjk->pik", R, J[self.points])
        return found

    def slopes(self, delta_e: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """(n_e, 6) of `shown` by `moved`."""
        found = np.zeros((len(delta_e), 6))
        found[self.points, :3] = np.eye(3)
        for axis in range(3, 6):
            step = STEP * np.eye(6)[axis]
            found[:, axis] = (self.shown(delta_e, moved + step) - self.shown(delta_e, moved - step)) / (2 * STEP)
        return found
