"""Quality of a mesh: angles or corners, inverted cells, and its volume against the CAD model's."""

from dataclasses import dataclass

import numpy as np

from cfem.core.console.shown import counted
from cfem.mechanics.element import barycentric_gradients
from cfem.mechanics.mesh import Mesh

# The three neighbours of each corner of a hexahedron in VTK's node order, right-handed.
_NEIGHBOURS = np.array([[1, 3, 4], [2, 0, 5], [3, 1, 6], [0, 2, 7], [7, 5, 0], [4, 6, 1], [5, 7, 2], [6, 4, 3]])

FLAT = 3.0  # degrees: a tetrahedron of a smaller dihedral angle, or one that near to 180, is nearly flat
SKEWED = 0.05  # scaled Jacobian of a corner of a hexahedron that is nearly flat

_FAITHFUL = 0.03  # of the volume; the error of the bending stiffness is about twice as large


@dataclass(frozen=True)
class Quality:
    """Figures of a mesh: counts, shape of the worst cell, volume."""

    nodes: int
    cells: int
    smallest_dihedral_deg: float | None  # of tetrahedra
    largest_dihedral_deg: float | None
    smallest_scaled_jacobian: float | None  # of hexahedra: at the worst corner, 1 for a right angle on all sides
    inverted: int
    volume: float  # mm^3
    cad_volume: float | None  # mm^3
    volume_error: float | None  # relative to the CAD volume
    flat: int = 0  # cells that are nearly flat, by FLAT and SKEWED

    def sentence(self) -> str:
        """Sentence for a person."""
        corners = (
            f"smallest scaled Jacobian {self.smallest_scaled_jacobian:.2g}"
            if self.smallest_dihedral_deg is None
            else f"dihedral angles from {self.smallest_dihedral_deg:.0f} to {self.largest_dihedral_deg:.0f} deg"
        )
        cad = "" if self.volume_error is None else f", {100 * abs(self.volume_error):.2g} % from the CAD volume"
        return f"{self.nodes} nodes, {self.cells} cells; volume {self.volume:.6g} mm^3{cad}; {corners}"

    def doubts(self, from_file: bool = False) -> list[str]:
        """Sentences on why no results on the mesh can be trusted. from_file: whether its cells were read, not made
        here."""
        doubts = self._unfaithful()
        if self.flat:
            worst = (
                f"a scaled Jacobian down to {self.smallest_scaled_jacobian:.2g}"
                if self.smallest_dihedral_deg is None
                else f"angles of {self.smallest_dihedral_deg:.1f} to {self.largest_dihedral_deg:.1f} deg between faces"
            )
            do = "give a smaller mesh.size, or a surface without slivers"
            if from_file:
                do = "give its surface as .stl, which cfem meshes itself, or mesh the body again where the file is from"
            share = f"{self.flat} of {counted(self.cells, 'cell')} {'is' if self.flat == 1 else 'are'}"
            doubts.append(f"{share} nearly flat, with {worst}: {do}")
        return doubts

    def _unfaithful(self) -> list[str]:
        """The sentence on cells whose volume differs from that of the CAD model, if it does."""
        if self.volume_error is None or abs(self.volume_error) <= _FAITHFUL:
            return []
        share = 100 * abs(self.volume_error)
        amount, stiffness = ("less", "softer") if self.volume_error < 0 else ("more", "stiffer")
        return [
            f"the cells hold {share:.1f} % {amount} than the CAD model, and the body is about {2 * share:.0f} % "
            f"{stiffness} in bending: make mesh.size smaller where the surface is curved"
        ]


def quality(mesh: Mesh, cad_volume: float | None) -> Quality:
    """Figures of a mesh. Inverted are tetrahedra of negative volume, and hexahedra with a corner that is."""
    volume = float(mesh.volumes.sum())
    if mesh.cells.shape[1] == 8:
        corners = scaled_jacobians(mesh)
        smallest, largest, jacobian = None, None, float(corners.min())
        inverted, flat = (corners <= 0).any(axis=1), (corners < SKEWED).any(axis=1)
    else:
        angles = dihedral_angles(mesh)
        smallest, largest, jacobian = float(angles.min()), float(angles.max()), None
        inverted, flat = mesh.volumes <= 0, ((angles < FLAT) | (angles > 180 - FLAT)).any(axis=1)
    return Quality(
        nodes=len(mesh.X),
        cells=len(mesh.cells),
        smallest_dihedral_deg=smallest,
        largest_dihedral_deg=largest,
        smallest_scaled_jacobian=jacobian,
        inverted=int(inverted.sum()),
        volume=volume,
        cad_volume=cad_volume,
        volume_error=None if cad_volume is None else volume / cad_volume - 1,
        flat=int(flat.sum()),
    )


def dihedral_angles(mesh: Mesh) -> np.ndarray:
    """Dihedral angles (m, 6) degrees of tetrahedra. The gradient of a barycentric coordinate is normal to the face it
    vanishes on."""
    gradients = barycentric_gradients(mesh.X, mesh.cells)
    normals = gradients / np.linalg.norm(gradients, axis=2, keepdims=True)
    first, second = np.triu_indices(4, 1)
    cosines = -np.einsum("mfd,mfd->mf", normals[:, first], normals[:, second])
    return np.degrees(np.arccos(np.clip(cosines, -1, 1)))


def scaled_jacobians(mesh: Mesh) -> np.ndarray:
    """Scaled Jacobians (m, 8) in [-1, 1]: determinant of the unit vectors along the three edges at each corner of
    hexahedra (Knupp, Int. J. Numer. Meth. Engng 48, 2000)."""
    edges = mesh.X[mesh.cells[:, _NEIGHBOURS]] - mesh.X[mesh.cells][:, :, None]
    return np.linalg.det(edges / np.linalg.norm(edges, axis=3, keepdims=True))
