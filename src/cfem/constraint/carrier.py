"""The best-fit rigid motion of a region of the body (Kabsch, Acta Cryst. A32, 1976):

    R = argmin sum_i w_i |x_i - c - R (X_i - C)|^2,    c = sum_i w_i x_i

With B = sum_i w_i x_i (X_i - C)^T = R S, S symmetric, and dR = R [omega]:

    (tr S 1 - S) omega = axial(R^T dB - dB^T R)"""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh


@dataclass(frozen=True)
class Carrier:
    """A region of the body that carries something.

    nodes: (k,)
    weights: (k,) of sum 1
    centre: (3,) mm, C
    arm: (k, 3) mm, X_i - C"""

    nodes: np.ndarray
    weights: np.ndarray
    centre: np.ndarray
    arm: np.ndarray

    def rotation(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Polar decomposition of the carrier's motion: rotation R and stretch S (3, 3)."""
        B = (self.weights[:, None] * x[self.nodes]).T @ self.arm
        U, s, Vt = np.linalg.svd(B)
        handed = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
        return U @ handed @ Vt, Vt.T @ (s[:, None] * handed) @ Vt

    def spin(self, rotation: np.ndarray, stretch: np.ndarray) -> np.ndarray:
        """Derivative (3, k, 3) 1/mm of the spin omega, in the frame at rest, by the positions of the nodes."""
        inverse = np.linalg.inv(np.trace(stretch) * np.eye(3) - stretch)
        # for dx_i = e_a: dB = w_i e_a arm_i^T, whose axial vector is w_i arm_i x (row a of R)
        axial = self.weights[None, :, None] * np.cross(self.arm[None, :, :], rotation[:, None, :])
        return (axial @ inverse.T).transpose(2, 1, 0)


def make_carrier(mesh: Mesh, points: np.ndarray, radius: float, name: str, cells: np.ndarray | None = None) -> Carrier:
    """The nodes (of `cells`, where given) within `radius` mm of any of points (k, 3), weighted by their share of the
    volume and a smooth bump around each point. Raises SpecError where they are too few to fix a rotation."""
    volumes = _node_volumes(mesh, cells)
    apart = np.linalg.norm(mesh.X[:, None] - points, axis=2) / radius
    weights = volumes * (np.maximum(1 - apart**2, 0) ** 2).sum(axis=1)
    nodes = np.flatnonzero(weights > 0)
    if len(nodes) < 4:
        raise SpecError(
            f"{name} has too little of the body within {radius:g} mm to carry it: {len(nodes)} nodes",
            do="move it or enlarge its carrier_radius",
        )
    weights = weights[nodes] / weights[nodes].sum()
    centre = weights @ mesh.X[nodes]
    arm = mesh.X[nodes] - centre
    spread = np.linalg.eigvalsh(arm.T @ (weights[:, None] * arm))
    if spread[1] < 1e-8 * spread[2]:
        raise SpecError(
            f"{name} is carried by nodes on one line, about which it could turn", do="enlarge its carrier_radius"
        )
    return Carrier(nodes, weights, centre, arm)


def _node_volumes(mesh: Mesh, cells: np.ndarray | None) -> np.ndarray:
    """Volumes (n,) mm^3 of the nodes, each cell's shared equally, so that the weights tend to an integral."""
    chosen = slice(None) if cells is None else cells
    nodes = mesh.cells[chosen]
    share = np.repeat(mesh.volumes[chosen] / nodes.shape[1], nodes.shape[1])
    return np.bincount(nodes.ravel(), share, len(mesh.X))
