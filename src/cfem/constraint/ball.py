"""Quadrature over the part of a body that lies in a ball, from its own cells: what turns or shifts with the body, the
sums over it do too, to rounding, as they would not from points of a lattice.

Each cell that meets the ball is halved along its edges until its parts are small beside the ball (Bey, Tetrahedral grid
refinement, Computing 55, 1995; octants of a hexahedron), and each part brings a rule of degree 5."""

import numpy as np

from cfem.mechanics.element import HEX_CORNERS, shape, shape_derivatives
from cfem.mechanics.mesh import Mesh

# Radii that a part reaches from its centre at most: weights are then within 1e-5 of their limit. No mesh has cells
# whose parts are of this size to rounding, so that a turned body has the same parts.
PART = 0.3019
_EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))


def points_in_ball(
    mesh: Mesh, point: np.ndarray, radius: float, cells: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points of the rule strictly within `radius` mm of `point` (3,), in `cells` (m,): their cells (k,), their
    coordinates there, barycentric (k, 4) or (k, 3) in [-1, 1]^3, their places (k, 3) mm and volumes (k,) mm^3."""
    count = 8 if mesh.cells.shape[1] == 8 else 4
    rule, shares = _RULES[count]
    cell, parts = _parts(mesh, point, radius, cells, count)
    corners = mesh.X[mesh.cells[cell, :count]]
    ends = parts @ corners
    volumes, N = shares * _densities(count, rule, ends), shape(count, rule)
    places = N @ ends
    inside = squares(places - point) < radius**2
    coordinates = (N @ parts)[inside] @ _IN_REFERENCE[count]
    return np.repeat(cell, len(rule))[inside.ravel()], coordinates, places[inside], volumes[inside]


def _parts(
    mesh: Mesh, point: np.ndarray, radius: float, cells: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """The parts of cells that may meet the ball: their cells (k,), and their corners (k, count, count) as weights of
    the cells' corners."""
    cell = np.asarray(cells)
    parts = np.broadcast_to(np.eye(count), (len(cell), count, count))
    small: list[tuple[np.ndarray, np.ndarray]] = []
    while len(cell):
        corners = parts @ mesh.X[mesh.cells[cell, :count]]
        centre = np.einsum("kcd->kd", corners) / count
        reach = np.sqrt(np.maximum.reduce(squares(corners - centre[:, None]).T.copy()))
        near = squares(centre - point) < (reach + radius) ** 2
        fine = near & (reach <= PART * radius)
        small.append((cell[fine], parts[fine]))
        coarse = near & ~fine
        cell = np.repeat(cell[coarse], 8)
        parts = (_CHILDREN[count] @ parts[coarse, None]).reshape(-1, count, count)
    return np.concatenate([piece for piece, _ in small]), np.concatenate([piece for _, piece in small])


def squares(vectors: np.ndarray) -> np.ndarray:
    """Squared lengths (...) of vectors (..., 3), in a quarter of the time of `np.linalg.norm`."""
    return np.einsum("...d,...d->...", vectors, vectors)


def _densities(count: int, rule: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Volumes (k, q) mm^3 that the points stand for, before their shares, of parts with corners (k, count, 3)."""
    if count == 4:
        return np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))[:, None] / 6
    return np.abs(np.linalg.det(np.einsum("qcx,kcd->kqxd", shape_derivatives(8, rule), corners))) * 8


def _tetrahedron_rule() -> tuple[np.ndarray, np.ndarray]:
    """Barycentric points (14, 4) and shares (14,) of the volume, of degree 5 (Walkington, Quadrature on simplices of
    arbitrary dimension, Carnegie Mellon, 2000)."""
    points, shares = [], []
    for a, share in (
        (0.31088591926330060980, 0.11268792571801585080),
        (0.09273525031089122640, 0.07349304311636194955),
    ):
        points += list(np.full((4, 4), a) + (1 - 4 * a) * np.eye(4))
        shares += [share] * 4
    b = 0.0455037041256496
    for i, j in _EDGES:
        points.append(np.where(np.isin(range(4), (i, j)), b, 0.5 - b))
        shares.append(0.0425460207770815)
    return np.array(points), np.array(shares)


def _hexahedron_rule() -> tuple[np.ndarray, np.ndarray]:
    """Gauss points (27, 3) in [-1, 1]^3 and their shares (27,) of the volume."""
    x, w = np.polynomial.legendre.leggauss(3)
    points = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    return points, np.einsum("i,j,k->ijk", w, w, w).ravel() / 8


def _halved_tetrahedron() -> np.ndarray:
    """Corners (8, 4, 4) of the eight parts of a tetrahedron, as weights of its corners."""
    corner = np.eye(4)
    a, b, c, d = corner
    ab, ac, ad, bc, bd, cd = (corner[[i, j]].mean(axis=0) for i, j in _EDGES)
    return np.array(
        [(a, ab, ac, ad), (ab, b, bc, bd), (ac, bc, c, cd), (ad, bd, cd, d)]
        + [(ab, ac, ad, bd), (ab, ac, bc, bd), (ac, ad, bd, cd), (ac, bc, bd, cd)]
    )


def _halved_hexahedron() -> np.ndarray:
    """Corners (8, 8, 8) of the octants of a hexahedron, as weights of its corners."""
    return np.array([shape(8, (HEX_CORNERS + corner) / 2) for corner in HEX_CORNERS])


_RULES = {4: _tetrahedron_rule(), 8: _hexahedron_rule()}
_CHILDREN = {4: _halved_tetrahedron(), 8: _halved_hexahedron()}
_IN_REFERENCE = {4: np.eye(4), 8: HEX_CORNERS}
