"""An elastic solid of tetrahedra: energy, internal force and tangent stiffness on its nodal positions.

Without an element pressure, p = bulk theta at every point. With one (a mixed formulation: quadratic displacement,
constant pressure), theta is replaced by its mean over the element, which does not lock as nu -> 1/2, and p is an
independent unknown that is condensed on the element:

    Pi = int psi_rest + p theta_mean V - p^2 V / (2 bulk)

Newton on (x, p) then needs no more iterations at nu = 0.499 than at 0.3 (Simo, Taylor and Pister, CMAME 51, 1985)."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from cfem.mechanics.element import Element, barycentric_gradients, shape_derivatives
from cfem.mechanics.material import Law
from cfem.mechanics.mesh import Mesh


@dataclass(frozen=True)
class Solid:
    """mesh:      at rest
    element:   whose order is the mesh's
    law:       of the one material
    shear, bulk: MPa, as the law defines them
    gradients: (m, q, n_nodes, 3) 1/mm, of the shape functions at the quadrature points
    weights:   (m, q) mm^3"""

    mesh: Mesh
    element: Element
    law: Law
    shear: float
    bulk: float
    gradients: np.ndarray
    weights: np.ndarray

    @property
    def n_pressures(self) -> int:
        return len(self.mesh.cells) if self.element.pressure else 0


@dataclass(frozen=True)
class Response:
    """Of a solid at positions x and element pressures p.

    energy:   N mm, of the displacement alone (p eliminated)
    force:    (n, 3) N internal nodal force with the given p
    mismatch: (m,) MPa, bulk theta_mean - p: what the pressure has yet to gain; empty without element pressures
    min_J:    smallest det F over the quadrature points; <= 0 where an element is inverted
    D:        (m q, 3, 3) displacement gradients, kept for the tangent
    g:        (m q, 3, 3) d theta / dF"""

    energy: float
    force: np.ndarray
    mismatch: np.ndarray
    min_J: float
    D: np.ndarray
    g: np.ndarray
    point_pressure: np.ndarray


def make_solid(mesh: Mesh, element: Element, law: Law, young: float, poisson: float) -> Solid:
    """Reference gradients and weights computed once. young in MPa."""
    by_barycentric = shape_derivatives(element.order, element.points)  # (q, n_nodes, 4)
    gradients = np.einsum("qna,mad->mqnd", by_barycentric, barycentric_gradients(mesh.X, mesh.cells))
    q = len(element.points)
    weights = np.repeat(mesh.volumes[:, None] / q, q, axis=1)
    shear, bulk = law.moduli(young, poisson)
    return Solid(mesh, element, law, shear, bulk, np.ascontiguousarray(gradients), weights)


def response(solid: Solid, x: np.ndarray, pressure: np.ndarray | None = None) -> Response:
    """Energy and internal force at positions x (n, 3) mm; pressure (m,) MPa, by default what x itself demands."""
    D, min_J = _displacement_gradients(x - solid.mesh.X, solid.mesh.cells, solid.gradients)
    k = len(D)
    psi, theta, P, g = np.empty(k), np.empty(k), np.empty((k, 3, 3)), np.empty((k, 3, 3))
    solid.law.response(D, solid.shear, psi, theta, P, g)
    m, q = solid.weights.shape
    if solid.element.pressure:
        theta_mean = (theta.reshape(m, q) * solid.weights).sum(axis=1) / solid.weights.sum(axis=1)
        demanded = solid.bulk * theta_mean
        p = demanded if pressure is None or len(pressure) == 0 else pressure
        mismatch, point_pressure = demanded - p, np.repeat(p, q)
        energy = psi @ solid.weights.ravel() + solid.bulk / 2 * (theta_mean**2 @ solid.weights.sum(axis=1))
    else:
        mismatch, point_pressure = np.empty(0), solid.bulk * theta
        energy = (psi + solid.bulk / 2 * theta**2) @ solid.weights.ravel()
    force = np.zeros_like(x)
    _scatter_force(P, g, point_pressure, solid.gradients, solid.weights, solid.mesh.cells, force)
    return Response(float(energy), force, mismatch, min_J, D, g, point_pressure)


def pressure_force(solid: Solid, dtheta: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """(n, 3) N: sum over elements of pressure (m,) times dtheta (m, n_nodes, 3), the gradient of theta_mean V."""
    force = np.zeros_like(solid.mesh.X)
    _scatter_pressure(dtheta, pressure, solid.mesh.cells, force)
    return force


def tangent(solid: Solid, at: Response, slots: np.ndarray, data: np.ndarray) -> np.ndarray:
    """Adds the tangent stiffness (N/mm), the element pressure condensed, to the lower triangle stored in `data`, where
    slots (m, n_nodes, n_nodes, 3) says where each nodal block's columns begin (assembly.py), -1 for none.

    Returns dtheta (m, n_nodes, 3) mm^2, the gradient of theta_mean V; empty without element pressures."""
    C = np.empty((len(at.D), 9, 9))
    solid.law.curvature(at.D, solid.shear, at.point_pressure, C)
    mixed = solid.element.pressure
    dtheta = np.zeros((*solid.mesh.cells.shape, 3)) if mixed else np.zeros((0, solid.element.n_nodes, 3))
    _scatter_stiffness(C, at.g, solid.bulk, mixed, solid.gradients, solid.weights, slots, data, dtheta)
    return dtheta


@njit(cache=True)
def _displacement_gradients(u, cells, gradients):
    """D = F - 1 at every quadrature point, (m q, 3, 3), and the smallest det F."""
    m, q, n, _ = gradients.shape
    D = np.zeros((m * q, 3, 3))
    min_J = np.inf
    for e in range(m):
        for point in range(q):
            d = D[e * q + point]
            for a in range(n):
                node = cells[e, a]
                for i in range(3):
                    for j in range(3):
                        d[i, j] += u[node, i] * gradients[e, point, a, j]
            f00, f11, f22 = 1.0 + d[0, 0], 1.0 + d[1, 1], 1.0 + d[2, 2]
            J = (
                f00 * (f11 * f22 - d[1, 2] * d[2, 1])
                - d[0, 1] * (d[1, 0] * f22 - d[1, 2] * d[2, 0])
                + d[0, 2] * (d[1, 0] * d[2, 1] - f11 * d[2, 0])
            )
            if not (min_J <= J):  # a NaN ends up in min_J, where it is seen
                min_J = J
    return D, min_J


@njit(cache=True)
def _scatter_force(P, g, pressure, gradients, weights, cells, force):
    m, q, n, _ = gradients.shape
    S = np.empty((3, 3))
    for e in range(m):
        for point in range(q):
            k = e * q + point
            for i in range(3):
                for j in range(3):
                    S[i, j] = (P[k, i, j] + pressure[k] * g[k, i, j]) * weights[e, point]
            for a in range(n):
                node = cells[e, a]
                for i in range(3):
                    force[node, i] += (
                        S[i, 0] * gradients[e, point, a, 0]
                        + S[i, 1] * gradients[e, point, a, 1]
                        + S[i, 2] * gradients[e, point, a, 2]
                    )


@njit(cache=True)
def _scatter_pressure(dtheta, pressure, cells, force):
    for e in range(dtheta.shape[0]):
        for a in range(dtheta.shape[1]):
            node = cells[e, a]
            for i in range(3):
                force[node, i] += pressure[e] * dtheta[e, a, i]


@njit(cache=True)
def _scatter_stiffness(C, g, bulk, mixed, gradients, weights, slots, data, dtheta):
    m, q, n, _ = gradients.shape
    K = np.empty((n, n, 3, 3))
    T = np.empty((9, 3))
    theta_a = np.empty((n, 3))
    for e in range(m):
        K[:] = 0.0
        volume = 0.0
        for point in range(q):
            k = e * q + point
            w = weights[e, point]
            volume += w
            dN = gradients[e, point]
            for a in range(n):
                for i in range(3):
                    theta_a[a, i] = g[k, i, 0] * dN[a, 0] + g[k, i, 1] * dN[a, 1] + g[k, i, 2] * dN[a, 2]
                    if mixed:
                        dtheta[e, a, i] += w * theta_a[a, i]
            for b in range(n):
                for row in range(9):
                    for i in range(3):
                        c = 3 * i
                        T[row, i] = w * (
                            C[k, row, c] * dN[b, 0] + C[k, row, c + 1] * dN[b, 1] + C[k, row, c + 2] * dN[b, 2]
                        )
                for a in range(b, n):
                    for i in range(3):
                        for j in range(3):
                            r = 3 * i
                            K[a, b, i, j] += dN[a, 0] * T[r, j] + dN[a, 1] * T[r + 1, j] + dN[a, 2] * T[r + 2, j]
                    if not mixed:
                        for i in range(3):
                            for j in range(3):
                                K[a, b, i, j] += w * bulk * theta_a[a, i] * theta_a[b, j]
        for b in range(n):
            for a in range(b, n):
                if mixed:
                    for i in range(3):
                        for j in range(3):
                            K[a, b, i, j] += bulk / volume * dtheta[e, a, i] * dtheta[e, b, j]
                if slots[e, a, b, 0] >= 0:
                    for j in range(3):
                        for i in range(j if a == b else 0, 3):
                            data[slots[e, a, b, j] + i] += K[a, b, i, j]
                elif slots[e, b, a, 0] >= 0:
                    for i in range(3):
                        for j in range(3):
                            data[slots[e, b, a, i] + j] += K[a, b, i, j]
