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
    """Frame of the camera that sees the effectors, which may have moved.

    points: (k, 3) numbers of the effector rows that are x, y and z of a point
    rest_e: (n_e,) mm, where the effectors rest"""

    points: np.ndarray
    rest_e: np.ndarray

    @classmethod
    def of(cls, rows: Rows, rest_e: np.ndarray) -> "CameraFrame":
        names = list(rows.effectors)
        starts = [name[:-2] for name in names if name.endswith(".x")]
        groups = [[f"{start}{axis}" for axis in AXES] for start in starts]
        points = [[names.index(name) for name in group] for group in groups if set(group) <= set(names)]
        return cls(np.array(points, dtype=int).reshape(-1, 3), np.asarray(rest_e, float))

    def shown(self, delta_e: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Effectors (n_e,) mm from rest as they are seen after the camera has moved by (6,): t in mm, then the
        rotation."""
        shown = np.array(delta_e, float)
        x = self.rest_e[self.points] + shown[self.points]
        shown[self.points] = Rotation.from_rotvec(moved[3:]).apply(x) + moved[:3] - self.rest_e[self.points]
        return shown

    def true(self, delta_e: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Effectors (n_e,) mm from rest that are seen at delta_e: the inverse of `shown`."""
        true = np.array(delta_e, float)
        x = self.rest_e[self.points] + true[self.points] - moved[:3]
        true[self.points] = Rotation.from_rotvec(-moved[3:]).apply(x) - self.rest_e[self.points]
        return true

    def turned(self, J: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Derivatives (n_e, k) of `shown` from those of delta_e."""
        turned, R = J.copy(), Rotation.from_rotvec(moved[3:]).as_matrix()
        turned[self.points] = np.einsum("ij,pjk->pik", R, J[self.points])
        return turned

    def slopes(self, delta_e: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Derivatives (n_e, 6) of `shown` by `moved`."""
        slopes = np.zeros((len(delta_e), 6))
        slopes[self.points, :3] = np.eye(3)
        for axis in range(3, 6):
            step = STEP * np.eye(6)[axis]
            slopes[:, axis] = (self.shown(delta_e, moved + step) - self.shown(delta_e, moved - step)) / (2 * STEP)
        return slopes
