"""Constant external loads as nodal forces: what a scene asks for, and nothing by default."""

import numpy as np

from cfem.mechanics.body import Body
from cfem.mechanics.element import reference_gradients, shape
from cfem.mechanics.rod.region import Rod


def gravity(body: Body, density: np.ndarray | float, acceleration: np.ndarray) -> np.ndarray:
    """Consistent nodal forces (n, 3) N of the weight, int N rho g dV. density: t/mm^3, one or one a cell of the mesh
    (m,); acceleration: (3,) mm/s^2. Exact for the linear and the quadratic tetrahedra's quadrature points."""
    mesh, element = body.mesh, body.element
    if body.rod is not None:
        return _of_rod(body.rod, np.broadcast_to(density, len(mesh.cells)), np.asarray(acceleration, float))
    _, weights = reference_gradients(element, mesh.X, mesh.cells)
    N = shape(element.n_nodes, element.points)
    mass = (weights * np.broadcast_to(density, len(mesh.cells))[:, None]) @ N  # (m, n_nodes) t
    nodal = np.bincount(mesh.cells.ravel(), mass.ravel(), len(mesh.X))
    return nodal[:, None] * np.asarray(acceleration, float)


def _of_rod(rod: Rod, density: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Half of each element's weight on either section; density of the cells, as many from element to element."""
    masses = density.reshape(len(rod.length), -1).mean(axis=1) * rod.shape.area * rod.length
    nodes, X = rod.sections.nodes, rod.sections.X
    mass = np.zeros(len(nodes))
    mass[:-1] += masses / 2
    mass[1:] += masses / 2
    force = np.zeros_like(X)
    force[nodes] = (mass / nodes.shape[1])[:, None, None] * acceleration
    return force
