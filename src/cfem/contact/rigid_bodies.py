"""Rigid bodies that give way to the forces of contact within one step in time.

Their poses are predicted for the end of the step, under the wrench that acted before. Another wrench moves them by

    xi = Y (wrench - before)        Y = dt^2 J M^-1 J^T

with the inertia M and the Jacobians J of their centres: what implicit Euler does. A point x of a body of centre c moves
by G xi, G = [1, -(x - c) x]. Bodies that joints connect, as the links of an arm, move each other: Y is full."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation


@dataclass(frozen=True, eq=False)
class RigidBodies:
    """Bodies (b) of a scene. Their motions and wrenches are six numbers each, along and about the scene's axes: mm and
    rad, N and N mm.

    centres: (b, 3) mm, predicted
    mobility: (6 b, 6 b), Y
    before: (6 b,) wrench under which the poses are predicted
    of_robots, of_obstacles: (r,) and (n,) number of the body that each is fixed to; -1 of what stands still"""

    centres: np.ndarray
    mobility: np.ndarray
    before: np.ndarray
    of_robots: np.ndarray
    of_obstacles: np.ndarray

    def levers(self, bodies: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(p, 3, 6 b): G of points (p, 3) mm of bodies (p,)."""
        G = np.zeros((len(points), 3, len(self.centres), 6))
        each = np.flatnonzero(bodies >= 0)
        x, y, z = (points[each] - self.centres[bodies[each]]).T
        mine = np.zeros((len(each), 3, 6))
        mine[:, range(3), range(3)] = 1.0
        mine[:, 0, 4], mine[:, 1, 5], mine[:, 2, 3] = z, x, y
        mine[:, 0, 5], mine[:, 1, 3], mine[:, 2, 4] = -y, -z, -x
        G[each, :, bodies[each]] = mine
        return G.reshape(len(points), 3, 6 * len(self.centres))

    def motions(self, wrench: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(b, 3, 3) and (b, 3) mm: the motions x -> R x + t from the predicted poses, of a wrench (6 b,)."""
        xi = (self.mobility @ (wrench - self.before)).reshape(-1, 6)
        R = Rotation.from_rotvec(xi[:, 3:]).as_matrix()
        return R, self.centres + xi[:, :3] - (R @ self.centres[:, :, None])[:, :, 0]
