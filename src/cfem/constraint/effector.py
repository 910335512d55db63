"""Effectors: what is watched and controlled, rows x, y, z in mm and, if asked, a rotation vector rx, ry, rz in rad."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.condensed.rotation import cross_matrix, inverse_left_jacobian
from cfem.constraint.attachment import Attachment, attach, locate, show
from cfem.constraint.carrier import Carrier, make_carrier
from cfem.constraint.protocol import Watched
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
    """A point outside the body, moved by the best-fit rigid motion of a region: y = c(x) + R(x) lever.

    lever (3,) mm: from the centre of the region to the point, at rest; rest (3,) mm."""

    carrier: Carrier
    lever: np.ndarray
    rest: np.ndarray

    @property
    def nodes(self) -> np.ndarray:
        return self.carrier.nodes

    def value(self, x: np.ndarray) -> np.ndarray:
        rotation, _ = self.carrier.rotation(x)
        return self.carrier.weights @ x[self.nodes] + rotation @ self.lever

    def gradient(self, x: np.ndarray) -> np.ndarray:
        rotation, stretch = self.carrier.rotation(x)
        # R (omega x lever) = -R [lever] omega
        turned = np.tensordot(-rotation @ cross_matrix(self.lever), self.carrier.spin(rotation, stretch), axes=1)
        return turned + np.einsum("ij,k->ikj", np.eye(3), self.carrier.weights)


@dataclass(frozen=True)
class RotationEffector:
    """The rotation vector phi (rad) of the best-fit rotation R = exp [phi] of a region since rest.

    Smooth for |phi| < pi. At |phi| = pi it jumps to -phi, as every rotation vector does: a motion that turns further
    than half a turn from rest has to be watched by points instead."""

    carrier: Carrier

    @property
    def nodes(self) -> np.ndarray:
        return self.carrier.nodes

    @property
    def rest(self) -> np.ndarray:
        return np.zeros(3)

    def value(self, x: np.ndarray) -> np.ndarray:
        return Rotation.from_matrix(self.carrier.rotation(x)[0]).as_rotvec()

    def gradient(self, x: np.ndarray) -> np.ndarray:
        rotation, stretch = self.carrier.rotation(x)
        to_vector = inverse_left_jacobian(self.value(x)) @ rotation  # the spin is in the frame at rest
        return np.tensordot(to_vector, self.carrier.spin(rotation, stretch), axes=1)


@dataclass(frozen=True)
class CombinedEffector:
    """Rows that are fixed linear combinations of the rows of others: a mean, or a position with an orientation.

    matrix (rows, rows of all parts); nodes: of any part."""

    parts: tuple[Watched, ...]
    matrix: np.ndarray
    nodes: np.ndarray

    @property
    def rest(self) -> np.ndarray:
        return self.matrix @ np.concatenate([part.rest for part in self.parts])

    def value(self, x: np.ndarray) -> np.ndarray:
        return self.matrix @ np.concatenate([part.value(x) for part in self.parts])

    def gradient(self, x: np.ndarray) -> np.ndarray:
        rows = np.zeros((self.matrix.shape[1], len(self.nodes), 3))
        for index, part in enumerate(self.parts):
            rows[3 * index : 3 * index + 3, np.searchsorted(self.nodes, part.nodes)] = part.gradient(x)
        return np.tensordot(self.matrix, rows, axes=1)


def make_effector(
    mesh: Mesh,
    points: np.ndarray,
    radius: float,
    carrier_radius: float,
    name: str,
    orientation: bool = False,
    cells: np.ndarray | None = None,
) -> Watched:
    """An effector at `points` (3,) mm, or at the mean of (k, 3): three rows, or six with `orientation`.

    Each point acts through its own region where it lies in the body, else it is carried by the nodes within
    `carrier_radius` mm, which the orientation is of too. `cells` restricts all to these cells, one body of several.
    Raises SpecError where nothing of the body is near, or too little to fix a rotation."""
    points = np.atleast_2d(np.asarray(points, dtype=float))
    label = f"effector '{name}'"
    parts: list[Watched] = [_position(mesh, point, radius, carrier_radius, label, cells) for point in points]
    matrix = np.tile(np.eye(3), len(points)) / len(points)
    if orientation:
        parts.append(RotationEffector(make_carrier(mesh, points, carrier_radius, label, cells)))
        matrix = np.block([[matrix, np.zeros((3, 3))], [np.zeros_like(matrix), np.eye(3)]])
    return parts[0] if len(parts) == 1 else _combined(parts, matrix)


def _position(
    mesh: Mesh, point: np.ndarray, radius: float, carrier_radius: float, label: str, cells: np.ndarray | None
) -> PointEffector | CarriedEffector:
    if locate(mesh, point[None], within=1e-9, cells=cells)[0][0] >= 0:
        return PointEffector(attach(mesh, point, radius, label, cells))
    label = f"{label} at {show(point)} mm lies outside the body and"
    carrier = make_carrier(mesh, point[None], carrier_radius, label, cells)
    return CarriedEffector(carrier, point - carrier.centre, point)


def _combined(parts: Sequence[Watched], matrix: np.ndarray) -> CombinedEffector:
    return CombinedEffector(tuple(parts), matrix, np.unique(np.concatenate([part.nodes for part in parts])))
