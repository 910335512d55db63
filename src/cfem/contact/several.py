"""Several obstacles as one: each point meets the nearest.

Rounded boxes, which all but closed meshes are, are asked together."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cfem.contact.obstacle import AXES, Obstacle, Rounded, excess_of, rounded, tangents


@dataclass(frozen=True, eq=False)
class Several:
    """obstacles (n,): none is a point of two of them."""

    obstacles: tuple[Obstacle, ...]

    @classmethod
    def of(cls, obstacles: "Sequence[Obstacle] | Several") -> "Several":
        return obstacles if isinstance(obstacles, cls) else cls(tuple(obstacles))

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N,) mm distance of points (N, 3) mm to the nearest obstacle, and (N,) its number."""
        distances = np.empty((len(self.obstacles), len(points)))
        if len(self._round):
            s = (self._axes @ points.T - self._at).reshape(3, -1, len(points))
            x, y, z = excess_of(s, self._core.T[:, :, None], self._below.T[:, :, None])
            deep = np.minimum(np.maximum(np.maximum(x, y), z), 0.0)
            x, y, z = np.maximum(x, 0.0), np.maximum(y, 0.0), np.maximum(z, 0.0)
            distances[self._round] = np.sqrt(x * x + y * y + z * z) + deep - self._rounding[:, None]
        for number in self._others:
            distances[number] = self.obstacles[number].distance(points)
        if len(distances) == 1:
            return distances[0], np.zeros(len(points), dtype=np.int64)
        which = distances.argmin(axis=0)
        return distances[which, np.arange(len(points))], which

    def frames(self, which: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(c, 3, 3) rows n, t1, t2 of the obstacles `which` (c,) at points (c, 3) mm."""
        found = np.empty((len(points), 3, 3))
        for mine, place in self._groups(which):
            if place is None:
                found[mine] = self.obstacles[which[mine][0]].frames(points[mine])
            else:
                R = self._R[place]
                found[mine] = tangents(self._local(place, points[mine])[1]) @ R.swapaxes(1, 2)
        return found

    def bends(self, which: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(c, 3, 3) 1/mm: derivative of the normal by the place. 0 on flat faces, and at edges, where there is none."""
        found = np.zeros((len(points), 3, 3))
        for mine, place in self._groups(which):
            if place is None or not self._rounding[place].any():
                continue
            R, rounding = self._R[place], self._rounding[place]
            distance, normal = self._local(place, points[mine])
            away = distance + rounding
            curved = (rounding > 0) & (away > 0)
            across = (normal[:, :, None] != 0) * AXES - normal[:, :, None] * normal[:, None]
            own = across * (curved / np.where(curved, away, 1.0))[:, None, None]
            found[mine] = R @ own @ R.swapaxes(1, 2)
        return found

    def _groups(self, which: np.ndarray) -> list[tuple[np.ndarray | slice, np.ndarray | None]]:
        """Points that are asked together, and which rounded boxes (c,) they meet, None for a point's own obstacle."""
        if not len(self._others):
            return [(slice(None), self._place[which])] if len(which) else []
        mine = np.flatnonzero(self._place[which] >= 0)
        found = [(mine, self._place[which[mine]])] if len(mine) else []
        alone = [np.flatnonzero(which == number) for number in self._others]
        return found + [(one, None) for one in alone if len(one)]

    def _local(self, place: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        s = ((points - self._t[place])[:, None] @ self._R[place])[:, 0]
        return rounded(s, self._core[place], self._rounding[place], self._below[place])

    @cached_property
    def _round(self) -> np.ndarray:
        """Numbers of the rounded boxes."""
        return np.array([i for i, one in enumerate(self.obstacles) if isinstance(one, Rounded)], dtype=np.int64)

    @cached_property
    def _others(self) -> np.ndarray:
        rounded_ones = set(self._round.tolist())
        return np.array([i for i in range(len(self.obstacles)) if i not in rounded_ones], dtype=np.int64)

    @cached_property
    def _place(self) -> np.ndarray:
        """(n,) of each obstacle among the rounded boxes, -1 of others."""
        found = np.full(len(self.obstacles), -1)
        found[self._round] = np.arange(len(self._round))
        return found

    @cached_property
    def _R(self) -> np.ndarray:
        return np.array([self.obstacles[i].R for i in self._round])

    @cached_property
    def _t(self) -> np.ndarray:
        return np.array([self.obstacles[i].t for i in self._round])

    @cached_property
    def _core(self) -> np.ndarray:
        return np.array([self.obstacles[i].core for i in self._round])

    @cached_property
    def _rounding(self) -> np.ndarray:
        return np.array([self.obstacles[i].rounding for i in self._round])

    @cached_property
    def _below(self) -> np.ndarray:
        """(n, 3): along which axes a coordinate counts without its sign taken off: those of half spaces."""
        return np.repeat(np.isinf(self._core[:, :1]), 3, axis=1)

    @cached_property
    def _axes(self) -> np.ndarray:
        """(3 n, 3) own axes of all: x of each, then y, then z."""
        return self._R.transpose(2, 0, 1).reshape(-1, 3)

    @cached_property
    def _at(self) -> np.ndarray:
        """(3 n, 1) their places along these."""
        return (self._t[:, None] @ self._R)[:, 0].T.reshape(-1, 1)
