"""Edges of a surface that are next to nothing beside those around them, as where two faces of a CAD model nearly meet:
cells at them would be needles. Each is contracted to the end of it that leaves the surface nearest to what it was."""

from collections import defaultdict

import numpy as np

from cfem.contact.surface.triangles import normals_of

_NOTHING = 0.003  # of the largest extent
_BESIDE = 0.1  # of the median of the edges around it
_TURN = 0.5  # least cosine between the normals of a triangle before and after
_FACING = 0.7  # cosine between an edge and a normal: the edge leads through a thin wall or slot from face to face


def without_short_edges(X: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, int]:
    """Triangles (k, 3) of the nodes X (n, 3) of a closed surface (m, 3), the shortest edges contracted first; and how
    many were. An edge stays where it leads through a thin wall or slot, and where the surface would fold or pinch."""
    surface = _Surface(X, triangles)
    ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    ends = np.unique(ends, axis=0)
    lengths = np.linalg.norm(X[ends[:, 0]] - X[ends[:, 1]], axis=1)
    short = np.flatnonzero(lengths < _NOTHING * np.ptp(X[triangles].reshape(-1, 3), axis=0).max())
    merged_into = np.arange(len(X))
    contracted = 0
    for index in short[np.argsort(lengths[short], kind="stable")].tolist():
        a, b = (_last(merged_into, int(node)) for node in ends[index])
        if a == b or not surface.is_short(a, b) or surface.leads_through(a, b):
            continue
        for kept, dropped in sorted(((a, b), (b, a)), key=lambda pair: surface.quadric_error(*pair)):
            if surface.can_contract(kept, dropped):
                surface.contract(kept, dropped)
                merged_into[dropped], contracted = kept, contracted + 1
                break
    return np.array(list(surface.triangles.values())), contracted


def _last(merged_into: np.ndarray, node: int) -> int:
    """The node that a node has become."""
    while merged_into[node] != node:
        node = int(merged_into[node])
    return node


class _Surface:
    """Triangles by number, and the numbers of those around each node."""

    def __init__(self, X: np.ndarray, triangles: np.ndarray):
        self.X = X
        self.triangles = {number: tuple(corners) for number, corners in enumerate(triangles.tolist())}
        self.around: dict[int, set[int]] = defaultdict(set)
        for number, corners in self.triangles.items():
            for node in corners:
                self.around[node].add(number)

    def neighbours(self, node: int) -> set[int]:
        """Nodes that share an edge with a node."""
        return {corner for number in self.around[node] for corner in self.triangles[number]} - {node}

    def is_short(self, a: int, b: int) -> bool:
        """True if the edge from a to b is next to nothing beside the others at its ends."""
        beside = [np.linalg.norm(self.X[end] - self.X[node]) for end in (a, b) for node in self.neighbours(end)]
        return bool(np.linalg.norm(self.X[a] - self.X[b]) < _BESIDE * np.median(beside))

    def leads_through(self, a: int, b: int) -> bool:
        """True if the edge joins two sides of a thin wall or slot: a face at one end looks along it, one at the other
        end against it."""
        along = (self.X[b] - self.X[a]) / np.linalg.norm(self.X[b] - self.X[a])
        first, second = (self._normals(self.around[node], {})[0] @ along for node in (a, b))
        wall = first.min() < -_FACING and second.max() > _FACING
        return bool(wall or (first.max() > _FACING and second.min() < -_FACING))

    def quadric_error(self, kept: int, dropped: int) -> float:
        """Quadric error mm^2 (Garland and Heckbert 1997): squared distances of `kept` from the faces around
        `dropped`."""
        normals, _ = self._normals(self.around[dropped], {})
        return float(((normals @ (self.X[kept] - self.X[dropped])) ** 2).sum())

    def can_contract(self, kept: int, dropped: int) -> bool:
        """True if the surface stays closed, with no triangle turned over."""
        shared = self.neighbours(kept) & self.neighbours(dropped)
        between = self.around[kept] & self.around[dropped]
        if len(shared) != 2 or len(between) != 2:
            return False
        stay = self.around[dropped] - between
        before, _ = self._normals(stay, {})
        after, size = self._normals(stay, {dropped: kept})
        return bool((size > 0).all() and ((before * after).sum(axis=1) > _TURN).all())

    def contract(self, kept: int, dropped: int) -> None:
        """Moves all triangles of `dropped` to `kept`."""
        for number in self.around.pop(dropped):
            corners = tuple(kept if node == dropped else node for node in self.triangles[number])
            if len(set(corners)) == 3:
                self.triangles[number] = corners
                self.around[kept].add(number)
                continue
            for node in self.triangles.pop(number):
                if node != dropped:
                    self.around[node].discard(number)

    def _normals(self, numbers: set[int], moved: dict[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Unit normals (k, 3) of triangles, and twice their areas (k,), a node that moved being where it went."""
        corners = [[moved.get(node, node) for node in self.triangles[number]] for number in sorted(numbers)]
        normal = normals_of(self.X[corners])
        size = np.linalg.norm(normal, axis=1)
        return normal / np.maximum(size, np.finfo(float).tiny)[:, None], size
