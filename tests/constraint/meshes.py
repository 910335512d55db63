"""Bricks with and without a void, and spheres, as the tests of constraints need them."""

import numpy as np
from support.blocks import block

from cfem.mechanics.mesh import Mesh, boundary_facets, quadratic

HOLLOW = ((12.0, 10.0, 8.0), (4, 5, 4))  # size and divisions; the void is 6 x 6 x 4 about the middle
VOID = 144.0
MIDDLE = np.array([6.0, 5.0, 4.0])


def bricks(size, divisions, distort=0.0) -> Mesh:
    """The nodes of a block of tetrahedra as trilinear hexahedra."""
    X = block(size, divisions, distort=distort).X
    _, ny, nz = np.asarray(divisions) + 1
    corner = np.stack(np.meshgrid(*map(np.arange, divisions), indexing="ij"), axis=-1).reshape(-1, 3) @ [ny * nz, nz, 1]
    x, y, z = ny * nz, nz, 1
    cells = corner[:, None] + np.array([0, x, x + y, y, z, x + z, x + y + z, y + z])
    return Mesh(X, cells, boundary_facets(cells))


def carved(mesh: Mesh, keep, order=1) -> Mesh:
    """Without the linear cells whose centre `keep` does not want."""
    cells = mesh.cells[keep(mesh.X[mesh.cells].mean(axis=1))]
    X, facets = mesh.X, boundary_facets(cells)
    if order == 2:
        X, cells, facets = quadratic(X, cells, facets)
    return Mesh(X, cells, facets)


def hollow(kind: str) -> Mesh:
    """The block HOLLOW of tet4, tet10 or hex8 with the void in its middle."""
    mesh = bricks(*HOLLOW) if kind == "hex8" else block(*HOLLOW)
    return carved(mesh, lambda c: (np.abs(c - MIDDLE) > [3, 3, 2]).any(axis=1), order=2 if kind == "tet10" else 1)


def icosphere(level: int, order: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """X and facets of an icosahedron in the unit sphere, `level` times subdivided, all nodes on the sphere."""
    phi = (1 + np.sqrt(5)) / 2
    X = np.array([[0, s, t * phi] for s in (-1, 1) for t in (-1, 1)], float)
    X = np.concatenate([np.roll(X, k, axis=1) for k in range(3)])
    apart = np.linalg.norm(X[:, None] - X, axis=2)
    near = np.abs(apart - 2) < 1e-9
    facets = [
        (a, b, c) for a in range(12) for b in range(a) for c in range(b) if near[a, b] and near[b, c] and near[c, a]
    ]
    facets = np.array([f if np.linalg.det(X[list(f)]) > 0 else f[::-1] for f in facets])
    X /= np.linalg.norm(X[0])
    for step in range(level + order - 1):
        edges, number = np.unique(
            np.sort(facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)), axis=0, return_inverse=True
        )
        ab, bc, ca = (len(X) + number.reshape(-1, 3)).T
        X = np.vstack([X, X[edges].sum(axis=1)])
        X /= np.linalg.norm(X, axis=1, keepdims=True)
        a, b, c = facets.T
        if step == level:
            return X, np.column_stack([a, b, c, ab, bc, ca])
        facets = np.concatenate([np.column_stack(f) for f in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return X, facets
