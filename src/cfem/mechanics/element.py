"""Tetrahedral elements as declared facts: nodes, quadrature, shape functions, and whether they carry a pressure."""

from dataclasses import dataclass

import numpy as np

from cfem.mechanics.mesh import TET_EDGES

# Centroid, and the symmetric four-point rule of degree 2 (Zienkiewicz and Taylor, The Finite Element Method, 6.3).
_CENTROID = np.full((1, 4), 0.25)
_A, _B = (5 + 3 * np.sqrt(5)) / 20, (5 - np.sqrt(5)) / 20
_FOUR = np.full((4, 4), _B) + (_A - _B) * np.eye(4)


@dataclass(frozen=True)
class Element:
    """name as in specs; order 1 or 2; points (q, 4) barycentric, of equal weight; pressure: one value an element."""

    name: str
    order: int
    points: np.ndarray
    pressure: bool = False

    @property
    def n_nodes(self) -> int:
        return 4 if self.order == 1 else 10


ELEMENTS = {
    element.name: element
    for element in (
        Element("tet4", 1, _CENTROID),
        Element("tet10", 2, _FOUR),
        Element("tet10p0", 2, _FOUR, pressure=True),
    )
}


def shape(order: int, barycentric: np.ndarray) -> np.ndarray:
    """(k, n_nodes) shape functions at barycentric coordinates (k, 4), VTK node order."""
    L = np.asarray(barycentric, dtype=float)
    if order == 1:
        return L
    return np.hstack([L * (2 * L - 1), 4 * L[:, TET_EDGES[:, 0]] * L[:, TET_EDGES[:, 1]]])


def shape_derivatives(order: int, barycentric: np.ndarray) -> np.ndarray:
    """(k, n_nodes, 4) derivatives of the shape functions by the four barycentric coordinates."""
    L = np.asarray(barycentric, dtype=float)
    corner = np.zeros((len(L), 4, 4))
    corner[:, range(4), range(4)] = 1.0 if order == 1 else 4 * L - 1
    if order == 1:
        return corner
    middle = np.zeros((len(L), 6, 4))
    for edge, (a, b) in enumerate(TET_EDGES):
        middle[:, edge, a], middle[:, edge, b] = 4 * L[:, b], 4 * L[:, a]
    return np.concatenate([corner, middle], axis=1)


def barycentric_gradients(X: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(m, 4, 3) gradients of the barycentric coordinates of straight-edged tetrahedra, 1/mm."""
    corners = X[cells[:, :4]]
    edges = corners[:, 1:] - corners[:, :1]  # rows X_i - X_0: the Jacobian, transposed
    inverse = np.linalg.inv(edges)  # columns are the gradients of L_1, L_2, L_3
    gradients = np.empty((len(cells), 4, 3))
    gradients[:, 1:] = np.swapaxes(inverse, 1, 2)
    gradients[:, 0] = -gradients[:, 1:].sum(axis=1)
    return gradients
