"""One region of elastic solid: elements of one kind and one material; energy, internal force and tangent stiffness.

Without an element pressure, p = bulk theta at every point. With one (a mixed formulation: quadratic displacement,
constant pressure), theta is replaced by its mean over the element, which does not lock as nu -> 1/2, and p is an
independent unknown that is condensed on the element:

    Pi = int psi_rest + p theta_mean V - p^2 V / (2 bulk)

Newton on (x, p) then needs no more iterations at nu = 0.499 than at 0.3 (Simo, Taylor and Pister, CMAME 51, 1985).

Bubbles (incompatible modes, element.py) are eliminated at once: their amplitudes alpha minimise the element's energy
at given x, so that energy, force and tangent depend on x alone."""

from dataclasses import dataclass

import numpy as np

from cfem.mechanics.assembly import add_blocks
from cfem.mechanics.element import Element, reference_gradients
from cfem.mechanics.material import Law
from cfem.mechanics.material.law import Material, curvature, evaluate
from cfem.mechanics.solid_kernels import (
    add_bubbles,
    bubble_forces,
    displacement_gradients,
    element_stiffness,
    scatter_force,
    scatter_pressure,
    scatter_stiffness,
    smallest_J,
    strain_form,
)


@dataclass(frozen=True)
class Solid:
    """A region of one material, meshed with one element.

    X: (n, 3) mm all nodes at rest; cells: (m, n_nodes) those of this region
    parameters: of the law's kernels, MPa and numbers; bulk: MPa
    gradients:  (m, q, n_nodes + bubbles, 3) 1/mm, of the shape functions at the quadrature points
    weights:    (m, q) mm^3
    number:     of its material among the body's"""

    X: np.ndarray
    cells: np.ndarray
    element: Element
    law: Law
    parameters: np.ndarray
    bulk: float
    gradients: np.ndarray
    weights: np.ndarray
    number: int = 0

    @property
    def volumes(self) -> np.ndarray:
        """Volumes (m,) mm^3 of the cells."""
        return self.weights.sum(axis=1)

    @property
    def shear(self) -> float:
        """Shear modulus at rest, MPa."""
        return float(curvature(self.law, np.zeros((1, 3, 3)), self.parameters, np.zeros(1))[0, 1, 1])


@dataclass(frozen=True)
class SolidResponse:
    """Response of a solid at positions x and element pressures p.

    energy:   N mm, of the displacement alone (p eliminated)
    mismatch: (m,) MPa, bulk theta_mean - p: what the pressure has yet to gain; empty without element pressures
    pressure: (m,) MPa, p itself; empty likewise
    min_J:    smallest det F over the quadrature points; <= 0 where an element is inverted, NaN where bubbles have no
    equilibrium
    D, P, g:  (m q, 3, 3) displacement gradient, d psi_rest / dF, d theta / dF
    point_pressure: (m q,) p at the quadrature points"""

    energy: float
    mismatch: np.ndarray
    pressure: np.ndarray
    min_J: float
    D: np.ndarray
    P: np.ndarray
    g: np.ndarray
    point_pressure: np.ndarray


def make_solid(X: np.ndarray, cells: np.ndarray, element: Element, material: Material, number: int = 0) -> Solid:
    """Reference gradients and weights computed once."""
    parameters, bulk = material.moduli
    return Solid(X, cells, element, material.law, parameters, bulk, *reference_gradients(element, X, cells), number)


def response(solid: Solid, x: np.ndarray, pressure: np.ndarray, force: np.ndarray) -> SolidResponse:
    """Energy at positions x (n, 3) mm, and the internal force added to `force` (n, 3) N. pressure: (m,) MPa, or empty
    for what x itself demands."""
    D = displacement_gradients(x - solid.X, solid.cells, solid.gradients)
    settled = _settle_bubbles(solid, D) if solid.element.bubbles else True
    psi, theta, P, g = evaluate(solid.law, D, solid.parameters)
    m, q = solid.weights.shape
    if solid.element.pressure:
        volumes = solid.volumes
        theta_mean = (theta.reshape(m, q) * solid.weights).sum(axis=1) / volumes
        demanded = solid.bulk * theta_mean
        p = demanded if len(pressure) == 0 else pressure
        mismatch, point_pressure = demanded - p, np.repeat(p, q)
        energy = psi @ solid.weights.ravel() + solid.bulk / 2 * (theta_mean**2 @ volumes)
    else:
        p, mismatch, point_pressure = np.empty(0), np.empty(0), solid.bulk * theta
        energy = (psi + solid.bulk / 2 * theta**2) @ solid.weights.ravel()
    scatter_force(P, g, point_pressure, solid.gradients, solid.weights, solid.cells, force)
    min_J = smallest_J(D) if settled else np.nan
    return SolidResponse(float(energy), mismatch, p, min_J, D, P, g, point_pressure)


def pressure_force(solid: Solid, dtheta: np.ndarray, pressure: np.ndarray, force: np.ndarray) -> None:
    """Adds to `force` (n, 3) N the sum over elements of pressure (m,) times dtheta (m, n_nodes, 3), the gradient of
    theta_mean V."""
    scatter_pressure(dtheta, pressure, solid.cells, force)


def tangent(
    solid: Solid, state: SolidResponse, slots: np.ndarray, data: np.ndarray, lag: np.ndarray | None = None
) -> np.ndarray:
    """Adds the tangent stiffness (N/mm), element pressure and bubbles condensed, to the lower triangle stored in
    `data`, where slots (m, n_nodes, n_nodes, 3) says where each nodal block's columns begin (assembly.py), -1 for none.

    lag: (m q, 3, 3) MPa of `stress_lag`, added to the stress that the geometric part is made of.
    Returns dtheta (m, n_nodes, 3) mm^2, the gradient of theta_mean V; empty without element pressures."""
    C = curvature(solid.law, state.D, solid.parameters, state.point_pressure)
    if lag is not None:
        add_geometric(C, lag)
    if solid.element.bubbles:
        add_blocks(_condensed(point_stiffness(solid, C, state.g), solid.element.n_nodes), slots, data)
        return np.zeros((0, solid.element.n_nodes, 3))
    mixed = solid.element.pressure
    dtheta = np.zeros((*solid.cells.shape, 3)) if mixed else np.zeros((0, solid.element.n_nodes, 3))
    scatter_stiffness(C, state.g, solid.bulk, mixed, solid.gradients, solid.weights, slots, data, dtheta)
    return dtheta


def tangent_form(solid: Solid, state: SolidResponse, motions: np.ndarray) -> np.ndarray:
    """Form M^T A M (k, k) N mm of the tangent stiffness A and motions M (n, 3, k) mm, from strains: faster than by A,
    and exact to rounding of the strains' work, where the entries of A cancel in a motion that is almost rigid."""
    C = curvature(solid.law, state.D, solid.parameters, state.point_pressure)
    if solid.element.bubbles:
        K = _condensed(point_stiffness(solid, C, state.g), solid.element.n_nodes)
        nodal = motions[solid.cells].reshape(len(K), K.shape[1], -1)
        return np.einsum("mik,mil->kl", nodal, K @ nodal)
    bulk, mixed = solid.bulk, solid.element.pressure
    return strain_form(C, state.g, bulk, mixed, solid.gradients, solid.weights, solid.cells, motions)


def stress_lag(solid: Solid, before: SolidResponse, now: SolidResponse) -> np.ndarray:
    """Second Piola-Kirchhoff stress (m q, 3, 3) MPa that the linearisation at `before` predicted for `now`, less the
    stress there. A tangent whose geometric part uses the predicted stress does not see the false strain, of second
    order in the rotation, that a linear step leaves: Newton's method with an independent stress at every quadrature
    point, condensed (Magisano, Leonetti and Garcea, IJNME 109, 2017). With F S = P:

        S* = S + F^-1 (dP - dF S),    dP = (d2 psi / dF2) dF + dp d theta / dF"""
    D, dD = before.D, now.D - before.D
    S = _second_stress(before)
    mixed = 0.0 if solid.element.pressure else solid.bulk * (before.g * dD).sum(axis=(1, 2))
    dp = (now.point_pressure - before.point_pressure) if solid.element.pressure else mixed
    C = curvature(solid.law, D, solid.parameters, before.point_pressure)
    dP = (C @ dD.reshape(-1, 9, 1)).reshape(-1, 3, 3) + dp[:, None, None] * before.g
    predicted = S + np.linalg.solve(np.eye(3) + D, dP - dD @ S)
    return (predicted + predicted.transpose(0, 2, 1)) / 2 - _second_stress(now)


def _second_stress(state: SolidResponse) -> np.ndarray:
    """Second Piola-Kirchhoff stress S = F^-1 P (m q, 3, 3) MPa."""
    return np.linalg.solve(np.eye(3) + state.D, state.P + state.point_pressure[:, None, None] * state.g)


def add_geometric(C: np.ndarray, S: np.ndarray) -> None:
    """Adds to C (k, 9, 9), d P / dF, what the symmetric second Piola-Kirchhoff stress S (k, 3, 3) of P = F S gives."""
    blocks = C.reshape(-1, 3, 3, 3, 3)
    for i in range(3):
        blocks[:, i, :, i, :] += S


def _settle_bubbles(solid: Solid, D: np.ndarray) -> bool:
    """Adds to D (m q, 3, 3) the bubbles' part, their amplitudes found by Newton's method from zero, element by element
    with halved steps where the residual does not fall; whether all have come to rest."""
    first, m = solid.element.n_nodes, len(solid.weights)
    at_zero = D.copy()
    alpha, part = np.zeros((m, solid.element.bubbles, 3)), np.ones(m)
    step, before = np.zeros_like(alpha), np.full(m, np.inf)
    rounding = (solid.shear + solid.bulk) * solid.volumes  # of F
    steepest = np.abs(solid.gradients[:, :, first:]).max(axis=(1, 2, 3))
    for _ in range(40):
        trial = alpha + part[:, None, None] * step
        D[:] = at_zero
        add_bubbles(trial, solid.gradients, D)
        _, theta, P, g = evaluate(solid.law, D, solid.parameters)
        pressure, rest, work = solid.bulk * theta, np.zeros_like(alpha), np.zeros(m)
        bubble_forces(P, g, pressure, solid.gradients, solid.weights, rest, work)
        size = np.linalg.norm(rest, axis=(1, 2))
        floor = 1e-14 * (work + rounding) * steepest
        better = (size < before) | (size <= floor)
        if (size <= floor).all():
            return True
        alpha[better], before[better], part[better] = trial[better], size[better], 1.0
        part[~better] *= 0.5
        stuck = part < 2.0**-6  # rounding, or no equilibrium
        if stuck.any():
            break
        K = point_stiffness(solid, curvature(solid.law, D, solid.parameters, pressure), g, first)
        if not np.isfinite(K).all():
            return False
        new = -np.linalg.solve(K + 1e-300 * np.eye(K.shape[1]), rest.reshape(m, -1, 1)).reshape(alpha.shape)
        step[better] = new[better]
    return bool((before <= 1e3 * floor).all())


def point_stiffness(solid: Solid, C: np.ndarray, g: np.ndarray, first: int = 0) -> np.ndarray:
    """Element stiffness (m, 3 n, 3 n) of the shape functions from `first` on, bubbles included."""
    size = 3 * (solid.gradients.shape[2] - first)
    K = np.zeros((len(solid.weights), size, size))
    element_stiffness(C, g, solid.bulk, solid.gradients, solid.weights, first, K)
    return K


def _condensed(K: np.ndarray, n_nodes: int) -> np.ndarray:
    """Stiffness (m, 3 n_nodes, 3 n_nodes) without the bubbles: K_uu - K_ub K_bb^-1 K_bu."""
    n = 3 * n_nodes
    return K[:, :n, :n] - K[:, :n, n:] @ np.linalg.solve(K[:, n:, n:], K[:, n:, :n])
