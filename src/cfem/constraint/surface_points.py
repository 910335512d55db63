"""Points by which a surface touches at the resolution of its mesh: its nodes, or averages around them.

At nodes the gap is where the surface is, and forces are those of nodes. A uniform pressure on quadratic triangles has
none at their corners, so that forces are no measure of the pressure there, and friction acts at the middles of edges
alone. An average around a node j takes a hat psi_j, linear on the (quarter) triangles around it:

    gap_j = int psi_j g / int psi_j        pressure p = sum_j p_j psi_j,  f_j = p_j int psi_j >= 0

which has any uniform pressure exactly (a mortar form; quadratic displacements with multipliers linear in parts: Puso,
Laursen and Solberg, CMAME 197, 2008). Hats end at sharp edges: a node there has one on each side, as an average around
an edge would lie in the body."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from cfem.condensed.patches import SHARP, SurfacePoints
from cfem.constraint.surface import Surface
from cfem.contact.surface.triangles import normals_of

# Barycentric points and weights of degree 4 (Dunavant, IJNME 21, 1985), Gauss points of the square.
_A, _B = 0.445948490915965, 0.091576213509771
_TRIANGLE = np.array([np.roll([1 - 2 * a, a, a], i) for a in (_A, _B) for i in range(3)])
_TRIANGLE_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)
_QUARTERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
_GAUSS = np.array([[x, y] for x in (-1, 1) for y in (-1, 1)]) / np.sqrt(3)
NONE = 1e-9  # of the largest area: rounding
_SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


def at_nodes(X: np.ndarray, facets: np.ndarray, surface: Surface) -> SurfacePoints:
    """Surface points at every node of the surface of facets (k, 3 | 6 | 4) at nodes X (n, 3) mm."""
    m, outer = len(surface.nodes), _outer(facets, surface)
    shapes, _, weights = facet_rule(X, outer)
    local = np.searchsorted(surface.nodes, outer)
    areas = np.bincount(local.ravel(), (weights @ shapes).ravel(), m)
    identity = csr_array((np.ones(m), (np.arange(m), np.arange(m))), shape=(m, m))
    return SurfacePoints(identity, surface.rest, np.where(areas > NONE * areas.max(), areas, 0.0))


def around_nodes(X: np.ndarray, facets: np.ndarray, surface: Surface) -> SurfacePoints:
    """Averages around every node of the surface of facets (k, 3 | 6 | 4) at nodes X (n, 3) mm, one on each smooth side
    of it."""
    outer = _outer(facets, surface)
    shapes, hats, weights = facet_rule(X, outer)
    side = smooth_sides(X, outer)
    local = np.searchsorted(surface.nodes, outer)
    keys, number = np.unique(local + len(surface.nodes) * side[:, None], return_inverse=True)
    k = outer.shape[1]
    blocks = np.einsum("fq,qj,qi->fji", weights, hats, shapes)
    rows = np.broadcast_to(number.reshape(-1, k, 1), blocks.shape)
    columns = np.broadcast_to(local[:, None, :], blocks.shape)
    total = csr_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(len(keys), len(surface.nodes)))
    areas = total.sum(axis=1)
    total = csr_array(total.multiply(1.0 / areas[:, None]))
    return SurfacePoints(total, total @ surface.rest, areas)


def _outer(facets: np.ndarray, surface: Surface) -> np.ndarray:
    """Facets whose nodes all belong to the surface."""
    return facets[np.isin(facets, surface.nodes).all(axis=1)]


def facet_rule(X: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quadrature of facets (f, 3 | 6 | 4): shape functions (q, k) and hats (q, k) at its points, and weights (f, q)
    mm^2."""
    k = facets.shape[1]
    if k == 4:
        shapes = (1 + _GAUSS[:, None] * _SQUARE).prod(axis=2) / 4
        slope = _SQUARE * (1 + _GAUSS[:, None] * _SQUARE)[:, :, ::-1] / 4  # (q, 4, 2) by the two coordinates
        along = np.einsum("qka,fki->fqai", slope, X[facets])
        return shapes, shapes, np.linalg.norm(np.cross(along[:, :, 0], along[:, :, 1]), axis=2)
    area = np.linalg.norm(normals_of(X[facets[:, :3]]), axis=1) / 2
    if k == 3:
        return _TRIANGLE, _TRIANGLE, area[:, None] * _TRIANGLE_WEIGHTS
    corners = np.vstack([np.eye(3), (np.eye(3) + np.roll(np.eye(3), 1, axis=1)) / 2])
    L = (_TRIANGLE @ corners[_QUARTERS]).reshape(-1, 3)
    hats = np.zeros((4, len(_TRIANGLE), 6))
    for part, numbers in enumerate(_QUARTERS):
        hats[part][:, numbers] = _TRIANGLE
    shapes = np.hstack([L * (2 * L - 1), 4 * L * np.roll(L, -1, axis=1)])
    return shapes, hats.reshape(-1, 6), area[:, None] * np.tile(_TRIANGLE_WEIGHTS, 4) / 4


def smooth_sides(X: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Numbers (f,) of the side that each facet belongs to: sides meet at edges that turn by more than SHARP."""
    corners = facets[:, :4] if facets.shape[1] == 4 else facets[:, :3]
    k, x = corners.shape[1], X[corners]
    normal = normals_of(x)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    facet, key, twin = np.repeat(np.arange(len(facets)), k), start * len(X) + end, end * len(X) + start
    order = np.argsort(key)
    place = np.minimum(np.searchsorted(key[order], twin), len(key) - 1)
    paired = key[order][place] == twin
    first, second = facet[paired], facet[order][place[paired]]
    flat = (normal[first] * normal[second]).sum(axis=1) > np.cos(SHARP)
    graph = csr_array((np.ones(flat.sum()), (first[flat], second[flat])), shape=(len(facets), len(facets)))
    return connected_components(graph, directed=False)[1]
