"""A thin layer on faces of tetrahedra that resists stretching alone, such as paper, fabric or a winding of fibres.

A membrane in the total Lagrangian description: with unit tangents t1, t2 of a face at rest and its deformed ones
f = F t, the Green strain is E_ab = (f_a . f_b - t_a . t_b) / 2, and the energy of St Venant and Kirchhoff
1/2 e^T Q e a volume, e = (E_11, E_22, 2 E_12). Q is that of plane stress (young, poisson), and each family of fibres
along d in the plane adds young_f m m^T, m e = d . E d. The gradients of the shape functions lie in the face, so that
the kernels of solids serve.

A layer much stiffer than its body binds the strain at its quadrature points. A quadratic triangle brings some six
unknowns and a linear one 1.5, so that one point (three strains) leaves a quadratic one free to bend, and three points
would lock it; linear ones lock in any case: they can only fold along their edges."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.contact.surface.triangles import normals_of
from cfem.core.errors import InputError
from cfem.mechanics.element import triangle_slopes
from cfem.mechanics.mesh import TET_FACES
from cfem.mechanics.solid_kernels import (
    displacement_gradients,
    scatter_force,
    scatter_stiffness,
    strain_form,
)

_NORMAL = 1e-3  # of a direction's length: shorter in a face, it is normal to it
POINTS = np.full((1, 3), 1 / 3)  # barycentric, of equal weight


@dataclass(frozen=True)
class Fibres:
    """A family of parallel fibres.

    direction: x, y, z, projected onto each face
    angle: rad, by which it is then turned about the normal of the face
    young: MPa, of the whole thickness of the layer"""

    direction: Sequence[float]
    angle: float
    young: float


@dataclass(frozen=True)
class Fabric:
    """What a layer is made of: thickness mm; young MPa (0: fibres alone), poisson; fibres."""

    thickness: float
    young: float = 0.0
    poisson: float = 0.3
    fibres: tuple[Fibres, ...] = ()

    def moduli(self, frames: np.ndarray) -> np.ndarray:
        """Q (k, 3, 3) MPa of faces with tangents (k, 2, 3)."""
        nu = self.poisson
        plane = np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, (1 - nu) / 2]]) * self.young / (1 - nu**2)
        Q = np.repeat(plane[None], len(frames), axis=0)
        for family in self.fibres:
            along = frames @ (np.asarray(family.direction, float) / np.linalg.norm(family.direction))
            sizes = np.linalg.norm(along, axis=1, keepdims=True)
            if (sizes < _NORMAL).any():
                count = int((sizes < _NORMAL).sum())
                raise InputError(f"the direction of fibres is normal to {count} faces", do="choose one in the faces")
            (x, y), c, s = (along / sizes).T, np.cos(family.angle), np.sin(family.angle)
            a, b = c * x - s * y, s * x + c * y
            m = np.stack([a * a, b * b, a * b], axis=1)
            Q += family.young * m[:, :, None] * m[:, None]
        return Q


@dataclass(frozen=True)
class Layer:
    """A layer on faces of a body's cells.

    X: (n, 3) mm all nodes at rest; facets: (k, 3 | 6) the faces' nodes; fabric: what it is of
    owner, nodes: number (k,) of a cell of the body that has the face, and the places (k, 3 | 6) of its nodes there
    gradients: (k, q, 3 | 6, 3) 1/mm of the shape functions, in the face; weights: (k, q) mm^3
    frames: (k, 2, 3) unit tangents; moduli: (k, 3, 3) MPa; points: (q, 3) barycentric"""

    X: np.ndarray
    facets: np.ndarray
    fabric: Fabric
    points: np.ndarray
    owner: np.ndarray
    nodes: np.ndarray
    gradients: np.ndarray
    weights: np.ndarray
    frames: np.ndarray
    moduli: np.ndarray


@dataclass(frozen=True)
class LayerResponse:
    """Response at positions: energy N mm; D (k q, 3, 3) displacement gradient in the face; stress (k q, 3) MPa, the
    second Piola-Kirchhoff one."""

    energy: float
    D: np.ndarray
    stress: np.ndarray


def make_layer(
    X: np.ndarray, cells: np.ndarray, facets: np.ndarray, fabric: Fabric, points: np.ndarray = POINTS
) -> Layer:
    """Layer on faces (k, 3 | 6) of tetrahedra `cells`. InputError where a face is none of a cell, or fibres are normal
    to it."""
    owner = _owners(cells, facets)
    nodes = (cells[owner][:, None, :] == facets[:, :, None]).argmax(axis=2)
    a, b, c = X[facets[:, :3]].swapaxes(0, 1)
    across = normals_of(X[facets[:, :3]])
    twice = np.linalg.norm(across, axis=1)
    first = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
    normal = across / twice[:, None]
    frames = np.stack([first, np.cross(normal, first)], axis=1)
    opposite = np.stack([c - b, a - c, b - a], axis=1)
    barycentric = np.cross(normal[:, None], opposite) / twice[:, None, None]
    gradients = np.einsum("qnl,kli->kqni", triangle_slopes(facets.shape[1], points), barycentric)
    weights = np.repeat((fabric.thickness * twice / 2 / len(points))[:, None], len(points), axis=1)
    gradients = np.ascontiguousarray(gradients)
    return Layer(X, facets, fabric, points, owner, nodes, gradients, weights, frames, fabric.moduli(frames))


def _owners(cells: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Number (k,) of a cell that has each face."""
    faces = np.sort(cells[:, TET_FACES].reshape(-1, 3), axis=1)
    corners = np.sort(facets[:, :3], axis=1)
    _, number = np.unique(np.concatenate([faces, corners]), axis=0, return_inverse=True)
    cell = np.full(number.max() + 1, -1)
    cell[number.ravel()[: len(faces)]] = np.repeat(np.arange(len(cells)), len(TET_FACES))
    owner = cell[number.ravel()[len(faces) :]]
    if (owner < 0).any():
        raise InputError(f"{int((owner < 0).sum())} faces of a layer belong to no cell of the body")
    return owner


def response(layer: Layer, x: np.ndarray, force: np.ndarray) -> LayerResponse:
    """Response at positions x (n, 3) mm, the internal force added to `force` (n, 3) N."""
    D = displacement_gradients(x - layer.X, layer.facets, layer.gradients)
    t, f = _tangents(layer, D)
    moved = f - t  # D t, without the rounding of f . f - 1
    E = (t @ moved.swapaxes(1, 2) + moved @ t.swapaxes(1, 2) + moved @ moved.swapaxes(1, 2)) / 2
    strain = np.stack([E[:, 0, 0], E[:, 1, 1], 2 * E[:, 0, 1]], axis=1)
    stress = np.einsum("kij,kj->ki", _each_point(layer, layer.moduli), strain)
    P = f.swapaxes(1, 2) @ _matrix(stress) @ t
    scatter_force(P, P, np.zeros(len(P)), layer.gradients, layer.weights, layer.facets, force)
    energy = (stress * strain).sum(axis=1) @ layer.weights.ravel() / 2
    return LayerResponse(float(energy), D, stress)


def tangent(
    layer: Layer, state: LayerResponse, slots: np.ndarray, data: np.ndarray, before: LayerResponse | None = None
) -> None:
    """Adds the tangent stiffness (N/mm) to `data`, slots (m, n, n, 3) of the body's cells. before: where the linear
    step to `state` began; the geometric part then uses the stress predicted there, as that of solids does."""
    stress = state.stress if before is None else _predicted(layer, before, state)
    C, none = _curvature(layer, state.D, stress), np.zeros((0, 0, 3))
    mine = slots[layer.owner[:, None, None], layer.nodes[:, :, None], layer.nodes[:, None]]
    scatter_stiffness(
        C, np.zeros_like(state.D), 0.0, False, layer.gradients, layer.weights, np.ascontiguousarray(mine), data, none
    )


def tangent_form(layer: Layer, state: LayerResponse, motions: np.ndarray) -> np.ndarray:
    """Form M^T A M (k, k) N mm of the tangent stiffness A and motions M (n, 3, k) mm."""
    C, none = _curvature(layer, state.D, state.stress), np.zeros_like(state.D)
    return strain_form(C, none, 0.0, False, layer.gradients, layer.weights, layer.facets, motions)


def kept(layer: Layer, keep: np.ndarray, cells: np.ndarray) -> Layer:
    """The layer on the cells `keep` (m,) of the body alone, whose nodes are numbered as in `cells` then."""
    return make_layer(layer.X, cells, layer.facets[keep[layer.owner]], layer.fabric, layer.points)


def moved(layer: Layer, X: np.ndarray, cells: np.ndarray) -> Layer:
    """The layer with the nodes at rest elsewhere, X (n, 3) mm; directions of fibres stay."""
    return make_layer(X, cells, layer.facets, layer.fabric, layer.points)


def _tangents(layer: Layer, D: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit tangents t and deformed ones f, (k q, 2, 3) each."""
    t = _each_point(layer, layer.frames)
    return t, t + t @ D.swapaxes(1, 2)


def _each_point(layer: Layer, values: np.ndarray) -> np.ndarray:
    return np.repeat(values, layer.weights.shape[1], axis=0)


def _matrix(stress: np.ndarray) -> np.ndarray:
    """Symmetric matrices (k, 2, 2) of their entries (S_11, S_22, S_12)."""
    return stress[:, [0, 2, 2, 1]].reshape(-1, 2, 2)


def _strain_gradient(t: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Derivatives (k, 3, 9) of (E_11, E_22, 2 E_12) by F."""
    pairs = np.einsum("kai,kbj->kabij", f, t).reshape(len(t), 2, 2, 9)
    return np.stack([pairs[:, 0, 0], pairs[:, 1, 1], pairs[:, 0, 1] + pairs[:, 1, 0]], axis=1)


def _curvature(layer: Layer, D: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """Second derivatives (k q, 9, 9) MPa of the energy a volume by F, under the stress (k q, 3)."""
    t, f = _tangents(layer, D)
    B = _strain_gradient(t, f)
    C = B.swapaxes(1, 2) @ _each_point(layer, layer.moduli) @ B
    S = t.swapaxes(1, 2) @ _matrix(stress) @ t
    blocks = C.reshape(-1, 3, 3, 3, 3)
    for i in range(3):
        blocks[:, i, :, i, :] += S
    return C


def _predicted(layer: Layer, before: LayerResponse, now: LayerResponse) -> np.ndarray:
    """Stress (k q, 3) MPa that the linearisation at `before` predicted for `now`."""
    strain = _strain_gradient(*_tangents(layer, before.D)) @ (now.D - before.D).reshape(-1, 9, 1)
    return before.stress + (_each_point(layer, layer.moduli) @ strain)[:, :, 0]
