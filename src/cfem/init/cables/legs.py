"""Cables along the legs of a body that joins what is held to its tip in several ways, as parallel robots do."""

from itertools import pairwise

import numpy as np
from scipy import ndimage
from scipy.sparse.csgraph import dijkstra

from cfem.init.body.section import clear
from cfem.init.body.shape import Shape
from cfem.init.cables.centreline import held_cubes
from cfem.init.cables.line import CableLine, make_line
from cfem.init.hold import Run

_SMALL, _MOST = 0.15, 8  # of the largest leg; legs
_TOP = 0.9  # share of the way that a cable goes
_BETWEEN = np.linspace(0, 1, 8)
_OUTWARD = np.linspace(1, 0, 9)  # shares of the depth by which a cable lies nearer to the outer side
_SHRINK, _TRIES = 0.7, 5  # of the attachment radius, where a leg is too thin or too bent for it


def cables_in_legs(shape: Shape, run: Run) -> tuple[tuple[CableLine, ...], float] | None:
    """One along each leg, and the attachment radius, mm; None where there is no room."""
    cubes = shape.voxels
    distance = cubes.distances(held_cubes(cubes, run))
    distance[~np.isfinite(distance)] = 0.0
    length, number = float(distance.max()), np.full(cubes.inside.shape, -1)
    number[cubes.inside] = np.arange(len(distance))
    field = np.full(cubes.inside.shape, -1.0)
    field[cubes.inside] = distance
    label, count = ndimage.label(np.abs(field - 0.5 * length) <= 1.5 * cubes.step, np.ones((3, 3, 3)))
    sizes = np.bincount(label.ravel(), minlength=count + 1)[1:]
    legs = 1 + np.flatnonzero(sizes > _SMALL * sizes.max()) if count else []
    if not 1 < len(legs) <= _MOST:
        return None
    depth = cubes.depth[cubes.inside]
    radius = float(min(run.length / 40, min(cubes.depth[label == leg].max() for leg in legs) / 2))
    graph = cubes.graph.copy()  # ways near the wall count as long
    graph.data = graph.data * (0.5 * depth.max() / np.maximum(depth[graph.indices], 0.25 * cubes.step)) ** 2
    axis, paths = cubes.centres.mean(axis=0), []
    for leg in legs:
        inside = np.where(label == leg, cubes.depth, -1.0)
        start = number[np.unravel_index(inside.argmax(), inside.shape)]
        apart, before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
        low = np.flatnonzero(distance <= cubes.step)
        high = np.flatnonzero(distance >= _TOP * length)
        path = _path(before, low[apart[low].argmin()])[::-1][:-1] + _path(before, high[apart[high].argmin()])
        paths.append(cubes.centres[path[::-1] if distance[path[0]] > distance[path[-1]] else path])
    for smaller in radius * _SHRINK ** np.arange(_TRIES):
        lines = []
        for path in paths:
            places = _simple(shape, path, axis, float(smaller))
            if places is None:
                break
            lines.append(make_line(f"cable-{len(lines) + 1}", places, run, None))
        if len(lines) == len(paths):
            return tuple(lines), float(smaller)
    return None


def _path(before: np.ndarray, end: int) -> list[int]:
    """Nodes of the path from the source of the search to `end`."""
    path = [int(end)]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return path[::-1]


def _simple(shape: Shape, path: np.ndarray, axis: np.ndarray, radius: float) -> np.ndarray | None:
    """Few points (k, 3) mm near a path (m, 3), as far from `axis` (3,) as there is room, straight lines inside."""
    path = ndimage.gaussian_filter1d(path, 2.0, axis=0, mode="nearest")
    tangents = np.gradient(path, axis=0)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1), 1e-12)[:, None]
    away = path - axis
    away -= (away * tangents).sum(axis=1)[:, None] * tangents
    away /= np.maximum(np.linalg.norm(away, axis=1), 1e-12)[:, None]
    room = np.maximum(shape.voxels.depth_at(path) - 1.2 * radius, 0)
    for share in _OUTWARD:
        moved = path + share * ndimage.minimum_filter1d(room, 5)[:, None] * away
        for count in (5, 7, 10, 14):
            points = moved[np.linspace(0, len(path) - 1, count).astype(int)]
            between = np.concatenate([a + _BETWEEN[:, None] * (b - a) for a, b in pairwise(points)])
            inner = between[len(_BETWEEN) // 2 :]  # the first half segment leads out of the base
            if clear(shape.interior, inner, 0.6 * radius).all():
                return points
    return None
