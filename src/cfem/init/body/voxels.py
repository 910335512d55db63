"""A body as a lattice of cubes: how far each lies from the wall, and how far along the body from what is held."""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from cfem.init.body.interior import Interior

_INSIDE = 30_000  # cubes inside the body, about
_PAIRS = 500_000  # of tetrahedra and cubes at a time
_PAD = 2
# Half of the 26 neighbours: each pair once.
_NEIGHBOURS = [offset for offset in product((-1, 0, 1), repeat=3) if offset > (0, 0, 0)]


@dataclass(frozen=True)
class Voxels:
    """low: (3,) mm, the middle of the first cube; step: mm; inside (a, b, c) bool."""

    low: np.ndarray
    step: float
    inside: np.ndarray

    @cached_property
    def depth(self) -> np.ndarray:
        """Distances (a, b, c) mm of the cubes from the wall, 0 outside."""
        return np.maximum(ndimage.distance_transform_edt(self.inside) - 0.5, 0) * self.step

    @cached_property
    def centres(self) -> np.ndarray:
        """Middles (k, 3) mm of the cubes inside."""
        return self.low + self.step * np.argwhere(self.inside)

    def depth_at(self, points: np.ndarray) -> np.ndarray:
        """Distances (k,) mm from the wall at points (k, 3) mm, to about the step."""
        places = (np.asarray(points) - self.low) / self.step
        return ndimage.map_coordinates(self.depth, places.T, order=1, mode="constant")

    @cached_property
    def graph(self) -> csr_array:
        """Distances (k, k) mm between the middles of cubes that touch, each pair once."""
        number = np.full(self.inside.shape, -1)
        number[self.inside] = np.arange(len(self.centres))
        rows, columns, lengths = [], [], []
        for offset in _NEIGHBOURS:
            cubes = tuple(slice(max(-o, 0), n - max(o, 0)) for o, n in zip(offset, self.inside.shape, strict=True))
            neighbours = tuple(slice(max(o, 0), n + min(o, 0)) for o, n in zip(offset, self.inside.shape, strict=True))
            pairs = (number[cubes] >= 0) & (number[neighbours] >= 0)
            rows.append(number[cubes][pairs])
            columns.append(number[neighbours][pairs])
            lengths.append(np.full(int(pairs.sum()), self.step * np.linalg.norm(offset)))
        k = len(self.centres)
        return coo_array(
            (np.concatenate(lengths), (np.concatenate(rows), np.concatenate(columns))), shape=(k, k)
        ).tocsr()

    def distances(self, held: np.ndarray) -> np.ndarray:
        """Distances (k,) mm from the cubes `held` (k,) bool through the body; infinite where nothing leads there."""
        return dijkstra(self.graph, directed=False, indices=np.flatnonzero(held), min_only=True)


def voxels(body: Interior, volume: float) -> Voxels:
    """Cubes inside a body of `volume` mm^3."""
    low, high = body.low.min(axis=0), body.high.max(axis=0)
    step = float(max((volume / _INSIDE) ** (1 / 3), (high - low).max() / 400))
    count = np.ceil((high - low) / step).astype(int) + 2 * _PAD
    first = (low + high) / 2 - step * (count - 1) / 2
    inside = np.zeros(count, dtype=bool)
    start = np.maximum(np.ceil((body.low - first) / step - 1e-9).astype(int), 0)
    end = np.minimum(np.floor((body.high - first) / step + 1e-9).astype(int) + 1, count)
    sizes = np.maximum(end - start, 0)
    counts = sizes.prod(axis=1)
    parts = np.flatnonzero(np.diff(np.cumsum(counts) // _PAIRS)) + 1
    for cells in np.split(np.arange(len(counts)), parts):
        owner = np.repeat(cells, counts[cells])
        position = np.arange(len(owner)) - np.repeat(np.cumsum(counts[cells]) - counts[cells], counts[cells])
        rest, z = np.divmod(position, sizes[owner, 2])
        cubes = start[owner] + np.stack([*np.divmod(rest, sizes[owner, 1]), z], axis=1)
        inner = np.einsum("kij,kj->ki", body.slope[owner], first + step * cubes) + body.shift[owner]
        within = (inner >= -1e-9).all(axis=1) & (inner.sum(axis=1) <= 1 + 1e-9)
        inside[tuple(cubes[within].T)] = True
    return Voxels(first, step, inside)
