"""One mesh for all designs of a catalogue robot: the reference mesh with its nodes moved, its connectivity kept.

Every boundary node stays on the surfaces of the CAD tree that it lies on at the reference; where attached points are
to go is prescribed; everything else follows as an elastic body does (linear elasticity on the reference mesh; the
stiffness of a cell is the inverse of its volume, so that small cells keep their shape; Stein, Tezduyar, Benney, J.
Appl. Mech. 70, 2003). With u the displacements of the corners and J the gradients of surfaces and points at the
reference,

    K u + J^T mu = 0        J u = what is missing,

repeated with the same factor until nothing is missing: planes that only shift are met at once, and cones after a few
steps. X is a smooth
function of the design, so that what is computed on the mesh is too: no new mesh scatters it. Its derivative by the
design solves the same equations once differentiated, G dX = what is missing by the change of the design at fixed X, G
the gradients at X, by the same steps: an order more exact than differences of meshes that each miss 1e-10 mm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from cfem.constraint.attachment import Attachment
from cfem.contact.surface.triangles import normals_of
from cfem.core.errors import NumericalError, SpecError
from cfem.mechanics.mesh import Mesh, tet_volumes
from cfem.robot.cad import Solid
from cfem.robot.shape.elastic import middles, stiffness
from cfem.robot.shape.surfaces import Surface, surfaces

_ON, _ALONG = 1e-6, 0.9  # of the mesh's size: on a surface; cosine between a facet's normal and the surface's
_STEEP = 0.5  # that of a large facet on a narrow cone, where no surface is nearer to its normal
_INDEPENDENT = 1e-3  # sine of the angle below which a surface says what others have said
_ITERATIONS, _TOLERANCE, _MEMORY = 60, 1e-10, 5  # tolerance in mm; steps that the next one remembers
_OF_SLOPES = 1e-10  # tolerance of derivatives, relative
THINNEST = 0.1  # of a cell's reference volume that must be left


@dataclass(frozen=True)
class _Bound:
    """Nodes (k,) that stay on surface number `surface`."""

    surface: int
    nodes: np.ndarray


class Unreachable(NumericalError):
    """A design to which the mesh does not stretch. near: the number of the point next to where it fails."""

    def __init__(self, what: str, near: int | None = None, *, where: str | None = None, do: str | None = None):
        super().__init__(what, where=where, do=do)
        self.near = near


class Morph:
    """Map from designs of a solid to meshes: the reference mesh with its nodes moved."""

    def __init__(self, mesh: Mesh, solid: Solid, points: Sequence[Attachment] = ()):
        """Factors the equations at the reference. mesh: of tetrahedra; solid: its CAD tree; points: attached there,
        whose places a design prescribes. SpecError where a part of the boundary is on no surface of the tree."""
        self.mesh, self._points = mesh, tuple(points)
        self._corners = np.unique(mesh.cells[:, :4])
        self._edges = middles(mesh)
        self._bounds = _bounds(mesh, surfaces(solid))
        self._bound_nodes = np.concatenate([bound.nodes for bound in self._bounds])
        self._place = np.full(len(mesh.X), -1)
        self._place[self._corners] = np.arange(len(self._corners))
        self._led = self._leading()
        J, self._kept = self._constraints(surfaces(solid))
        K = stiffness(mesh)
        n, m = K.shape[0], J.shape[0]
        scale = float(abs(K).max())
        saddle = sp.bmat([[K, scale * J.T], [scale * J, -1e-12 * scale * sp.eye(m)]], format="csc")
        self._factor, self._n, self._scale = splu(saddle), n, scale

    def __call__(self, solid: Solid, places: np.ndarray) -> Mesh:
        """The mesh of another design: its tree, and where the points (k, 3) mm go. Unreachable where it cannot be
        reached or a cell is left too thin."""
        now = surfaces(solid)
        X, past = self.mesh.X.copy(), _Anderson()
        for _ in range(_ITERATIONS):
            missing = self._missing(now, places, X)
            if np.abs(missing).max(initial=0.0) <= _TOLERANCE:
                break
            right = np.concatenate([np.zeros(self._n), self._scale * missing[self._kept]])
            u = self._factor.solve(right)[: self._n]
            X[self._corners] += past.accelerated(missing, u).reshape(-1, 3)
            X[self._edges[:, 0]] = (X[self._edges[:, 1]] + X[self._edges[:, 2]]) / 2
        else:
            last = int(np.abs(missing).argmax()) - (len(missing) - 3 * len(places))
            near = last // 3 if last >= 0 else None
            raise Unreachable(f"the mesh does not follow the design: {np.abs(missing).max():.2g} mm are missing", near)
        left = tet_volumes(X, self.mesh.cells) / self.mesh.volumes
        if not left.min() > THINNEST:
            centre = self.mesh.X[self.mesh.cells[left.argmin(), :4]].mean(axis=0)
            apart = [float(np.linalg.norm(point.point - centre)) for point in self._points]
            near = int(np.argmin(apart)) if apart else None
            raise Unreachable(f"the morphed mesh has a cell with {left.min():.2g} of its volume left", near)
        return replace(self.mesh, X=X)

    def changes(self, solid: Solid, X: np.ndarray, sums: Sequence[Sequence[tuple[float, Solid, np.ndarray]]]):
        """Weighted sums (k, n, 3) of the nodes of designs near to `solid`, to first order. sums: of each the weight,
        tree and points' places of every design; weights add up to 0, as those of a difference do. X (n, 3): the mesh of
        `solid` itself. Unreachable where the mesh does not follow."""
        wanted = [sum(w * self._missing(surfaces(design), places, X) for w, design, places in terms) for terms in sums]
        D = np.stack(wanted, axis=1)
        G = sp.vstack([self._bound(self._normals(surfaces(solid), X), slice(None)), self._led]).tocsr()
        U, past = np.zeros((self._n, len(sums))), [_Anderson() for _ in sums]
        tolerance = _OF_SLOPES * np.abs(D).max(axis=0, initial=0.0)
        for _ in range(_ITERATIONS):
            left = D - G @ U
            going = np.flatnonzero(np.abs(left).max(axis=0, initial=0.0) > tolerance)
            if not len(going):
                break
            right = np.vstack([np.zeros((self._n, len(going))), self._scale * left[self._kept][:, going]])
            for column, step in zip(going, self._factor.solve(right)[: self._n].T, strict=True):
                U[:, column] += past[column].accelerated(left[:, column], step)
        else:
            raise Unreachable("the mesh does not follow a small change of the design", None)
        moves = np.zeros((len(sums), *X.shape))
        moves[:, self._corners] = U.T.reshape(len(sums), -1, 3)
        moves[:, self._edges[:, 0]] = (moves[:, self._edges[:, 1]] + moves[:, self._edges[:, 2]]) / 2
        return moves

    def _missing(self, now: Sequence[Surface], places: np.ndarray, X: np.ndarray) -> np.ndarray:
        """Residuals (m,) mm of all constraints: distances of bound nodes from surfaces, then of points from places."""
        on_surfaces = [-now[bound.surface].value(X[bound.nodes]) for bound in self._bounds]
        on_points = [place - point.position(X) for place, point in zip(places, self._points, strict=True)]
        return np.concatenate([*on_surfaces, *on_points])

    def _normals(self, now: Sequence[Surface], X: np.ndarray) -> np.ndarray:
        """Normals (m, 3) of the surfaces at the nodes that are bound to them."""
        return np.concatenate([now[bound.surface].gradient(X[bound.nodes]) for bound in self._bounds])

    def _bound(self, normals: np.ndarray, chosen: np.ndarray | slice) -> sp.csr_matrix:
        """Gradient (k, 3 corners) of the distances of chosen bound nodes from their surfaces."""
        nodes, normals = self._bound_nodes[chosen], normals[chosen]
        rows = np.repeat(np.arange(len(nodes)), 3)
        columns = (3 * self._place[nodes, None] + np.arange(3)).ravel()
        return sp.csr_matrix((normals.ravel(), (rows, columns)), (len(nodes), 3 * len(self._corners)))

    def _constraints(self, now: Sequence[Surface]) -> tuple[sp.csr_matrix, np.ndarray]:
        """J (m, 3 corners) of the independent constraints, and which of all they are."""
        normals = self._normals(now, self.mesh.X)
        kept = _independent(self._bound_nodes, normals)
        bound = self._bound(normals, kept)
        kept = np.concatenate([kept, len(normals) + np.arange(3 * len(self._points))])
        return sp.vstack([bound, self._led]).tocsr(), kept

    def _leading(self) -> sp.csr_matrix:
        """Gradient (3 points, 3 corners) of the points' places. A middle node follows its two corners."""
        corner = sp.lil_matrix((len(self.mesh.X), len(self._corners)))
        corner[self._corners, np.arange(len(self._corners))] = 1.0
        for side in (1, 2):
            corner[self._edges[:, 0], self._place[self._edges[:, side]]] = 0.5
        weights = sp.lil_matrix((len(self._points), len(self.mesh.X)))
        for row, point in enumerate(self._points):
            weights[row, point.nodes] = point.weights
        return sp.csr_matrix(sp.kron(weights.tocsr() @ corner.tocsr(), sp.eye(3)))


class _Anderson:
    """Steps so far. Where surfaces meet at small angles, plain steps converge slowly; Anderson's combine them (J. ACM
    12, 1965; Walker and Ni, SIAM J. Numer. Anal. 49, 2011)."""

    def __init__(self):
        self._missing: list[np.ndarray] = []  # differences from step to step
        self._moved: list[np.ndarray] = []
        self._last: tuple[np.ndarray, ...] = ()

    def accelerated(self, missing: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Step to take instead of the plain one: Anderson acceleration with the steps before."""
        if self._last:
            self._missing.append(missing - self._last[0])
            self._moved.append(self._last[1] + step - self._last[2])
        taken = step
        if self._missing:
            self._missing, self._moved = self._missing[-_MEMORY:], self._moved[-_MEMORY:]
            shares = np.linalg.lstsq(np.stack(self._missing, axis=1), missing, rcond=1e-12)[0]
            taken = step - np.stack(self._moved, axis=1) @ shares
        self._last = missing, taken, step
        return taken


def _bounds(mesh: Mesh, now: Sequence[Surface]) -> list[_Bound]:
    """Surfaces and the nodes that keep to them: those of facets whose corners all lie on the surface, and which face
    along it."""
    facets = mesh.facets[:, :3]
    a, b, c = (mesh.X[facets[:, i]] for i in range(3))
    normal = normals_of(mesh.X[facets])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    centre = (a + b + c) / 3
    bounds, covered = [], np.zeros(len(facets), dtype=bool)
    for least in (_ALONG, _STEEP):
        before = covered.copy()
        for number, surface in enumerate(now):
            on_surface = np.max([np.abs(surface.value(corner)) for corner in (a, b, c)], axis=0) <= _ON * mesh.size
            along = np.abs(np.einsum("ij,ij->i", surface.gradient(centre), normal))
            bound = on_surface & (along > least) & (~before if least == _STEEP else True)
            if (bound & ~covered).any():  # a surface that says nothing new is another's twin
                bounds.append(_Bound(number, np.unique(facets[bound])))
            covered |= bound
    if not covered.all():
        raise SpecError(
            f"{(~covered).sum()} of {len(facets)} facets of the mesh do not lie on a surface of the geometry"
        )
    return bounds


def _independent(nodes: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Indices of constraints (node, normal (3,)) that say something new, at most three a node."""
    kept, known = [], {}
    for index, (node, normal) in enumerate(zip(nodes.tolist(), normals, strict=True)):
        basis = known.setdefault(node, [])
        rest = normal - sum((normal @ direction) * direction for direction in basis)
        size = np.linalg.norm(rest)
        if size > _INDEPENDENT * np.linalg.norm(normal):
            basis.append(rest / size)
            kept.append(index)
    return np.array(kept)
