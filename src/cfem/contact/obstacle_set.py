"""Several obstacles as one: each point meets the nearest.

Rounded boxes, which all but closed meshes are, are asked together."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cfem.contact import rounded_boxes
from cfem.contact.obstacle import Obstacle, Rounded


@dataclass(frozen=True, eq=False)
class ObstacleSet:
    """Obstacles (n,) of which no two share a point."""

    obstacles: tuple[Obstacle, ...]

    @classmethod
    def of(cls, obstacles: "Sequence[Obstacle] | ObstacleSet") -> "ObstacleSet":
        return obstacles if isinstance(obstacles, cls) else cls(tuple(obstacles))

    def nearest(self, points: np.ndarray, farthest: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """(N,) mm distance of points (N, 3) mm to the nearest obstacle, and (N,) its number; `farthest` mm and any
        number where none is as near as that."""
        distance, place = rounded_boxes.nearest(self._boxes, np.ascontiguousarray(points, float), float(farthest))
        which = self._round[place] if len(self._round) else place
        for number in self._others:
            candidate = self.obstacles[number].distance(points)
            nearer = candidate < distance
            distance[nearer], which[nearer] = candidate[nearer], number
        return distance, which

    def frames(self, which: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(c, 3, 3) rows n, t1, t2 of the obstacles `which` (c,) at points (c, 3) mm."""
        frames = np.empty((len(points), 3, 3))
        for mine, place in self._groups(which):
            if place is None:
                frames[mine] = self.obstacles[which[mine][0]].frames(points[mine])
            else:
                frames[mine] = rounded_boxes.frames(self._boxes, place, np.ascontiguousarray(points[mine], float))
        return frames

    def moved(self, bodies: np.ndarray, R: np.ndarray, t: np.ndarray) -> "ObstacleSet":
        """The obstacles after motions x -> R x + t, R (b, 3, 3) and t (b, 3) mm, of the bodies (n,) to which they are
        fixed; -1: of none."""
        return ObstacleSet(
            tuple(
                obstacle if body < 0 else obstacle.posed(R[body] @ obstacle.R, R[body] @ obstacle.t + t[body])
                for obstacle, body in zip(self.obstacles, bodies.tolist(), strict=True)
            )
        )

    @cached_property
    def curved(self) -> bool:
        """True where any obstacle has a curvature that `bends` knows."""
        return bool(self._boxes.rounding.any()) or any(self.obstacles[i].curved for i in self._others)

    def bends(self, which: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(c, 3, 3) 1/mm: derivative of the normal by the place. 0 on flat faces, and at edges, where there is none."""
        slopes = np.zeros((len(points), 3, 3))
        for mine, place in self._groups(which):
            if place is None:
                slopes[mine] = self.obstacles[which[mine][0]].bends(points[mine])
            else:
                slopes[mine] = rounded_boxes.bends(self._boxes, place, np.ascontiguousarray(points[mine], float))
        return slopes

    def _groups(self, which: np.ndarray) -> list[tuple[np.ndarray | slice, np.ndarray | None]]:
        """Points that are asked together, and which rounded boxes (c,) they meet, None for a point's own obstacle."""
        if not len(self._others):
            return [(slice(None), self._place[which])] if len(which) else []
        mine = np.flatnonzero(self._place[which] >= 0)
        groups = [(mine, self._place[which[mine]])] if len(mine) else []
        alone = [np.flatnonzero(which == number) for number in self._others]
        return groups + [(points, None) for points in alone if len(points)]

    @cached_property
    def _round(self) -> np.ndarray:
        """Numbers of the rounded boxes."""
        return np.array(
            [i for i, obstacle in enumerate(self.obstacles) if isinstance(obstacle, Rounded)], dtype=np.int64
        )

    @cached_property
    def _others(self) -> np.ndarray:
        rounded_ones = set(self._round.tolist())
        return np.array([i for i in range(len(self.obstacles)) if i not in rounded_ones], dtype=np.int64)

    @cached_property
    def _place(self) -> np.ndarray:
        """(n,) of each obstacle among the rounded boxes, -1 of others."""
        place = np.full(len(self.obstacles), -1)
        place[self._round] = np.arange(len(self._round))
        return place

    @cached_property
    def _boxes(self) -> rounded_boxes.Boxes:
        return rounded_boxes.Boxes.of([self.obstacles[i] for i in self._round])
