"""Attachment of a point to a body through a region.

A force on a mathematical point of a 3-D body has unbounded displacement, so a compliance measured at a point has no
limit under mesh refinement. A point therefore acts through a weighted average of the positions in a ball around it:

    y = sum_i c_i x_i,    c_i = sum_s w_s N_i(s),    sum_s w_s = 1,    sum_s w_s X_s = X_point

over fixed sample points s of the ball that lie in the body. The weights are a smooth bump times the affine function
which makes the two sums hold (moving least squares, Lancaster and Salkauskas 1981), so any affine motion is followed
exactly, wherever in the body or on its surface the point lies."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import SpecError
from cfem.mechanics.element import barycentric_gradients, shape
from cfem.mechanics.mesh import Mesh

_LATTICE = 11  # sample points across the ball; from 9 to 21 of them W of the finger moves by 2e-4


@dataclass(frozen=True)
class Attachment:
    """A point that follows the body: y = weights @ x[nodes].

    nodes (k,) indices; weights (k,) sum 1; point (3,) mm its position at rest."""

    nodes: np.ndarray
    weights: np.ndarray
    point: np.ndarray

    def position(self, x: np.ndarray) -> np.ndarray:
        """(3,) mm."""
        return self.weights @ x[self.nodes]


def attach(mesh: Mesh, point: np.ndarray, radius: float, name: str) -> Attachment:
    """Attach `point` (3,) mm through the ball of `radius` mm (0: the element at the point, as the paper does).

    Raises SpecError, naming the point, where it lies outside the body."""
    point = np.asarray(point, dtype=float)
    cells, barycentric = locate(mesh, point[None, :])
    outside = -min(barycentric.min(), 0.0)
    if cells[0] < 0 or outside * _cell_size(mesh, cells[0]) > max(0.5 * radius, 1e-3 * mesh.size):
        raise SpecError(
            f"{name} at {_show(point)} mm lies outside the body",
            do="move it onto the body, or mesh more finely where the surface is curved",
        )
    if radius == 0.0:
        return _combine(mesh, point, cells, barycentric, np.ones(1))
    samples = point + radius * _ball()
    cells, barycentric = locate(mesh, samples, within=1e-9)
    inside = cells >= 0
    if inside.sum() < 8:
        raise SpecError(
            f"{name} at {_show(point)} mm has too little of the body within its radius of {radius:g} mm",
            do="enlarge the radius or move the point into the body",
        )
    offset = (samples[inside] - point) / radius
    weights = _moving_least_squares(offset, (1 - (offset**2).sum(axis=1)) ** 2)
    return _combine(mesh, point, cells[inside], barycentric[inside], weights)


def locate(mesh: Mesh, points: np.ndarray, within: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
    """The cell (k,) that holds each point (k, 3), or the nearest by barycentric coordinate, and the coordinates (k, 4).

    -1 where the smallest coordinate is below -`within`."""
    centre = mesh.X[mesh.cells[:, :4]].mean(axis=1)
    reach = np.linalg.norm(mesh.X[mesh.cells[:, :4]] - centre[:, None], axis=2).max(axis=1)
    spread = np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    near = np.linalg.norm(centre - points.mean(axis=0), axis=1) <= 2 * reach.max() + spread
    candidates = np.flatnonzero(near) if near.any() else np.arange(len(centre))
    gradients = barycentric_gradients(mesh.X, mesh.cells[candidates])
    offset = points[:, None, :] - centre[candidates][None, :, :]
    coordinates = 0.25 + np.einsum("pcd,cad->pca", offset, gradients)
    best = coordinates.min(axis=2).argmax(axis=1)
    barycentric = coordinates[np.arange(len(points)), best]
    cells = np.where(barycentric.min(axis=1) >= -within, candidates[best], -1)
    return cells, barycentric


def _ball() -> np.ndarray:
    """(k, 3) points of a cubic lattice strictly inside the unit ball."""
    axis = np.linspace(-1, 1, _LATTICE + 2)[1:-1]
    lattice = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    return lattice[(lattice**2).sum(axis=1) < 1]


def _moving_least_squares(offset: np.ndarray, bump: np.ndarray) -> np.ndarray:
    """(k,) weights bump * (a + b . offset) with sum 1 and first moment 0, the smallest such."""
    basis = np.hstack([np.ones((len(offset), 1)), offset])
    moment = basis.T @ (bump[:, None] * basis)
    return bump * (basis @ np.linalg.lstsq(moment, np.array([1.0, 0, 0, 0]), rcond=1e-12)[0])


def _combine(
    mesh: Mesh, point: np.ndarray, cells: np.ndarray, barycentric: np.ndarray, weights: np.ndarray
) -> Attachment:
    """Sum of the samples' shape functions, one weight a node."""
    values = weights[:, None] * shape(mesh.order, barycentric)
    nodes, place = np.unique(mesh.cells[cells], return_inverse=True)
    sums = np.bincount(place.ravel(), values.ravel(), len(nodes))
    return Attachment(nodes, sums, point)


def _cell_size(mesh: Mesh, cell: int) -> float:
    return float(np.ptp(mesh.X[mesh.cells[cell, :4]], axis=0).max())


def _show(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:g}" for value in point) + ")"
