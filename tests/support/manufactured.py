"""A manufactured solution: a smooth finite deformation of a cube, the body force that it takes, and what a mesh errs.

Three shears, one after the other, which keep all volumes, and a swelling by 1 - 2 nu:

    y_1 = X_1 + f_1(X_2, X_3),   y_2 = X_2 + f_2(y_1, X_3),   y_3 = X_3 + f_3(y_1, y_2),   x = y + (1 - 2 nu) w(X)

with f and w single sines, so that the pressure is of the order of the shear modulus for every nu. The body force
b = -Div P(F(X)) comes by differences of the law's stress, as a function of X alone."""

from dataclasses import replace

import numpy as np
from scipy.special import roots_jacobi

from cfem.mechanics.body import Body, make_body
from cfem.mechanics.element import ELEMENTS, barycentric_gradients, shape, shape_derivatives
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material, stress
from cfem.mechanics.mesh import Mesh, quadratic, tet_volumes
from support.blocks import block, hexahedra
from support.boundary_value import newton

YOUNG = 2.0
_SHEAR, _SWELL = 0.08, 0.12  # mm
_WAVES = np.array([[0.0, 1.9, -1.3], [1.6, 0.0, 1.4], [-1.2, 1.8, 0.0]])  # 1/mm; row i of f_i
_SWELL_WAVES = np.array([[1.6, 0.9, -0.7], [-0.8, 1.4, 1.1], [0.9, -0.6, 1.7]])
_PHASES = np.array([0.3, 1.1, -0.5])


def displacement(X: np.ndarray, poisson: float) -> np.ndarray:
    """(k, 3) mm at X (k, 3) mm."""
    y = X.copy()
    for i in range(3):
        y[:, i] += _SHEAR * np.sin(y @ _WAVES[i] + _PHASES[i])
    return y - X + (1 - 2 * poisson) * _SWELL * np.sin(X @ _SWELL_WAVES.T + _PHASES)


def displacement_gradient(X: np.ndarray, poisson: float) -> np.ndarray:
    """(k, 3, 3): du_i / dX_j."""
    y, F = X.copy(), np.tile(np.eye(3), (len(X), 1, 1))
    for i in range(3):
        angle = y @ _WAVES[i] + _PHASES[i]
        F[:, i] += _SHEAR * np.cos(angle)[:, None] * (_WAVES[i] @ F)
        y[:, i] += _SHEAR * np.sin(angle)
    swell = np.cos(X @ _SWELL_WAVES.T + _PHASES)[:, :, None] * _SWELL_WAVES
    return F - np.eye(3) + (1 - 2 * poisson) * _SWELL * swell


def body_force(X: np.ndarray, law: str, poisson: float, h: float = 1e-3) -> np.ndarray:
    """(k, 3) N/mm^3: -Div P at X (k, 3), by central differences of fourth order (their error is below 1e-10)."""

    def column(j: int, far: float) -> np.ndarray:
        F = np.eye(3) + displacement_gradient(X + far * h * np.eye(3)[j], poisson)
        return stress(LAWS[law], F, YOUNG, poisson)[:, :, j]

    return -sum((8 * (column(j, 1) - column(j, -1)) - (column(j, 2) - column(j, -2))) / (12 * h) for j in range(3))


def cube(element: str, n: int) -> Mesh:
    """The unit cube in n^3 cubes, bent by a smooth motion that is the same for all n and leaves the faces plane."""
    kind = ELEMENTS[element]
    mesh = hexahedra((1, 1, 1), (n, n, n)) if kind.n_nodes == 8 else block((1, 1, 1), (n, n, n))
    X = mesh.X + 0.06 * np.sin(np.pi * mesh.X) * np.cos(np.pi * mesh.X[:, [1, 2, 0]] + 0.4)
    if kind.order == 2:
        return Mesh(*quadratic(X, mesh.cells, mesh.facets))
    return replace(mesh, X=X)


def quadrature(mesh: Mesh, n: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shape functions (q, nodes), their gradients (m, q, nodes, 3) 1/mm and weights (m, q) mm^3 of a rule of degree
    2 n - 1: Gauss for hexahedra, Gauss-Jacobi on the collapsed cube for tetrahedra (Stroud's conical product)."""
    if mesh.cells.shape[1] == 8:
        s, w = np.polynomial.legendre.leggauss(n)
        xi = np.stack(np.meshgrid(s, s, s, indexing="ij"), axis=-1).reshape(-1, 3)
        by_xi = shape_derivatives(8, xi)
        jacobian = np.einsum("qnk,mnd->mqdk", by_xi, mesh.X[mesh.cells])
        gradients = np.einsum("qnk,mqkd->mqnd", by_xi, np.linalg.inv(jacobian))
        return shape(8, xi), gradients, np.linalg.det(jacobian) * np.einsum("i,j,k->ijk", w, w, w).ravel()
    rules = [roots_jacobi(n, power, 0) for power in (2, 1, 0)]
    a, b, c = ((1 + part.ravel()) / 2 for part in np.meshgrid(*(s for s, _ in rules), indexing="ij"))
    weights = np.einsum("i,j,k->ijk", *(w for _, w in rules)).ravel()
    L = np.stack([a, (1 - a) * b, (1 - a) * (1 - b) * c, (1 - a) * (1 - b) * (1 - c)], axis=1)
    nodes = mesh.cells.shape[1]
    gradients = np.einsum("qna,mad->mqnd", shape_derivatives(nodes, L), barycentric_gradients(mesh.X, mesh.cells))
    return shape(nodes, L), gradients, tet_volumes(mesh.X, mesh.cells)[:, None] * weights / weights.sum()


def body_load(mesh: Mesh, law: str, poisson: float) -> np.ndarray:
    """(n, 3) N: consistent nodal forces of the body force, int N b dV."""
    N, _, weights = quadrature(mesh)
    points = np.einsum("qn,mnd->mqd", N, mesh.X[mesh.cells])
    density = body_force(points.reshape(-1, 3), law, poisson).reshape(points.shape)
    return _summed(mesh, np.einsum("mq,qn,mqd->mnd", weights, N, density))


def whole_load(mesh: Mesh, law: str, poisson: float) -> np.ndarray:
    """(n, 3) N: consistent nodal forces of the body force and of the tractions on the boundary together, which by the
    divergence theorem are int P . grad N dV."""
    N, gradients, weights = quadrature(mesh)
    points = np.einsum("qn,mnd->mqd", N, mesh.X[mesh.cells]).reshape(-1, 3)
    F = np.eye(3) + displacement_gradient(points, poisson)
    P = stress(LAWS[law], F, YOUNG, poisson).reshape(*weights.shape, 3, 3)
    return _summed(mesh, np.einsum("mq,mqij,mqnj->mni", weights, P, gradients, optimize=True))


def _summed(mesh: Mesh, nodal: np.ndarray) -> np.ndarray:
    """(n, 3) from (m, nodes, 3) of the cells."""
    sums = [np.bincount(mesh.cells.ravel(), part.ravel(), len(mesh.X)) for part in np.moveaxis(nodal, 2, 0)]
    return np.stack(sums, axis=1)


def solved(body: Body, law: str, poisson: float, one_face: bool = False) -> np.ndarray:
    """(n, 3) mm: displacement of the nodes where that of the whole boundary is prescribed and the body force acts, or,
    with one_face, where that of the face X_1 = 0 is and the tractions act on the others."""
    mesh = body.mesh
    load = (whole_load if one_face else body_load)(mesh, law, poisson)
    held = np.zeros(mesh.X.shape, dtype=bool)
    held[mesh.X[:, 0] < 1e-9 if one_face else np.unique(mesh.facets)] = True
    return newton(body, mesh.X + displacement(mesh.X, poisson), held, load) - mesh.X


def errors(mesh: Mesh, u: np.ndarray, poisson: float) -> np.ndarray:
    """(L2 norm (mm^2.5), H1 seminorm (mm^1.5)) of the nodal displacement u (n, 3) mm less the exact one."""
    N, gradients, weights = quadrature(mesh)
    points = np.einsum("qn,mnd->mqd", N, mesh.X[mesh.cells]).reshape(-1, 3)
    value = np.einsum("qn,mnd->mqd", N, u[mesh.cells]).reshape(-1, 3) - displacement(points, poisson)
    slope = np.einsum("mnd,mqnj->mqdj", u[mesh.cells], gradients).reshape(-1, 3, 3) - displacement_gradient(
        points, poisson
    )
    w = weights.ravel()
    return np.sqrt([w @ (value**2).sum(axis=1), w @ (slope**2).sum(axis=(1, 2))])


def family(element: str, law: str, poisson: float, divisions: tuple[int, ...], one_face: bool = False) -> np.ndarray:
    """(levels, 2): errors on the meshes of so many divisions."""
    material = Material(LAWS[law], YOUNG, poisson)
    bodies = (make_body(cube(element, n), ELEMENTS[element], material) for n in divisions)
    return np.array([errors(body.mesh, solved(body, law, poisson, one_face), poisson) for body in bodies])


def orders(found: np.ndarray, divisions: tuple[int, ...]) -> np.ndarray:
    """(levels - 1, 2): exponents of the errors (levels, 2) of `family` between one level and the next."""
    return -np.diff(np.log(found), axis=0) / np.diff(np.log(divisions))[:, None]
