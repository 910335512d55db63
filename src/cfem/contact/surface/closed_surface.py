"""Signed distance to a closed surface of triangles, exact on both sides.

The nearest point is the nearest of all triangles that can hold it: those whose centroid is no farther away than the
nearest vertex and their own radius, found in trees of centroids, one for each class of radii. The sign is that of
(p - nearest point) . n, with the normal n of the face, the sum of the two normals at an edge, and the sum of normals
weighted by their angles at a vertex (Baerentzen and Aanaes, *Signed distance computation using the angle weighted
pseudonormal*, IEEE TVCG 11, 2005). Next to triangles without area it is that of the winding number."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from cfem.contact.surface.facets import components, edges, solid_angles, unmatched_edges
from cfem.contact.surface.triangles import closest
from cfem.core.console.shown import counted
from cfem.core.errors import InputError

ON = 1e-10  # of the size: nearer to an edge or a vertex the way to it has no direction that rounding leaves
FLAT = 1e-12  # of the square of the longest edge: a triangle has no area
PAIRS = 200_000  # of points and triangles at a time
TRIED = 200  # triangles at which it is seen whether the surface encloses


@dataclass(frozen=True, eq=False)
class ClosedSurface:
    """A surface that bounds one solid or several that do not overlap, with or without cavities. InputError where it
    does not enclose; overlaps are looked for at TRIED triangles only.

    vertices: (v, 3) mm
    triangles: (t, 3), normals outward"""

    vertices: np.ndarray
    triangles: np.ndarray

    def __post_init__(self) -> None:
        """Checks the arrays, that the surface is closed, and that its normals point outward."""
        vertices, triangles = self.vertices, self.triangles
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
            raise InputError("closed mesh: vertices must be finite numbers in three dimensions")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu" or not len(triangles):
            raise InputError("closed mesh: triangles must be three numbers of vertices each")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise InputError(f"closed mesh: triangles name vertices that are not among the {len(vertices)}")
        self._demand_closed()
        self._demand_outward()

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances (k,) mm of points (k, 3), negative inside, and their unit gradients (k, 3)."""
        distance, normal = np.empty(len(points)), np.empty((len(points), 3))
        reach = self._vertex_tree.query(points)[0] * (1 + 1e-12)
        for some in _portions(points, 100 if len(self.triangles) > 2000 else 1000):
            distance[some], normal[some] = self._signed(points[some], *self._nearest(points[some], reach[some]))
        return distance, normal

    def at_least(self, corners: np.ndarray, wanted: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """Distances (k,) mm of the centroids of other triangles (k, 3, 3), and bounds that no point of each is nearer
        than; those above `wanted` need not be sharp.

        A distance changes by no more than the point moves. Where a triangle is all outside, its distance is the
        smallest of those to our triangles, and each of these is a convex function, so nowhere below its tangent."""
        centroid = corners.mean(axis=1)
        distance, _ = self.distance(centroid)
        arms = corners - centroid[:, None]
        radius = np.linalg.norm(arms, axis=2).max(axis=1)
        bound = distance - radius
        out = np.flatnonzero((bound > 0) & (bound < wanted))
        for some in _portions(out, 100 if len(self.triangles) > 2000 else 1000):
            mine = out[some]
            which, triangle = self._within(centroid[mine], distance[mine] + 2 * radius[mine])
            bary, apart = self._pairs(centroid[mine], which, triangle)
            offset = centroid[mine[which]] - np.einsum("kc,kci->ki", bary, self._corners[triangle])
            along = np.einsum("kci,ki->kc", arms[mine[which]], offset / np.maximum(apart, 1e-300)[:, None])
            tangent = np.full(len(mine), np.inf)
            np.minimum.at(tangent, which, apart + along.min(axis=1))
            bound[mine] = np.maximum(bound[mine], np.minimum(tangent, distance[mine]))
        return distance, bound

    def on(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the surface: the corners (k, 3) of their triangles, and their shares (k, 3) in these."""
        reach = np.abs(self.distance(points)[0]) * (1 + 1e-9) + 1e-12 * self.size
        triangle, bary, _ = self._nearest(points, reach)
        return self.triangles[triangle], bary

    def winding(self, points: np.ndarray) -> np.ndarray:
        """Numbers (k,) of times that the surface winds around each point: 1 inside, 0 outside."""
        return winding(self._corners, points)

    @cached_property
    def size(self) -> float:
        """Diagonal of the surface's box, mm."""
        return float(np.linalg.norm(np.ptp(self.vertices[np.unique(self.triangles)], axis=0)))

    @cached_property
    def _corners(self) -> np.ndarray:
        return self.vertices[self.triangles].astype(float)

    @cached_property
    def _vertex_tree(self) -> cKDTree:
        return cKDTree(self.vertices[np.unique(self.triangles)])

    @cached_property
    def _trees(self) -> list[tuple[np.ndarray, float, cKDTree]]:
        """Triangles by classes of radii, each with its largest radius and the tree of its centroids."""
        centroids = self._corners.mean(axis=1)
        radii = np.linalg.norm(self._corners - centroids[:, None], axis=2).max(axis=1)
        size_class = np.floor(np.log2(np.maximum(radii, 1e-6 * self.size))).astype(int)
        classes = [np.flatnonzero(size_class == number) for number in np.unique(size_class)]
        return [(mine, float(radii[mine].max()), cKDTree(centroids[mine])) for mine in classes]

    def _nearest(self, points: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nearest triangle (k,) of each point, barycentric coordinates (k, 3) there, and distance (k,)."""
        point, triangle = self._within(points, reach)
        bary, apart = self._pairs(points, point, triangle)
        order = np.lexsort((triangle, apart, point))
        best = order[np.searchsorted(point[order], np.arange(len(points)))]
        return triangle[best], bary[best], apart[best]

    def _within(self, points: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of points and of triangles, all pairs that may be within `reach` (k,) mm of each other, and more."""
        point, triangle = [], []
        for mine, radius, tree in self._trees:
            near = tree.query_ball_point(points, reach + radius * (1 + 1e-9), return_sorted=False)
            point.append(np.repeat(np.arange(len(points)), [len(numbers) for numbers in near]))
            triangle.append(mine[np.fromiter((i for numbers in near for i in numbers), dtype=int)])
        return np.concatenate(point), np.concatenate(triangle)

    def _pairs(self, points: np.ndarray, point: np.ndarray, triangle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Barycentric coordinates (c, 3) of the nearest points, and distances (c,), of pairs."""
        bary, apart = np.empty((len(point), 3)), np.empty(len(point))
        for some in _portions(point, PAIRS):
            bary[some], apart[some] = closest(self._corners[triangle[some]], points[point[some]])
        return bary, apart

    def _signed(
        self, points: np.ndarray, triangle: np.ndarray, bary: np.ndarray, apart: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Signed distances (k,) mm and normals (k, 3) of points whose nearest points lie in `triangle` at `bary`,
        `apart` mm away: the sign is that of the pseudonormal, or of the winding number where that is not known."""
        corners, zero = self._corners[triangle], bary == 0.0
        count = zero.sum(axis=1)
        part = np.choose(count, [0, 1 + zero.argmax(axis=1), 4 + (~zero).argmax(axis=1)])
        pseudo, known = self._normals[0][triangle, part], self._normals[1][triangle, part]
        offset = points - np.einsum("kc,kci->ki", bary, corners)
        across = np.einsum("ki,ki->k", offset, pseudo)
        sign = np.where(across < 0, -1.0, 1.0)
        if not known.all():
            sign[~known] = np.where(self.winding(points[~known]) > 0.5, -1.0, 1.0)
        face = known & (part == 0)
        distance = np.where(face, across, sign * apart)
        clear = ~face & (apart > ON * self.size)
        normal = np.where(clear[:, None], sign[:, None] * offset / np.where(clear, apart, 1.0)[:, None], pseudo)
        return distance, normal

    @cached_property
    def _normals(self) -> tuple[np.ndarray, np.ndarray]:
        """Unit normals (t, 7, 3) of each triangle's face, of its edges opposite to corners 0, 1, 2, and of its corners;
        (t, 7) whether all triangles that they are of have an area."""
        corners, triangles = self._corners, self.triangles
        sides = np.roll(corners, -1, axis=1) - corners
        normal = np.cross(sides[:, 0], sides[:, 1])
        area = np.linalg.norm(normal, axis=1)
        sound = area > FLAT * (sides**2).sum(axis=2).max(axis=1)
        normal = np.where(sound[:, None], normal / np.where(sound, area, 1.0)[:, None], 0.0)
        start, end = (nodes.ravel() for nodes in edges(triangles))  # of edges 01, 12, 20, opposite to corners 2, 0, 1
        base = int(triangles.max()) + 1
        order = np.argsort(start * base + end)
        twin = order[np.searchsorted((start * base + end)[order], end * base + start)] // 3
        twin = np.roll(twin.reshape(-1, 3), -1, axis=1)  # of the edge opposite to corners 0, 1, 2
        length = np.linalg.norm(sides, axis=2)
        before = -np.roll(sides, 1, axis=1)
        cosine = np.einsum("tci,tci->tc", sides, before) / np.maximum(length * np.roll(length, 1, axis=1), 1e-300)
        angle = np.arccos(np.clip(cosine, -1, 1))
        at_vertex, spoilt = np.zeros((base, 3)), np.zeros(base, dtype=bool)
        np.add.at(at_vertex, triangles, angle[..., None] * normal[:, None])
        spoilt[triangles[~sound]] = True
        parts = np.concatenate([normal[:, None], normal[:, None] + normal[twin], at_vertex[triangles]], axis=1)
        size = np.linalg.norm(parts, axis=2)
        sound_parts = np.concatenate([sound[:, None], sound[:, None] & sound[twin], ~spoilt[triangles]], axis=1)
        known = sound_parts & (size > 1e-9)
        unit = parts / np.maximum(size, 1e-300)[..., None]
        some = np.where(sound[:, None], normal, [1.0, 0.0, 0.0])[:, None]
        return np.where((size > 1e-9)[..., None], unit, some), known

    def _demand_closed(self) -> None:
        """Raises InputError where edges do not join exactly two triangles of opposite sense."""
        loose = unmatched_edges(self.triangles.astype(np.int64))
        if not len(loose):
            return
        rims = np.sort(np.column_stack([nodes.ravel() for nodes in edges(self.triangles)]), axis=1)
        rims, uses = np.unique(rims, axis=0, return_counts=True)
        if (uses == 1).any():
            loose = rims[uses == 1]
            what = f"is not closed: {counted(len(loose), 'edge belongs', 'edges belong')} to one triangle only"
        elif (uses > 2).any():
            loose = rims[uses > 2]
            what = f"branches: {counted(len(loose), 'edge belongs', 'edges belong')} to more than two triangles"
        else:
            what = f"is not oriented: at {counted(len(loose), 'edge')} the two triangles face opposite sides"
        start, end = (_shown(self.vertices[node]) for node in loose[0])
        what = f"closed mesh: the surface {what}, one of them from {start} to {end} mm"
        raise InputError(what, do="repair it in the program that made it")

    def _demand_outward(self) -> None:
        """Raises InputError unless every tried triangle has its outside on the side of its normal. In the middle of a
        triangle the others wind by 1/2, between 0 outside and 1 inside. Tried are the largest of each piece and some
        more."""
        count, piece = components(self.triangles)
        sides = np.roll(self._corners, -1, axis=1) - self._corners
        area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        order = np.lexsort((-area, piece))
        largest = order[np.searchsorted(piece[order], np.arange(count))]
        spread = np.linspace(0, len(area) - 1, min(TRIED, len(area))).astype(int)
        tried = np.union1d(largest, spread[area[spread] > FLAT * self.size**2])
        middle = self._corners[tried].mean(axis=1)
        own_angle = np.array(
            [solid_angles(self._corners[[number]] - point)[0] for number, point in zip(tried, middle, strict=True)]
        )
        around = np.round(self.winding(middle) - own_angle / (4 * np.pi), 6)
        if (around == -0.5).all():
            do = "turn its normals outward in the program that made it"
            raise InputError("closed mesh: the surface is turned inside out: its normals point inward", do=do)
        wrong = np.flatnonzero(around != 0.5)
        if len(wrong):
            what = (
                f"closed mesh: the surface overlaps itself, or a part is inside out, at {_shown(middle[wrong[0]])} mm"
            )
            raise InputError(what, do="unite its pieces, normals outward, in the program that made it")


def winding(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Numbers (k,) of times that closed surfaces, of triangles with corners (t, 3, 3), wind around points (k, 3)."""
    angles = np.empty(len(points))
    for some in _portions(points, max(1, PAIRS // len(corners))):
        apart = corners[None] - points[some][:, None, None]
        angles[some] = solid_angles(apart.reshape(-1, 3, 3)).reshape(-1, len(corners)).sum(axis=1)
    return angles / (4 * np.pi)


def _portions(items: np.ndarray, most: int) -> list[slice]:
    return [slice(start, start + most) for start in range(0, len(items), most)]


def _shown(point: np.ndarray) -> str:
    return f"({', '.join(f'{x:.6g}' for x in point)})"
