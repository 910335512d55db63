"""A stress in a solid beside the elastic one, as of viscosity: its force on the nodes, and its stiffness.

Where elements have bubbles, these follow the positions as elasticity has settled them."""

from dataclasses import replace

import numpy as np

from cfem.mechanics.assembly import add_blocks
from cfem.mechanics.material.law import curvature
from cfem.mechanics.solid import Solid, SolidResponse, add_geometric, point_stiffness
from cfem.mechanics.solid_kernels import scatter_force, scatter_stiffness, strain_form


def add_stress(solid: Solid, state: SolidResponse, P: np.ndarray, force: np.ndarray) -> None:
    """Adds to `force` (n, 3) N that of a further first Piola-Kirchhoff stress P (m q, 3, 3) MPa."""
    count, none = solid.element.n_nodes, np.zeros(len(P))
    if not solid.element.bubbles:
        scatter_force(P, P, none, solid.gradients, solid.weights, solid.cells, force)
        return
    weighted = P.reshape(*solid.weights.shape, 3, 3) * solid.weights[:, :, None, None]
    on_all = np.einsum("mqab,mqkb->mka", weighted, solid.gradients, optimize=True).reshape(len(solid.cells), -1)
    on_nodes = on_all[:, : 3 * count] + np.einsum("mbn,mb->mn", _slaved(solid, state), on_all[:, 3 * count :])
    np.add.at(force, solid.cells, on_nodes.reshape(*solid.cells.shape, 3))


def add_stress_stiffness(
    solid: Solid, state: SolidResponse, share: float, B: np.ndarray, slots: np.ndarray, data: np.ndarray
) -> None:
    """Adds to `data` (slots as in `tangent`) the stiffness of the stress P = share d psi_rest / dF + F B, B (m q, 3, 3)
    MPa symmetric; with bubbles but for what their own change of slope adds."""
    C = _stress_curvature(solid, state, share, B)
    if solid.element.bubbles:
        add_blocks(_slaved_stiffness(solid, state, C), slots, data)
        return
    scatter_stiffness(C, state.g, 0.0, False, solid.gradients, solid.weights, slots, data, np.zeros((0, 0, 3)))


def stress_form(solid: Solid, state: SolidResponse, share: float, B: np.ndarray, motions: np.ndarray) -> np.ndarray:
    """Form (k, k) N mm of motions (n, 3, k) mm in the stiffness that `add_stress_stiffness` adds."""
    C = _stress_curvature(solid, state, share, B)
    if solid.element.bubbles:
        nodal = motions[solid.cells].reshape(len(solid.cells), 3 * solid.element.n_nodes, -1)
        return np.einsum("mik,mil->kl", nodal, _slaved_stiffness(solid, state, C) @ nodal)
    return strain_form(C, state.g, 0.0, False, solid.gradients, solid.weights, solid.cells, motions)


def _stress_curvature(solid: Solid, state: SolidResponse, share: float, B: np.ndarray) -> np.ndarray:
    """Derivative (m q, 9, 9) MPa of share d psi_rest / dF + F B by F."""
    C = share * curvature(solid.law, state.D, solid.parameters, np.zeros(len(state.D)))
    add_geometric(C, B)
    return C


def _slaved_stiffness(solid: Solid, state: SolidResponse, C: np.ndarray) -> np.ndarray:
    """Stiffness (m, 3 n_nodes, 3 n_nodes) of a stress with that curvature, the bubbles following the nodes."""
    K, slaved = point_stiffness(replace(solid, bulk=0.0), C, state.g), _slaved(solid, state)
    n = 3 * solid.element.n_nodes
    coupling = K[:, :n, n:] @ slaved
    return K[:, :n, :n] + coupling + coupling.swapaxes(1, 2) + slaved.swapaxes(1, 2) @ K[:, n:, n:] @ slaved


def _slaved(solid: Solid, state: SolidResponse) -> np.ndarray:
    """Motion (m, 3 bubbles, 3 n_nodes) of the bubbles' amplitudes with the nodes."""
    C, n = curvature(solid.law, state.D, solid.parameters, state.point_pressure), 3 * solid.element.n_nodes
    K = point_stiffness(solid, C, state.g)
    return -np.linalg.solve(K[:, n:, n:], K[:, n:, :n])
