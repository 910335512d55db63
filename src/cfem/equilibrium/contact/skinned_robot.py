"""A robot of finite elements whose surface touches by points: means of patches, or nodes; placed in a scene."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from cfem.condensed.patches import Patches, SurfacePoints
from cfem.contact.detection import regions, spacings
from cfem.contact.surface.triangles import area_vectors
from cfem.contact.touching_facets import Facets
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot, demand_without_discrepancy

HELD = 0.9  # share of a patch's nodes that are held: it touches nothing


@dataclass(frozen=True, eq=False)
class SkinnedRobot:
    """A robot; nodes (m,) of its surface in the mesh, triangles (t, 3) of them, and the points by which it touches,
    patches or others; R (3, 3) and t (3,) mm from its frame to the scene's; itself: whether it may touch itself."""

    robot: Robot
    nodes: np.ndarray
    triangles: np.ndarray
    patches: Patches | SurfacePoints
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    t: np.ndarray = field(default_factory=lambda: np.zeros(3))
    itself: bool = True

    def __post_init__(self):
        demand_without_discrepancy(self.robot, "contact")

    @cached_property
    def problem(self) -> Problem:
        """Problem of the robot whose surface touches: its named contact points, if any, touch nothing."""
        return Problem(replace(self.robot, contacts=(), rows=replace(self.robot.rows, contacts=())))

    def motion_of_points(self, x: np.ndarray) -> sp.csc_array:
        """Matrix (n_dof, 3 N) from points to unknowns, whose transpose is from unknowns to points, nodes at x (n, 3)
        mm."""
        kinematics = self.problem.kinematics
        if kinematics.groups is None:
            return self._motion
        return sp.csc_array(kinematics.transfer_matrix(x).T @ self._nodal)

    @cached_property
    def _motion(self) -> sp.csc_array:
        return sp.csc_array(self.problem.kinematics.transfer_matrix(self.robot.X).T @ self._nodal)

    @cached_property
    def _nodal(self) -> sp.csr_array:
        """Matrix (3 n, 3 N) from points to nodes."""
        weights = sp.coo_array(self.patches.weights)
        shape = (len(self.robot.X), len(self.patches))
        by_node = sp.coo_array((weights.data, (self.nodes[weights.col], weights.row)), shape=shape)
        return sp.csr_array(sp.kron(by_node, np.eye(3)))

    def normals(self, surface: np.ndarray) -> np.ndarray:
        """Outward unit normals (N, 3) of the points of a surface at (m, 3) mm."""
        total = (self.patches.weights != 0) @ area_vectors(surface, self.triangles)
        return total / np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]

    @cached_property
    def regions(self) -> tuple[np.ndarray, np.ndarray]:
        return regions(self.robot.X[self.nodes], self.triangles, self.patches)

    @cached_property
    def facets(self) -> Facets:
        weights, count = self.patches.weights, len(self.patches)
        if weights.shape[1] != count or (weights != sp.eye_array(count)).nnz:
            return Facets.none(count)
        return Facets.of(self.triangles[~self.held_still[self.triangles].any(axis=1)], self.patches.rest)

    @cached_property
    def spacings(self) -> np.ndarray:
        return spacings(self.robot.X[self.nodes], self.triangles, self.patches)

    @cached_property
    def held_still(self) -> np.ndarray:
        return self.patches.mean(np.isin(self.nodes, self.robot.fixed).astype(float)) > HELD

    def surface(self, x: np.ndarray) -> np.ndarray:
        """Surface nodes (m, 3) mm in the scene's axes, of the body whose nodes are at x (n, 3) mm in its own."""
        return x[self.nodes] @ self.R.T + self.t
