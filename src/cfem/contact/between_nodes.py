"""Where a rigid obstacle meets a surface of triangles between its nodes: within a facet, or on an edge of the mesh.

An obstacle is the points within r of its core: a point, a segment or a box (`cfem.contact.rounded_boxes`). At a facet
with the outward unit normal N, and at an edge of the mesh, the gap is that of the nearest features of core and surface,

    facet and corner y of the core:             gap = N . (y - p) - r       p: y's foot in the facet
    edge and corner y, where r > 0:             gap = |y - p| - r           p: y's foot on the edge
    edge and edge of the core:                  gap = n . (y - p) - r       p, y: nearest points, n across both

with n outward of the surface, among the normals of the facets beside the edge, and -n among those of the core there
(Ericson, *Real-Time Collision Detection*, 2005, sections 5.1 and 9.3). A corner of a box, where r = 0, presses in one
place: N turns between the normals of the surface around the nodes of the facet, so that it does not jump as the corner
slides from facet to facet. A force on p acts on the nodes beside it by their barycentric coordinates, so that it has
the same moment. Nodes meet the faces of an obstacle (`cfem.contact.obstacle_set`), and of a box those that they face.
"""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numba import njit

from cfem.contact.rounded_boxes import Boxes, local_distance
from cfem.contact.touching_facets import Facets, facet_normal, smooth_normals

CORNERS = 8  # of a core
STEEP = 0.3  # sine of the angle by which the normal of an obstacle may be beyond those of a node
TILT = 0.05  # sine of the angle by which a normal may be beyond those of a feature
DEEPEST = 0.7  # of a facet's size: a corner or an edge that is deeper has not come in there, nor a ball's middle
ALIKE = 0.7  # product of normals: less is another side of the surface, of which a corner meets the nearer
BESIDE = 0.02  # of a facet or an edge: how far a corner may be beside it, or from a node what is at the node
SAG = 0.004  # of an edge: an obstacle that comes less far between nodes meets these alone
PARALLEL = 0.05  # sine of the angle between edges that have no point nearest to each other


class Touching(NamedTuple):
    """Points p of a surface between its nodes, nearest to an obstacle there.

    features: (p,) number of the facet; after all facets of the edge, and after these of the corner of a box
    nodes, shares: (p, 3) nodes beside p, and barycentric coordinates, 0 of the third at an edge
    normals: (p, 3) outward of the obstacle
    gaps: (p,) mm
    obstacles: (p,) which box"""

    features: np.ndarray
    nodes: np.ndarray
    shares: np.ndarray
    normals: np.ndarray
    gaps: np.ndarray
    obstacles: np.ndarray


def between_nodes(
    places: np.ndarray, facets: Facets, boxes: Boxes, within: float, kept: Collection[int] = ()
) -> Touching:
    """Points between nodes at places (N, 3) mm that touch, or are nearer than `within` mm: of each facet and edge the
    deepest one, where obstacles come clearly deeper there than at the nodes; of features `kept` also where they do
    not."""
    if boxes.below.all():  # walls meet nodes alone
        nothing = np.zeros(0, dtype=np.int64)
        return Touching(nothing, np.zeros((0, 3), dtype=np.int64), *np.zeros((2, 0, 3)), np.zeros(0), nothing)
    marked = np.zeros(features_of(facets, len(boxes.t)), dtype=np.bool_)
    marked[list(kept)] = True
    return Touching(*_between(places, facets, boxes, within, marked))


def features_of(facets: Facets, boxes: int) -> int:
    """Number of facets, edges, and corners of boxes."""
    return len(facets.triangles) + len(facets.edges) + CORNERS * boxes


def facing(places: np.ndarray, facets: Facets, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Mask (c,) of the points (c,) whose surface faces an obstacle with outward normals (c, 3): no facet beside a point
    is so steep that this facet, or an edge of it, is nearer to the obstacle."""
    return _facing(places, facets, points, normals)


@njit(cache=True, error_model="numpy")
def _facing(places, facets, points, normals):
    """`facing`, compiled."""
    faces = np.ones(len(points), dtype=np.bool_)
    for c in range(len(points)):
        i = points[c]
        for k in range(facets.first[i], facets.first[i + 1]):
            j, along, square = facets.beside[k], 0.0, 0.0
            for a in range(3):
                edge = places[j, a] - places[i, a]
                along -= normals[c, a] * edge
                square += edge * edge
            if along > STEEP * np.sqrt(square):
                faces[c] = False
    return faces


class _Deepest(NamedTuple):
    """What is known of each feature, of n in all.

    gap: (n,) mm, infinite where it is not near
    shares: (n, 3) barycentric coordinates; normals: (n, 3) outward of the surface, in the axes of the box
    which: (n,) box; on: (n,) facet on which a corner is; inside: (n,) its least share there"""

    gap: np.ndarray
    shares: np.ndarray
    normals: np.ndarray
    which: np.ndarray
    on: np.ndarray
    inside: np.ndarray


@njit(cache=True, error_model="numpy")
def _between(places, facets, boxes, within, kept):
    """Fields of `Touching`; kept: (n,) bool of all features."""
    count, edges, n = len(facets.triangles), len(facets.edges), len(kept)
    numbers, smooth, local = np.empty((2, n), dtype=np.int64), np.empty((0, 3)), np.empty(places.shape)
    if (boxes.rounding == 0).any():
        smooth = smooth_normals(places, facets)
    deepest = _Deepest(np.full(n, np.inf), np.empty((n, 3)), np.empty((n, 3)), numbers[0], numbers[1], np.empty(n))
    near, size, normals = np.empty(count, dtype=np.bool_), np.empty(count), np.empty((count, 3))
    x, turned, core = np.empty((4, 3)), np.empty((3, 3)), np.empty(3)
    for o in range(len(boxes.t)):
        if boxes.below[o]:
            continue
        core[:], r = boxes.core[o], boxes.rounding[o]
        for i in range(len(places)):
            _into(places[i], boxes, o, local[i])
        for f in range(count):
            for c in range(3):
                x[c] = local[facets.triangles[f, c]]
            near[f], size[f] = _reaches(x, core, r + within)
            if not near[f]:
                continue
            facet_normal(x, normals[f])
            limits = -max(DEEPEST * size[f], r), within
            if r > 0:
                _corners_on_facet(f, o, x, normals[f], core, r, limits, deepest)
                continue
            for c in range(3):
                for i in range(3):
                    turned[c, i] = 0.0
                    for a in range(3):
                        turned[c, i] += smooth[facets.smooth[f, c], a] * boxes.R[o, a, i]
            _corners_on_smooth(count + edges + CORNERS * o, f, o, x, turned, core, limits, deepest)
        for e in range(edges):
            f, g = facets.sides[e]
            if near[f] and near[g]:
                for c in range(2):
                    x[c], x[2 + c] = local[facets.edges[e, c]], local[facets.opposite[e, c]]
                limits = -max(DEEPEST * min(size[f], size[g]), r), within
                _on_edge(count + e, o, x, normals[f] + normals[g], core, r, limits, deepest)
    return _chosen(places, facets, boxes, kept, deepest)


@njit(cache=True, error_model="numpy")
def _chosen(places, facets, boxes, kept, deepest):
    """Fields of `Touching`: features that are near, of those around a node that an edge of a box leads past the first
    alone, as all say the same; of round obstacles those where it comes farther between nodes than SAG, or that are
    kept."""
    count, edges, features = len(facets.triangles), len(facets.edges), np.flatnonzero(deepest.gap < np.inf)
    nodes, chosen = np.empty((len(features), 3), dtype=np.int64), np.zeros(len(features), dtype=np.bool_)
    normals, past, unused = np.zeros((len(features), 3)), np.full(len(places), -1), np.empty(3)
    for p in range(len(features)):
        feature = features[p]
        shares, o = deepest.shares[feature], deepest.which[feature]
        if count <= feature < count + edges:
            nodes[p, :2] = facets.edges[feature - count]
            nodes[p, 2] = nodes[p, 1]
            nearer = nodes[p, 0] if shares[0] > 0.5 else nodes[p, 1]
            if max(shares[0], shares[1]) > 1 - BESIDE:
                if past[nearer] == o:
                    continue
                past[nearer] = o
        else:
            nodes[p] = facets.triangles[feature if feature < count else deepest.on[feature]]
        sag, square = -deepest.gap[feature], 0.0
        for c in range(3):
            sag += shares[c] * local_distance(boxes, o, places[nodes[p, c]], unused)
        for a in range(3):
            square += (places[nodes[p, 0], a] - places[nodes[p, 1], a]) ** 2
            for i in range(3):
                normals[p, a] -= boxes.R[o, a, i] * deepest.normals[feature, i]
        chosen[p] = boxes.rounding[o] == 0 or kept[feature] or sag > SAG * np.sqrt(square)
    features = features[chosen]
    return (
        *(features, nodes[chosen], deepest.shares[features], normals[chosen]),
        *(deepest.gap[features], deepest.which[features]),
    )


@njit(cache=True, error_model="numpy")
def _into(point, boxes, o, x):
    """Puts a point (3,) mm in the axes of box o into x (3,)."""
    for i in range(3):
        x[i] = 0.0
        for a in range(3):
            x[i] += (point[a] - boxes.t[o, a]) * boxes.R[o, a, i]


@njit(cache=True, error_model="numpy")
def _reaches(x, core, away):
    """True where a triangle x (3, 3) mm may be nearer to the core than `away` mm; how far, mm, its corners are from its
    middle."""
    square, largest, middle = 0.0, 0.0, np.empty(3)
    for i in range(3):
        middle[i] = (x[0, i] + x[1, i] + x[2, i]) / 3
        square += max(abs(middle[i]) - core[i], 0.0) ** 2
    for c in range(3):
        radius = 0.0
        for i in range(3):
            radius += (x[c, i] - middle[i]) ** 2
        largest = max(largest, radius)
    size = np.sqrt(largest)
    return np.sqrt(square) <= away + size, size


@njit(cache=True, error_model="numpy")
def _dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@njit(cache=True, error_model="numpy")
def _of_core(n, corner, core, free):
    """True where -n is among the outward normals of the core at a corner (3,) of signs; along the axis `free` there is
    an edge instead (-1: none)."""
    among = True
    for i in range(3):
        among &= i == free or core[i] == 0 or -n[i] * corner[i] >= -TILT
    return among


@njit(cache=True, error_model="numpy")
def _corner(core, number, free, from_, corner, y):
    """Puts the signs of corner `number` of a core into corner (3,), and where it lies from a point `from_` (3,) mm on
    into y (3,). False where it is another one again: the core has no extent along an axis, or there is an edge along
    the axis `free`."""
    for i in range(3):
        above = (number >> i) & 1
        if (core[i] == 0 or i == free) and above:
            return False
        corner[i] = 2.0 * above - 1.0
        y[i] = corner[i] * core[i] - from_[i]
    return True


@njit(cache=True, error_model="numpy")
def _keep(feature, o, gap, share, n, limits, deepest):
    """Keeps a point, with the normal n (3,), whose gap is smaller than what is known of its feature."""
    if limits[0] < gap < limits[1] and gap < deepest.gap[feature]:
        deepest.gap[feature], deepest.which[feature] = gap, o
        for a in range(3):
            deepest.shares[feature, a], deepest.normals[feature, a] = share[a], n[a]


@njit(cache=True, error_model="numpy")
def _foot(x, y, share):
    """Puts into share (3,) the barycentric coordinates of the foot of y (3,), from the first corner of a triangle x."""
    u, v = x[1] - x[0], x[2] - x[0]
    uu, uv, vv, yu, yv = _dot(u, u), _dot(u, v), _dot(v, v), _dot(y, u), _dot(y, v)
    area = uu * vv - uv * uv
    share[1], share[2] = (yu * vv - yv * uv) / area, (yv * uu - yu * uv) / area
    share[0] = 1.0 - share[1] - share[2]


@njit(cache=True, error_model="numpy")
def _corners_on_facet(f, o, x, n, core, r, limits, deepest):
    """Corners of a round core on a facet x (3, 3) mm with the normal n (3,)."""
    y, corner, share = np.empty(3), np.empty(3), np.empty(3)
    for number in range(CORNERS):
        if _corner(core, number, -1, x[0], corner, y) and _of_core(n, corner, core, -1):
            _foot(x, y, share)
            if min(share[0], share[1], share[2]) >= 0:
                _keep(f, o, _dot(n, y) - r, share, n, limits, deepest)


@njit(cache=True, error_model="numpy")
def _corners_on_smooth(first, f, o, x, normals, core, limits, deepest):
    """Corners of a box, whose features begin at `first`, on a facet x (3, 3) mm with normals (3, 3) at its nodes. Of
    several facets a corner meets that in which it is farthest inside; of those on several sides of a sharp edge that
    in which it is least deep."""
    y, corner, share, n = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for number in range(CORNERS):
        if not _corner(core, number, -1, x[0], corner, y):
            continue
        _foot(x, y, share)
        inside, gap = min(share[0], share[1], share[2]), 0.0
        if inside < -BESIDE:
            continue
        for c in range(3):
            share[c] = max(share[c], 0.0)
        share /= share[0] + share[1] + share[2]
        for i in range(3):
            n[i] = share[0] * normals[0, i] + share[1] * normals[1, i] + share[2] * normals[2, i]
        n /= np.sqrt(_dot(n, n))
        for i in range(3):
            gap += n[i] * (y[i] - share[1] * (x[1, i] - x[0, i]) - share[2] * (x[2, i] - x[0, i]))
        feature = first + number
        if not (limits[0] < gap < limits[1] and _of_core(n, corner, core, -1)):
            continue
        if deepest.gap[feature] < np.inf:
            same_side = _dot(deepest.normals[feature], n) > ALIKE
            if (inside <= deepest.inside[feature]) if same_side else (gap <= deepest.gap[feature]):
                continue
        deepest.gap[feature], deepest.inside[feature], deepest.on[feature] = np.inf, inside, f
        _keep(feature, o, gap, share, n, limits, deepest)


@njit(cache=True, error_model="numpy")
def _on_edge(feature, o, x, out, core, r, limits, deepest):
    """Corners of a round core, and edges of any, on an edge of the mesh from x[0] to x[1]; x[2] and x[3] (3,) mm: the
    corners of the facets beside it; out (3,): outward."""
    n, y, corner, share, to = np.empty(3), np.empty(3), np.empty(3), np.zeros(3), x[1] - x[0]
    left, right, long = np.empty(3), np.empty(3), _dot(to, to)
    _leaving(x, to, 2, left)
    _leaving(x, to, 3, right)
    for number in range(CORNERS if r > 0 else 0):
        if _corner(core, number, -1, x[0], corner, y):
            along = _dot(y, to) / long
            away = _towards(y - along * to, out, n)
            share[0], share[1] = 1 - along, along
            if 0 < along < 1 and _beside(n, left, right) and _of_core(n, corner, core, -1):
                _keep(feature, o, away - r, share, n, limits, deepest)
    for axis in range(3):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        across = to[b] ** 2 + to[c] ** 2
        for number in range(CORNERS if core[axis] > 0 and across > PARALLEL**2 * long else 0):
            if not _corner(core, number, axis, x[0], corner, y):
                continue
            # in the plane across the core's edge this is a point, and the edge of the mesh a line
            along = (y[b] * to[b] + y[c] * to[c]) / across
            if r == 0 and abs(along - 0.5) < 0.5 + BESIDE:  # nodes meet no sharp edges by themselves
                along = min(max(along, 0.0), 1.0)
            elif not 0 < along < 1:
                continue
            normal = np.zeros(3)
            normal[b], normal[c] = -to[c], to[b]
            _towards(normal, out, n)
            share[0], share[1] = 1 - along, along
            meets = abs(x[0, axis] + along * to[axis]) < core[axis]
            if meets and _beside(n, left, right) and _of_core(n, corner, core, axis):
                _keep(feature, o, n[b] * y[b] + n[c] * y[c] - r, share, n, limits, deepest)


@njit(cache=True, error_model="numpy")
def _towards(vector, out, n):
    """Puts the unit direction of a vector (3,) mm into n (3,), or its opposite, which of both is along out (3,). The
    size, mm, negative where it is the opposite."""
    size = np.sqrt(_dot(vector, vector))
    if _dot(vector, out) < 0:
        size = -size
    for i in range(3):
        n[i] = vector[i] / size
    return size


@njit(cache=True, error_model="numpy")
def _beside(n, left, right):
    """True where n (3,) is among the normals of an edge that its facets leave along left and right (3,)."""
    return _dot(n, left) <= TILT and _dot(n, right) <= TILT


@njit(cache=True, error_model="numpy")
def _leaving(x, to, third, direction):
    """Puts into direction (3,) the unit vector along which the facet with the corner x[third] leaves an edge `to`."""
    for i in range(3):
        direction[i] = x[third, i] - x[0, i]
    along = _dot(direction, to) / _dot(to, to)
    for i in range(3):
        direction[i] -= along * to[i]
    direction /= np.sqrt(_dot(direction, direction))
