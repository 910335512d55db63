"""Elements as declared facts: nodes, quadrature, shape functions, and what they carry inside.

pressure: one value an element instead of the pointwise volume change, against volume locking (solid.py).
bubbles: incompatible displacement modes of an element's own, against shear locking: the hexahedron's three modes
(1 - xi_k^2) / 2 with the gradient (j0 / j) J0^-T grad_xi, which integrates to zero over the element, so that the patch
test holds (Wilson modes as an enhanced gradient: Simo, Armero and Taylor, CMAME 110, 1993, Q1/E9). Flat cells with
bubbles lose their stability under some 25 % of compression (Wriggers and Reese, CMAME 135, 1996), and beyond nu 0.499
they do not converge: hexahedra are for bending, tet10p0 for rubber."""

from dataclasses import dataclass

import numpy as np

from cfem.mechanics.mesh import TET_EDGES, TRIANGLE_EDGES, tet_volumes

# Centroid, and the symmetric four-point rule of degree 2 (Zienkiewicz and Taylor, The Finite Element Method, 6.3).
_CENTROID = np.full((1, 4), 0.25)
_A, _B = (5 + 3 * np.sqrt(5)) / 20, (5 - np.sqrt(5)) / 20
_FOUR = np.full((4, 4), _B) + (_A - _B) * np.eye(4)
# Corners of the reference cube [-1, 1]^3 in VTK's order, and the 2 x 2 x 2 Gauss rule.
HEX_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float
)
_GAUSS = HEX_CORNERS / np.sqrt(3)
# The same with one point along the first edge.
_ONE_ALONG = _GAUSS[[0, 3, 7, 4]] * [0.0, 1.0, 1.0]


@dataclass(frozen=True)
class Element:
    """An element.

    name: as in specs
    n_nodes: number of nodes
    points: (q, 4) barycentric or (q, 3) in [-1, 1]^3, of equal weight
    pressure: whether it has one
    bubbles: how many incompatible modes"""

    name: str
    n_nodes: int
    points: np.ndarray
    pressure: bool = False
    bubbles: int = 0

    @property
    def order(self) -> int:
        return 2 if self.n_nodes == 10 else 1


ELEMENTS = {
    element.name: element
    for element in (
        Element("tet4", 4, _CENTROID),
        Element("tet10", 10, _FOUR),
        Element("tet10p0", 10, _FOUR, pressure=True),
        Element("hex8", 8, _GAUSS, bubbles=3),
    )
}


# Between rigid sections, the first edges along the rod. hex8-full has the whole Gauss rule: in bending its shear locks,
# and adds G A h^2 / 12 to the bending stiffness. hex8-reduced takes the strains at the middle of the first edges, as a
# Timoshenko element with one point does (Hughes, Taylor and Kanoknukulchai, IJNME 11, 1977). beam: hexahedra that carry
# pictures and attachments, while a rod (rod/region.py) joins the sections.
SECTIONED = {
    element.name: element
    for element in (
        Element("hex8-full", 8, _GAUSS),
        Element("hex8-reduced", 8, _ONE_ALONG),
        Element("beam", 8, np.zeros((0, 3))),
    )
}


def shape(n_nodes: int, coordinates: np.ndarray) -> np.ndarray:
    """Shape functions (k, n_nodes), VTK node order, at barycentric coordinates (k, 4), or (k, 3) in [-1, 1]^3."""
    L = np.asarray(coordinates, dtype=float)
    if n_nodes == 4:
        return L
    if n_nodes == 8:
        return (1 + L[:, None, :] * HEX_CORNERS).prod(axis=2) / 8
    return np.hstack([L * (2 * L - 1), 4 * L[:, TET_EDGES[:, 0]] * L[:, TET_EDGES[:, 1]]])


def shape_derivatives(n_nodes: int, coordinates: np.ndarray) -> np.ndarray:
    """Derivatives (k, n_nodes, 4 or 3) of the shape functions by the coordinates."""
    L = np.asarray(coordinates, dtype=float)
    if n_nodes == 8:
        factors = 1 + L[:, None, :] * HEX_CORNERS
        others = np.stack(
            [factors[..., 1] * factors[..., 2], factors[..., 0] * factors[..., 2], factors[..., 0] * factors[..., 1]],
            axis=-1,
        )
        return HEX_CORNERS * others / 8
    corner = np.zeros((len(L), 4, 4))
    corner[:, range(4), range(4)] = 1.0 if n_nodes == 4 else 4 * L - 1
    if n_nodes == 4:
        return corner
    middle = np.zeros((len(L), 6, 4))
    for edge, (a, b) in enumerate(TET_EDGES):
        middle[:, edge, a], middle[:, edge, b] = 4 * L[:, b], 4 * L[:, a]
    return np.concatenate([corner, middle], axis=1)


def reference_gradients(element: Element, X: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradients (m, q, n_nodes + bubbles, 3) 1/mm at the quadrature points, those of the bubbles last, and the weights
    (m, q) mm^3, which are negative where a cell is inverted."""
    q = len(element.points)
    if element.n_nodes != 8:
        by_barycentric = shape_derivatives(element.n_nodes, element.points)
        flat = by_barycentric.reshape(-1, by_barycentric.shape[2])
        gradients = (flat @ barycentric_gradients(X, cells)).reshape(len(cells), *by_barycentric.shape[:2], 3)
        return gradients, np.repeat(tet_volumes(X, cells)[:, None] / q, q, axis=1)
    by_xi = shape_derivatives(8, element.points)
    jacobian = np.einsum("qnk,mnd->mqdk", by_xi, X[cells])
    centre = np.einsum("nk,mnd->mdk", shape_derivatives(8, np.zeros((1, 3)))[0], X[cells])
    weights, j0 = np.linalg.det(jacobian) * (8 / q), np.linalg.det(centre)
    gradients = np.einsum("qnk,mqkd->mqnd", by_xi, np.linalg.inv(jacobian))
    # row k of inv(J0) is J0^-T e_k; the derivative of the mode by xi_k is -xi_k, whose sign is of no matter
    modes = (j0[:, None] * (8 / q) / weights)[:, :, None, None] * np.einsum(
        "qk,mkd->mqkd", element.points, np.linalg.inv(centre)
    )
    return np.ascontiguousarray(np.concatenate([gradients, modes[:, :, : element.bubbles]], axis=2)), weights


def barycentric_gradients(X: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Gradients (m, 4, 3) 1/mm of the barycentric coordinates of straight-edged tetrahedra."""
    corners = X[cells[:, :4]]
    edges = corners[:, 1:] - corners[:, :1]  # rows X_i - X_0: the Jacobian, transposed
    inverse = np.linalg.inv(edges)  # columns are the gradients of L_1, L_2, L_3
    gradients = np.empty((len(cells), 4, 3))
    gradients[:, 1:] = np.swapaxes(inverse, 1, 2)
    gradients[:, 0] = -gradients[:, 1:].sum(axis=1)
    return gradients


def triangle_values(n_nodes: int, points: np.ndarray) -> np.ndarray:
    """Shape functions (q, n_nodes) at barycentric points (q, 3)."""
    if n_nodes == 3:
        return points.copy()
    first, second = points[:, TRIANGLE_EDGES].transpose(2, 0, 1)
    return np.concatenate([points * (2 * points - 1), 4 * first * second], axis=1)


def triangle_slopes(n_nodes: int, points: np.ndarray) -> np.ndarray:
    """Derivatives (q, n_nodes, 3) of the shape functions by the barycentric coordinates."""
    if n_nodes == 3:
        return np.repeat(np.eye(3)[None], len(points), axis=0)
    out = np.zeros((len(points), 6, 3))
    out[:, range(3), range(3)] = 4 * points - 1
    for edge, (a, b) in enumerate(TRIANGLE_EDGES, 3):
        out[:, edge, a], out[:, edge, b] = 4 * points[:, b], 4 * points[:, a]
    return out
