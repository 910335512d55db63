"""A mesh as a value: nodes, tetrahedra or hexahedra, boundary facets, named sets."""

from dataclasses import dataclass, field, replace

import numpy as np

# Edges of a tetrahedron and of a triangle in the order of their mid-edge nodes (VTK quadratic cells).
TET_EDGES = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]])
TRIANGLE_EDGES = np.array([[0, 1], [1, 2], [2, 0]])
# Faces of a positively oriented tetrahedron, normals outward.
TET_FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
# Faces of a hexahedron in VTK's node order, normals outward.
HEX_FACES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
# A hexahedron as six tetrahedra around the diagonal 0-6 (Kuhn), each positively oriented.
HEX_TETS = np.array([[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]])


@dataclass(frozen=True)
class Mesh:
    """A mesh at rest.

    X: (n, 3) mm
    cells: (m, 4) or (m, 10) tetrahedra, mid-edge nodes at the middle of straight edges, or (m, 8) hexahedra
    facets: (k, 3), (k, 6) or (k, 4) of the boundary, normals outward
    node_sets, facet_sets, cell_sets: name -> indices of nodes, facets, cells
    unshaped: (n, 3) mm the nodes before the scene's free form moved them, None where it has none"""

    X: np.ndarray
    cells: np.ndarray
    facets: np.ndarray
    node_sets: dict[str, np.ndarray] = field(default_factory=dict)
    facet_sets: dict[str, np.ndarray] = field(default_factory=dict)
    cell_sets: dict[str, np.ndarray] = field(default_factory=dict)
    unshaped: np.ndarray | None = None

    @property
    def base(self) -> "Mesh":
        """The mesh before its free form: what the places in a scene refer to."""
        return self if self.unshaped is None else replace(self, X=self.unshaped, unshaped=None)

    @property
    def order(self) -> int:
        """Order of the shape functions: 1 for linear tetrahedra and hexahedra, 2 for quadratic tetrahedra."""
        return 2 if self.cells.shape[1] == 10 else 1

    @property
    def volumes(self) -> np.ndarray:
        """Volumes (m,) mm^3 of the cells, negative where one is inverted."""
        return hex_volumes(self.X, self.cells) if self.cells.shape[1] == 8 else tet_volumes(self.X, self.cells)

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, mm."""
        return float(np.linalg.norm(np.ptp(self.X, axis=0)))


def tet_volumes(X: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Signed volumes (m,) mm^3 of straight-edged tetrahedra from their corners."""
    a, b, c, d = (X[cells[:, corner]] for corner in range(4))
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6


def hex_volumes(X: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Signed volumes (m,) mm^3 of the six tetrahedra of each hexahedron, exact where its faces are flat."""
    return sum(tet_volumes(X, cells[:, corners]) for corners in HEX_TETS)


def boundary_facets(cells: np.ndarray) -> np.ndarray:
    """Faces (k, 3) or (k, 4) that belong to one cell only, normals outward, in a fixed order."""
    table = HEX_FACES if cells.shape[1] == 8 else TET_FACES
    faces = cells[:, table].reshape(-1, table.shape[1])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[np.sort(first[count == 1])]


def quadratic(X: np.ndarray, cells: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Linear tetrahedra and facets with a node put in the middle of every edge: (X, cells (m, 10), facets (k, 6))."""
    edges = np.sort(cells[:, TET_EDGES].reshape(-1, 2), axis=1)
    unique, index = np.unique(edges, axis=0, return_inverse=True)
    number = len(X) + index.reshape(len(cells), 6)
    keys = unique[:, 0] * len(X) + unique[:, 1]
    facet_edges = np.sort(facets[:, TRIANGLE_EDGES].reshape(-1, 2), axis=1)
    facet_number = len(X) + np.searchsorted(keys, facet_edges[:, 0] * len(X) + facet_edges[:, 1]).reshape(-1, 3)
    middle = X[unique].mean(axis=1)
    return np.vstack([X, middle]), np.hstack([cells, number]), np.hstack([facets, facet_number])
