"""A mesh as an elastic body whose nodes follow those that are moved: linear elasticity, the stiffness of a cell the
inverse of its volume, so that small cells keep their shape (Stein, Tezduyar, Benney, J. Appl. Mech. 70, 2003)."""

import numpy as np
import scipy.sparse as sp

from cfem.mechanics.element import barycentric_gradients
from cfem.mechanics.mesh import TET_EDGES, Mesh

POISSON = 0.3


def middles(mesh: Mesh) -> np.ndarray:
    """Nodes (k, 3) at the middle of an edge, and its two ends; none of linear tetrahedra."""
    if mesh.order == 1:
        return np.empty((0, 3), dtype=int)
    ends = mesh.cells[:, :4][:, TET_EDGES].reshape(-1, 2)
    middle, first = np.unique(mesh.cells[:, 4:].ravel(), return_index=True)
    return np.column_stack([middle, ends[first]])


def stiffness(mesh: Mesh) -> sp.csc_matrix:
    """Stiffness (3 corners, 3 corners) of linear elasticity with Young's modulus 1 / volume of each cell."""
    cells = np.searchsorted(np.unique(mesh.cells[:, :4]), mesh.cells[:, :4])
    gradients = barycentric_gradients(mesh.X, mesh.cells)  # (m, 4, 3), constant in a straight cell
    lam, mu = POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), 1 / (2 * (1 + POISSON))
    blocks = lam * np.einsum("mai,mbj->maibj", gradients, gradients)
    blocks += mu * np.einsum("maj,mbi->maibj", gradients, gradients)
    blocks += mu * np.einsum("mak,mbk,ij->maibj", gradients, gradients, np.eye(3))
    dofs = (3 * cells[:, :, None] + np.arange(3)).reshape(len(cells), 12)
    rows, columns = np.repeat(dofs, 12, axis=1).ravel(), np.tile(dofs, (1, 12)).ravel()
    n = 3 * (cells.max() + 1)
    return sp.csc_matrix((blocks.reshape(-1), (rows, columns)), (n, n))
