"""Attachment of a point to a body through a region.

A force on a mathematical point of a 3-D body has unbounded displacement, so a compliance measured at a point has no
limit under mesh refinement. A point therefore acts through a weighted average of the positions in a ball around it:

    y = sum_i c_i x_i,    c_i = sum_s w_s N_i(s),    sum_s w_s = 1,    sum_s w_s X_s = X_point

over the points s of a quadrature of the part of the body that lies in the ball (ball.py), which has no axes of its own:
a body turned with its points has the same weights. They are volume times a smooth bump times the affine function which
makes the two sums hold (moving least squares, Lancaster and Salkauskas 1981), so any affine motion is followed exactly,
wherever in the body or on its surface the point lies."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import cdist

from cfem.constraint.ball import points_in_ball, squares
from cfem.core.errors import SpecError
from cfem.mechanics.element import barycentric_gradients, shape, shape_derivatives
from cfem.mechanics.mesh import Mesh

_LEAST = 0.01  # share of the ball that the body fills at least
_NEWTON, _FAR = 30, 4.0  # steps at most to the coordinates in a hexahedron, and how far out they are followed


@dataclass(frozen=True)
class Attachment:
    """A point that follows the body: y = weights @ x[nodes].

    nodes: (k,) indices
    weights: (k,) of sum 1
    point: (3,) mm, its position at rest"""

    nodes: np.ndarray
    weights: np.ndarray
    point: np.ndarray

    def position(self, x: np.ndarray) -> np.ndarray:
        """Position (3,) mm of the point."""
        return self.weights @ x[self.nodes]


def attach(mesh: Mesh, point: np.ndarray, radius: float, name: str, cells: np.ndarray | None = None) -> Attachment:
    """Attach `point` (3,) mm through the ball of `radius` mm (0: the element at the point, as the paper does), where
    `cells` are given through these alone: one body of several.

    Raises SpecError, naming the point, where it lies outside the body."""
    point = np.asarray(point, dtype=float)
    if not np.isfinite(point).all():
        raise SpecError(f"{name} at {show(point)} mm: coordinates must be finite numbers")
    cell, coordinates = locate(mesh, point[None, :], cells=cells)
    if _gap(mesh, cell, coordinates, point[None, :])[0] > tolerance_outside(mesh, radius):
        raise SpecError(
            f"{name} at {show(point)} mm lies outside the body",
            do="move it onto the body, or mesh more finely where the surface is curved",
        )
    if radius == 0.0:
        return _combine(mesh, point, cell, coordinates, np.ones(1))
    among = np.arange(len(mesh.cells)) if cells is None else np.asarray(cells)
    cell, coordinates, places, volumes = points_in_ball(mesh, point, radius, among)
    if volumes.sum() < _LEAST * 4 / 3 * np.pi * radius**3:
        raise SpecError(
            f"{name} at {show(point)} mm has too little of the body within its radius of {radius:g} mm",
            do=_advice(mesh, radius),
        )
    offset = (places - point) / radius
    weights = _moving_least_squares(offset, volumes / volumes.sum() * (1 - squares(offset)) ** 2)
    return _polished(mesh, _combine(mesh, point, cell, coordinates, weights))


def _advice(mesh: Mesh, radius: float) -> str:
    """Advice where the ball about a point holds too little of the body."""
    thin = float(np.ptp(mesh.X, axis=0).min())
    if radius > thin:
        return f"state a smaller radius: the body is {thin:.3g} mm thin"
    return "enlarge the radius or move the point into the body"


def locate(
    mesh: Mesh, points: np.ndarray, within: float = np.inf, cells: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The cell (k,), of `cells` where given, that holds each point (k, 3) or is nearest, and the point's coordinates
    there: barycentric (k, 4), or (k, 3) in [-1, 1]^3 of a hexahedron.

    -1 where the point lies outside by more than `within` of the cell's size: the smallest barycentric coordinate, or
    (1 - the largest |xi|) / 2, is below -`within`."""
    among = np.arange(len(mesh.cells)) if cells is None else np.asarray(cells)
    number, cell = _near(mesh, points, among)
    coordinates, depth = _coordinates(mesh, cell, points[number])
    gap = np.where(depth >= -1e-9, 0.0, _gap(mesh, cell, coordinates, points[number]))
    order = np.lexsort((-depth, gap, number))  # of a point's cells that with the least gap, then the deepest
    best = order[np.unique(number[order], return_index=True)[1]]
    return np.where(depth[best] >= -within, cell[best], -1), coordinates[best]


def distance_outside(mesh: Mesh, points: np.ndarray, cells: np.ndarray | None = None) -> np.ndarray:
    """Distances (k,) mm from points (k, 3) to the body, 0 inside; a little more than the least distance outside."""
    cell, coordinates = locate(mesh, points, cells=cells)
    return _gap(mesh, cell, coordinates, points)


def tolerance_outside(mesh: Mesh, radius: float) -> float:
    """Distance (mm) by which a point may lie outside of the mesh that it is attached to through a region of `radius`
    mm: on the curved side of a coarse mesh it does."""
    return max(0.5 * radius, 1e-3 * mesh.size)


def show(point: np.ndarray) -> str:
    """A point as messages write it."""
    return "(" + ", ".join(f"{value:g}" for value in point) + ")"


def _corners(mesh: Mesh, cells: np.ndarray) -> np.ndarray:
    """Nodes (k, 4 | 8) that alone shape a cell (edges are straight)."""
    return mesh.cells[cells, : 8 if mesh.cells.shape[1] == 8 else 4]


def _near(mesh: Mesh, points: np.ndarray, among: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (index of a point, cell) worth a look: every cell that may hold the point, and at least one a point."""
    corners = mesh.X[_corners(mesh, among)]
    centre = corners.mean(axis=1)
    reach = 1.5 * np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    middle = points.mean(axis=0)
    apart = np.linalg.norm(centre - middle, axis=1) - reach
    kept = apart <= max(np.linalg.norm(points - middle, axis=1).max(), apart.min())
    apart = cdist(points, centre[kept]) - reach[kept]
    number, place = np.nonzero(apart <= np.maximum(apart.min(axis=1, keepdims=True), 0))
    return number, among[kept][place]


def _coordinates(mesh: Mesh, cells: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reference coordinates of points (k, 3) in cells (k,), and how deep inside they lie, negative outside."""
    if mesh.cells.shape[1] == 8:
        xi, converged = _inverse_trilinear(mesh.X[mesh.cells[cells]], points)
        depth = (1 - np.abs(xi).max(axis=1)) / 2
        return xi, np.where(converged, depth, np.minimum(depth, -1.0))
    unique, place = np.unique(cells, return_inverse=True)
    offset = points - mesh.X[_corners(mesh, unique)].mean(axis=1)[place]
    barycentric = 0.25 + np.einsum("kd,kad->ka", offset, barycentric_gradients(mesh.X, mesh.cells[unique])[place])
    return barycentric, barycentric.min(axis=1)


def _inverse_trilinear(corners: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates xi (k, 3) of points (k, 3) in hexahedra (k, 8, 3) by Newton's method from the centre, and whether it
    converged: it does inside a cell that is not folded, and need not far outside."""
    xi = np.zeros_like(points)
    small = 1e-13 * (np.ptp(corners, axis=1).max(axis=1) + np.abs(points).max(axis=1))
    left = np.arange(len(points))
    for _ in range(_NEWTON):
        cells = corners[left]
        missing = points[left] - np.einsum("kn,knd->kd", shape(8, xi[left]), cells)
        unsettled = np.abs(missing).max(axis=1) > small[left]
        left, cells, missing = left[unsettled], cells[unsettled], missing[unsettled]
        if len(left) == 0:
            break
        jacobian = np.swapaxes(shape_derivatives(8, xi[left]), 1, 2) @ cells  # rows dx / dxi_a
        minors = np.cross(jacobian[:, [1, 2, 0]], jacobian[:, [2, 0, 1]])
        volume = np.einsum("kd,kd->k", jacobian[:, 0], minors[:, 0])
        step = np.einsum("kad,kd->ka", minors, missing) / np.where(volume == 0, np.inf, volume)[:, None]
        xi[left] = np.clip(xi[left] + np.clip(step, -1, 1), -_FAR, _FAR)
    converged = np.ones(len(points), dtype=bool)
    converged[left] = False
    return xi, converged


def _gap(mesh: Mesh, cells: np.ndarray, coordinates: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distances (k,) mm from each point to the point of its cell to which its coordinates are cut back."""
    if mesh.cells.shape[1] == 8:
        weights = shape(8, np.clip(coordinates, -1, 1))
    else:
        weights = np.maximum(coordinates, 0)
        weights /= weights.sum(axis=1, keepdims=True)
    return np.linalg.norm(points - np.einsum("ka,kad->kd", weights, mesh.X[_corners(mesh, cells)]), axis=1)


def _moving_least_squares(offset: np.ndarray, bump: np.ndarray) -> np.ndarray:
    """Weights (k,) bump * (a + b . offset) with sum 1 and first moment 0, the smallest such."""
    basis = np.hstack([np.ones((len(offset), 1)), offset])
    moment = basis.T @ (bump[:, None] * basis)
    return bump * (basis @ np.linalg.lstsq(moment, np.array([1.0, 0, 0, 0]), rcond=1e-12)[0])


def _polished(mesh: Mesh, raw: Attachment) -> Attachment:
    """Weights without the rounding that sums of thousands of points gather: sum 1 and first moment 0, of the nodes'
    weights."""
    arm = mesh.X[raw.nodes] - raw.point
    basis = np.hstack([np.ones((len(arm), 1)), arm / np.abs(arm).max()])
    missing = np.array([1.0, 0, 0, 0]) - raw.weights @ basis
    size = np.abs(raw.weights)[:, None]
    return replace(raw, weights=raw.weights + (size * basis) @ np.linalg.lstsq(basis.T @ (size * basis), missing)[0])


def _combine(
    mesh: Mesh, point: np.ndarray, cells: np.ndarray, coordinates: np.ndarray, weights: np.ndarray
) -> Attachment:
    """Sum of the samples' shape functions, one weight a node."""
    values = weights[:, None] * shape(mesh.cells.shape[1], coordinates)
    touched, n = mesh.cells[cells].ravel(), len(mesh.X)
    sums = np.bincount(touched, values.ravel(), n)
    nodes = np.flatnonzero(np.bincount(touched, minlength=n))
    return Attachment(nodes, sums[nodes], point)
