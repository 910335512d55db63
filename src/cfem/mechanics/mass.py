"""The consistent mass matrix of a body, the same for each of the three directions: kinetic energy v . M v / 2.

It is constant. Solids: M_ab = int rho N_a N_b dV at rest. Rods: positions of a section are affine in its centre c and
its axes d_y, d_z, and these are linear in its nodes' positions and along each element, so that

    T = 1/2 int rho (A |dc/dt|^2 + I |dd_y/dt|^2 + I |dd_z/dt|^2) ds

holds translation, rotary inertia and 2 I about the axis (Simo and Vu-Quoc, CMAME 66, 1988), and is constant in nodes.
Rigid groups need nothing else: their nodes move rigidly (rigid_groups.py)."""

import numpy as np
import scipy.sparse as sp

from cfem.mechanics.body import Body
from cfem.mechanics.element import shape, shape_derivatives
from cfem.mechanics.mesh import tet_volumes
from cfem.mechanics.rod.region import Rod


def mass_matrix(body: Body, density: np.ndarray | float) -> sp.csr_array:
    """Mass matrix (n, n) t of the nodes in each direction. density: t/mm^3, one or one a cell of the mesh (m,)."""
    mesh = body.mesh
    densities = np.broadcast_to(np.asarray(density, float), len(mesh.cells))
    if body.rod is not None:
        nodes, blocks = _of_rod(body.rod, densities)
    else:
        nodes, blocks = mesh.cells, densities[:, None, None] * _of_cells(mesh.X, mesh.cells)
    k, n = nodes.shape[1], len(mesh.X)
    rows, columns = np.repeat(nodes, k, axis=1).ravel(), np.tile(nodes, (1, k)).ravel()
    return sp.csr_array(sp.coo_array((blocks.ravel(), (rows, columns)), shape=(n, n)))


def gravity(body: Body, density: np.ndarray | float, acceleration: np.ndarray) -> np.ndarray:
    """Nodal forces (n, 3) N of the weight, int N rho g dV: those of the mass matrix. density as there; acceleration:
    (3,) mm/s^2."""
    return mass_matrix(body, density).sum(axis=1)[:, None] * np.asarray(acceleration, float)


def kinetic_form(body: Body, density: np.ndarray | float, motions: np.ndarray) -> np.ndarray:
    """Kinetic forms (k,) t mm^2, v . M v of motions v (n, 3, k) mm of a body of solids, without M."""
    mesh = body.mesh
    densities = np.broadcast_to(np.asarray(density, float), len(mesh.cells))
    nodal = motions[mesh.cells].reshape(len(mesh.cells), mesh.cells.shape[1], -1)
    if mesh.cells.shape[1] == 8:
        moved = _of_cells(mesh.X, mesh.cells) @ nodal
    else:  # the same for all tetrahedra, but for their volumes
        moved = _of_unit(mesh.cells.shape[1]) @ nodal
        densities = densities * tet_volumes(mesh.X, mesh.cells)
    return (densities @ (nodal * moved).sum(axis=1)).reshape(3, -1).sum(axis=0)


def _of_unit(n_nodes: int) -> np.ndarray:
    """Mass matrix (n_nodes, n_nodes), int N_a N_b dV, of a tetrahedron of volume 1 and density 1."""
    points, weights = _tetrahedron()
    N = shape(n_nodes, points)
    return (N.T * weights) @ N


def _of_cells(X: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Mass matrices (m, n_nodes, n_nodes) mm^3, int N_a N_b dV at density 1, exact for straight edges."""
    if cells.shape[1] == 8:
        points, weights = _cube()
        N, by_xi = shape(8, points), shape_derivatives(8, points)
        volume = np.linalg.det(np.einsum("qnk,mnd->mqdk", by_xi, X[cells])) * weights
        return np.einsum("mq,qa,qb->mab", volume, N, N, optimize=True)
    return tet_volumes(X, cells)[:, None, None] * _of_unit(cells.shape[1])


def _cube() -> tuple[np.ndarray, np.ndarray]:
    """Gauss rule of three points an edge on [-1, 1]^3: exact where N N det J is of degree 4 in each coordinate."""
    points, weights = np.polynomial.legendre.leggauss(3)
    index = np.indices((3, 3, 3)).reshape(3, -1).T
    return points[index], weights[index].prod(axis=1)


def _tetrahedron() -> tuple[np.ndarray, np.ndarray]:
    """Barycentric points (64, 4) and weights of sum 1, exact to degree 5: the cube collapsed (Duffy, SIAM J. Numer.
    Anal. 19, 1982)."""
    points, weights = np.polynomial.legendre.leggauss(4)
    index = np.indices((4, 4, 4)).reshape(3, -1).T
    (u, v, w), half = ((1 + points[index]) / 2).T, weights[index].prod(axis=1) / 8
    L = np.stack([u, v * (1 - u), w * (1 - u) * (1 - v)], axis=1)
    return np.column_stack([1 - L.sum(axis=1), L]), 6 * half * (1 - u) ** 2 * (1 - v)


def _of_rod(rod: Rod, density: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (m, 6), three of each of an element's sections, and their mass matrices (m, 6, 6) t; density of the cells.
    Three nodes say how a section moves: the others need no mass of their own."""
    sections = rod.sections
    masses = density.reshape(len(rod.length), -1).mean(axis=1) * rod.length
    chosen, motion = zip(*(_three(arm) for arm in sections.arm[:, :, 1:]), strict=True)
    three, motion = np.take_along_axis(sections.nodes, np.array(chosen), axis=1), np.array(motion)
    nodes = np.concatenate([three[:-1], three[1:]], axis=1)
    shape = rod.shape
    inertia = np.stack(np.broadcast_arrays(shape.area, shape.bending, shape.bending, rod.length)[:3])
    by_nodes = np.zeros((len(masses), 2, 3, 6))
    by_nodes[:, 0, :, :3], by_nodes[:, 1, :, 3:] = motion[:-1], motion[1:]
    shared = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6
    blocks = np.einsum("mixa,ij,xm,mjxb->mab", by_nodes, shared, inertia, by_nodes, optimize=True)
    return nodes, masses[:, None, None] * blocks


def _three(arm: np.ndarray) -> tuple[list[int], np.ndarray]:
    """Three points far apart among arms (k, 2) mm of a section's nodes from its centre, and (3, 3) what takes their
    positions to the section's centre and its two axes."""
    first = int((arm**2).sum(axis=1).argmax())
    second = int(((arm - arm[first]) ** 2).sum(axis=1).argmax())
    edge, to = arm[second] - arm[first], arm - arm[first]
    third = int(np.abs(edge[0] * to[:, 1] - edge[1] * to[:, 0]).argmax())
    chosen = [first, second, third]
    return chosen, np.linalg.inv(np.column_stack([np.ones(3), arm[chosen]]))
