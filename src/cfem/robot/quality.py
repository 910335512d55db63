"""How good a mesh is: dihedral angles, inverted cells, and its volume against the CAD model's."""

from dataclasses import asdict, dataclass

import numpy as np

from cfem.mechanics.element import barycentric_gradients
from cfem.mechanics.mesh import Mesh


@dataclass(frozen=True)
class Quality:
    """Angles in degrees, volumes in mm^3, volume_error relative to the CAD volume (None where there is none)."""

    nodes: int
    cells: int
    smallest_dihedral_deg: float
    largest_dihedral_deg: float
    inverted: int
    volume: float
    cad_volume: float | None
    volume_error: float | None

    def as_dict(self) -> dict:
        return asdict(self)


def quality(mesh: Mesh, cad_volume: float | None) -> Quality:
    """Inverted cells are those of negative volume."""
    angles = dihedral_angles(mesh)
    volume = float(mesh.volumes.sum())
    return Quality(
        nodes=len(mesh.X),
        cells=len(mesh.cells),
        smallest_dihedral_deg=float(angles.min()),
        largest_dihedral_deg=float(angles.max()),
        inverted=int((mesh.volumes <= 0).sum()),
        volume=volume,
        cad_volume=cad_volume,
        volume_error=None if cad_volume is None else volume / cad_volume - 1,
    )


def dihedral_angles(mesh: Mesh) -> np.ndarray:
    """(m, 6) degrees. The gradient of a barycentric coordinate is normal to the face it vanishes on."""
    gradients = barycentric_gradients(mesh.X, mesh.cells)
    normals = gradients / np.linalg.norm(gradients, axis=2, keepdims=True)
    first, second = np.triu_indices(4, 1)
    cosines = -np.einsum("mfd,mfd->mf", normals[:, first], normals[:, second])
    return np.degrees(np.arccos(np.clip(cosines, -1, 1)))
