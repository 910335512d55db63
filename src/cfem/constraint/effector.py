"""The effector: a point whose position is watched and controlled, three rows x, y, z in mm."""

from dataclasses import dataclass

import numpy as np

from cfem.constraint.attachment import Attachment, attach, locate
from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh


@dataclass(frozen=True)
class PointEffector:
    """A point in the body, attached through its region."""

    attachment: Attachment

    @property
    def nodes(self) -> np.ndarray:
        return self.attachment.nodes

    @property
    def rest(self) -> np.ndarray:
        return self.attachment.point

    def value(self, x: np.ndarray) -> np.ndarray:
        return self.attachment.position(x)

    def gradient(self, x: np.ndarray) -> np.ndarray:
        return np.einsum("ij,k->ikj", np.eye(3), self.attachment.weights)


@dataclass(frozen=True)
class CarriedEffector:
    """A point outside the body, carried by the best-fit rigid motion of a region (Kabsch, Acta Cryst. A32, 1976):

        y = c(x) + R(x) (X_point - C),    R = argmin sum_i w_i |x_i - c - R (X_i - C)|^2

    nodes (k,); weights (k,) sum 1; arm (k, 3) = X_i - C mm; lever (3,) = X_point - C mm."""

    nodes: np.ndarray
    weights: np.ndarray
    arm: np.ndarray
    lever: np.ndarray
    rest: np.ndarray

    def value(self, x: np.ndarray) -> np.ndarray:
        rotation, _ = self._fit(x)
        return self.weights @ x[self.nodes] + rotation @ self.lever

    def gradient(self, x: np.ndarray) -> np.ndarray:
        rotation, stretch = self._fit(x)
        # R^T dB - dB^T R = Omega S + S Omega with B = sum w x arm^T, so omega = (tr S 1 - S)^-1 axial(...)
        inverse = np.linalg.inv(np.trace(stretch) * np.eye(3) - stretch)
        # for dx_i = e_a: dB = w_i e_a arm_i^T, whose axial vector is w_i arm_i x (row a of R)
        axial = self.weights[None, :, None] * np.cross(self.arm[None, :, :], rotation[:, None, :])
        omega = axial @ inverse.T  # (a, k, 3)
        turned = np.cross(omega, self.lever) @ rotation.T  # (a, k, j): d y_j by dx_i = e_a
        return turned.transpose(2, 1, 0) + np.einsum("ij,k->ikj", np.eye(3), self.weights)

    def _fit(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        B = (self.weights[:, None] * x[self.nodes]).T @ self.arm
        U, s, Vt = np.linalg.svd(B)
        handed = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
        return U @ handed @ Vt, Vt.T @ (s[:, None] * handed) @ Vt


def make_effector(
    mesh: Mesh, point: np.ndarray, radius: float, carrier_radius: float, name: str
) -> PointEffector | CarriedEffector:
    """An effector at `point` (3,) mm: through its own region where it lies in the body, else carried by the nodes
    within `carrier_radius` mm. Raises SpecError where fewer than four nodes are near."""
    point = np.asarray(point, dtype=float)
    cells, _ = locate(mesh, point[None, :], within=1e-9)
    if cells[0] >= 0:
        return PointEffector(attach(mesh, point, radius, name))
    distance = np.linalg.norm(mesh.X - point, axis=1)
    nodes = np.flatnonzero(distance < carrier_radius)
    if len(nodes) < 4:
        raise SpecError(
            f"effector '{name}' lies outside the body with no part of it within {carrier_radius:g} mm",
            do="move it or enlarge its carrier_radius",
        )
    weights = _node_volumes(mesh)[nodes] * (1 - (distance[nodes] / carrier_radius) ** 2) ** 2
    weights = weights / weights.sum()
    centre = weights @ mesh.X[nodes]
    return CarriedEffector(nodes, weights, mesh.X[nodes] - centre, point - centre, point)


def _node_volumes(mesh: Mesh) -> np.ndarray:
    """(n,) mm^3: each cell's volume shared equally by its nodes, so that the weights tend to an integral."""
    share = np.repeat(mesh.volumes / mesh.cells.shape[1], mesh.cells.shape[1])
    return np.bincount(mesh.cells.ravel(), share, len(mesh.X))
