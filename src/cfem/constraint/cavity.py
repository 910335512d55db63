"""A closed pneumatic cavity of the body: delta = V - V0 in mm^3, its growth; the multiplier is the pressure in MPa.

The volume behind a closed surface is V = 1/3 int x . n dA, which on facets x(xi, eta) = sum_a N_a x_a is a trilinear
form of the nodal positions:

    V = sum over facets, A_abc det(x_a, x_b, x_c),    A_abc = 1/3 int N_a dN_b/dxi dN_c/deta dxi deta

made antisymmetric in a, b, c, as the determinant is. Hence, without quadrature at run time,

    dV/dx_a = 3 A_abc x_b x x_c,    d2V/dx_a dx_b = 6 A_abc [x_c],    u . [x_c] v = det(u, v, x_c)

p dV/dx is the force of a pressure that follows the wall, p d2V/dx2 its load stiffness, symmetric because the surface
is closed (Rumpel and Schweizerhof, Int. J. Numer. Meth. Engng 59, 2004, for fluids that fill a structure): what a
single facet's share has of its rim cancels against the neighbours'."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import permutations
from typing import ClassVar

import numpy as np

from cfem.constraint.attachment import show
from cfem.contact.surface.facets import components, edges, solid_angles, unmatched_edges
from cfem.core.console.shown import counted
from cfem.core.errors import SpecError
from cfem.mechanics.element import shape, shape_derivatives
from cfem.mechanics.mesh import Mesh

# A facet of so many nodes is a face of the cell of so many, these its nodes.
_FACE = {3: (4, [0, 1, 2]), 6: (10, [0, 1, 2, 4, 5, 6]), 4: (8, [0, 1, 2, 3])}


@dataclass(frozen=True)
class Cavity:
    """A closed cavity.

    nodes: (k,)
    cliques: one batch, the facets (g, 3 | 6 | 4) of nodes
    place: (g, 3 | 6 | 4) the facets' nodes by their place in `nodes`
    form: (a, b, c) A, negated where the facets' normals point into the cavity
    rest_volume: mm^3
    rest: (1,) 0"""

    nodes: np.ndarray
    cliques: tuple[np.ndarray]
    place: np.ndarray
    form: np.ndarray
    rest_volume: float
    rest: np.ndarray
    units: ClassVar[tuple[str, str]] = ("mm^3", "MPa")

    def value(self, x: np.ndarray) -> np.ndarray:
        y = _local(x, self.nodes, self.place)
        return np.array([_volume(y, self.form) - self.rest_volume])

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Gradient (1, k, 3) mm^2 of the volume: the force on the wall at unit pressure, outward of the cavity."""
        forces = _forces(_local(x, self.nodes, self.place), self.form)
        sums = [np.bincount(self.place.ravel(), part.ravel(), len(self.nodes)) for part in forces]
        return np.stack(sums, axis=-1)[None]

    def curvature(self, x: np.ndarray) -> Sequence[np.ndarray]:
        """Hessian of the volume, a block (3 k, 3 k) for each facet: 6 A_abc x_c in the skew entries."""
        y = _local(x, self.nodes, self.place)
        _, g, k = y.shape
        spin = (y.reshape(-1, k) @ (6 * self.form).reshape(k * k, k).T).reshape(3, g, k, k)  # 6 A_abc x_c
        matrix = np.zeros((g, k, 3, k, 3))
        for i, j, axis in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            matrix[:, :, i, :, j] = spin[axis]
            matrix[:, :, j, :, i] = -spin[axis]
        return [matrix.reshape(g, 3 * k, 3 * k)]


def make_cavity(X: np.ndarray, facets: np.ndarray, name: str) -> Cavity:
    """The cavity bounded by `facets` (g, 3 | 6 | 4) of nodes X (n, 3) mm at rest, oriented alike.

    Normals may point into the cavity, as those of a solid around it do, or out of it. Raises SpecError where the
    facets do not close or have no volume behind them."""
    facets = np.asarray(facets)
    if len(facets) == 0:
        raise SpecError(f"cavity '{name}' has no facets", do="select the walls of the chamber")
    _check_closed(X, facets, name)
    nodes, place = np.unique(facets, return_inverse=True)
    place = place.reshape(facets.shape)
    form = _form(facets.shape[1])
    volume = _volume(_local(X, nodes, place), form)
    if abs(volume) < 1e-10 * np.linalg.norm(np.ptp(X[nodes], axis=0)) ** 3:
        raise SpecError(
            f"cavity '{name}' has no volume: {abs(volume):.3g} mm^3 behind {len(facets)} facets",
            do="check that its walls do not coincide and that no facet is listed twice",
        )
    sign = np.sign(volume)
    return Cavity(nodes, (facets,), place, sign * form, float(sign * volume), np.zeros(1))


def is_skin(X: np.ndarray, facets: np.ndarray) -> bool:
    """True where closed facets of a body's boundary, their normals out of the material, have the material inside: the
    outer skin, and no wall of a chamber."""
    nodes, place = np.unique(facets, return_inverse=True)
    return _volume(_local(X, nodes, place.reshape(facets.shape)), _form(facets.shape[1])) > 0


def enclosed(mesh: Mesh, inside_point: np.ndarray, name: str = "cavity") -> np.ndarray:
    """Indices into mesh.facets of the wall of the void around `inside_point` (3,) mm (an island inside is no part of
    it): the innermost component of the boundary that winds around the point with its normals towards it.

    Raises SpecError where the point lies in the material, on a wall or outside every void."""
    point = np.asarray(inside_point, dtype=float)
    corners = mesh.facets[:, : 4 if mesh.facets.shape[1] == 4 else 3]
    start, end = edges(corners)
    count, part = components(np.minimum(start, end) * len(mesh.X) + np.maximum(start, end))
    winding = np.bincount(part, solid_angles(mesh.X[corners] - point), count) / (4 * np.pi)
    turns = np.round(winding)
    where = f"{name}: its inside point {show(point)} mm"
    if np.abs(winding - turns).max(initial=0.0) > 1e-3:
        raise SpecError(f"{where} lies on the boundary of the body", do="move it into the middle of the chamber")
    if turns.sum() != 0:
        raise SpecError(
            f"{where} lies in the material",
            do="move it into the chamber, and check that the chamber is cut out of the body",
        )
    walls = np.flatnonzero(turns < 0)
    if len(walls) == 0:
        raise SpecError(
            f"{where} lies outside the body and in no closed chamber",
            do="move it into the chamber; a chamber that is open to the outside needs a lid",
        )
    extent = [np.linalg.norm(np.ptp(mesh.X[corners[part == wall]].reshape(-1, 3), axis=0)) for wall in walls]
    return np.flatnonzero(part == walls[np.argmin(extent)])


@cache
def _form(k: int) -> np.ndarray:
    """A (k, k, k) of a facet of k nodes, antisymmetric; Gauss-Legendre of degree 5, exact for these polynomials."""
    n_nodes, face = _FACE[k]
    s, w = np.polynomial.legendre.leggauss(3)
    s, t, w = (part.ravel() for part in (*np.meshgrid(s, s, indexing="ij"), np.outer(w, w)))
    if k == 4:
        by_xi, by_eta = np.eye(3)[:2]
        coordinates = np.column_stack([s, t, -np.ones_like(s)])
    else:  # the square folded onto the triangle: L1 = s, L2 = (1 - s) t
        by_xi, by_eta = np.array([[-1.0, 1, 0, 0], [-1.0, 0, 1, 0]])
        s, t, w = (1 + s) / 2, (1 + t) / 2, w / 4 * (1 - s) / 2
        coordinates = np.column_stack([(1 - s) * (1 - t), s, (1 - s) * t, np.zeros_like(s)])
    N = shape(n_nodes, coordinates)[:, face]
    dN = shape_derivatives(n_nodes, coordinates)[:, face]
    plain = np.einsum("q,qa,qb,qc->abc", w / 3, N, dN @ by_xi, dN @ by_eta)
    turns = [(np.linalg.det(np.eye(3)[list(axes)]), plain.transpose(axes)) for axes in permutations(range(3))]
    return sum(sign * turned for sign, turned in turns) / 6


def _local(x: np.ndarray, nodes: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Positions (3, g, k) of the facets' nodes from the middle of all, which keeps the digits of a small cavity far
    from the origin (a closed surface has the same volume seen from anywhere)."""
    places = x[nodes]
    return np.ascontiguousarray((places - places.mean(axis=0)).T)[:, place]


def _forces(y: np.ndarray, form: np.ndarray) -> np.ndarray:
    """Forces (3, g, k) mm^2 at unit pressure, 3 A_abc x_b x x_c, of y (3, g, k)."""
    b, c = np.triu_indices(y.shape[2], 1)  # each pair once
    p, q = y[:, :, b], y[:, :, c]
    product = np.stack([p[i] * q[j] - p[j] * q[i] for i, j in ((1, 2), (2, 0), (0, 1))])
    return product @ (6 * form[:, b, c]).T


def _volume(y: np.ndarray, form: np.ndarray) -> float:
    """Volume mm^3, a third of y . dV/dy, as it is of third degree in y."""
    return float((y * _forces(y, form)).sum() / 3)


def _check_closed(X: np.ndarray, facets: np.ndarray, name: str) -> None:
    """Raises SpecError unless every edge is shared by exactly two facets that run along it in opposite directions."""
    loose = unmatched_edges(facets)
    if len(loose) == 0:
        return
    holes, part = components(loose)
    middle = show(X[loose[part == 0]].mean(axis=(0, 1)))
    number = len(loose) // (2 if facets.shape[1] == 6 else 1)
    open_edges = counted(number, "edge does", "edges do")
    raise SpecError(
        f"cavity '{name}' is not closed: {open_edges} not lie between two facets of the same orientation, "
        + (f"around {middle} mm" if holes == 1 else f"in {holes} places, one of them around {middle} mm"),
        do="close the chamber with material, or select all of its walls and nothing else",
    )
