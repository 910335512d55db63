"""Several obstacles as one: each point meets the nearest.

Rounded boxes, which all but closed meshes are, are asked together."""

from collections.abc import Collection, Sequence
from functools import cached_property

import numpy as np

from cfem.contact import rounded_boxes
from cfem.contact.between_nodes import Touching, between_nodes, facing
from cfem.contact.obstacle import Box, Obstacle, Rounded
from cfem.contact.touching_facets import Facets


class ObstacleSet:
    """Obstacles (n,) of which no two share a point.

    R, t: (n, 3, 3) and (n, 3) mm, their poses"""

    def __init__(self, obstacles: Sequence[Obstacle]):
        self._shapes = _Shapes(tuple(obstacles))
        self.R = np.array([obstacle.R for obstacle in obstacles], float).reshape(-1, 3, 3)
        self.t = np.array([obstacle.t for obstacle in obstacles], float).reshape(-1, 3)

    @classmethod
    def of(cls, obstacles: "Sequence[Obstacle] | ObstacleSet") -> "ObstacleSet":
        return obstacles if isinstance(obstacles, cls) else cls(obstacles)

    def posed(self, R: np.ndarray, t: np.ndarray) -> "ObstacleSet":
        """Copy of the shapes at other poses (n, 3, 3) and (n, 3) mm, which are not checked."""
        posed = object.__new__(ObstacleSet)  # many a step
        posed._shapes, posed.R, posed.t = self._shapes, R, t
        return posed

    @property
    def boxes(self) -> rounded_boxes.Boxes | None:
        """All of them as rounded boxes, None where any is none."""
        return None if len(self._shapes.others) else rounded_boxes.Boxes(self.R, self.t, *self._shapes.sizes)

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        return tuple(shape.posed(*pose) for shape, *pose in zip(self._shapes.shapes, self.R, self.t, strict=True))

    def nearest(self, points: np.ndarray, farthest: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """Distances (N,) mm of points (N, 3) mm to the nearest obstacle, and (N,) its number; `farthest` mm and any
        number where none is as near as that."""
        distance, place = rounded_boxes.nearest(self._boxes, np.ascontiguousarray(points, float), float(farthest))
        shapes = self._shapes
        if not len(shapes.others):
            return distance, place
        which = shapes.round[place] if len(shapes.round) else place
        for number in shapes.others:
            candidate = self.obstacles[number].distance(points)
            nearer = candidate < distance
            distance[nearer], which[nearer] = candidate[nearer], number
        return distance, which

    def frames(self, which: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Frames (c, 3, 3), rows n, t1, t2, of the obstacles `which` (c,) at points (c, 3) mm."""
        if not len(self._shapes.others):
            return rounded_boxes.frames(self._boxes, which, points)
        frames = np.empty((len(points), 3, 3))
        for mine, place in self._groups(which):
            if place is None:
                frames[mine] = self.obstacles[which[mine][0]].frames(points[mine])
            else:
                frames[mine] = rounded_boxes.frames(self._boxes, place, np.ascontiguousarray(points[mine], float))
        return frames

    def deep(self, which: np.ndarray, points: np.ndarray, distances: np.ndarray, side: float) -> bool:
        """True where a point (c, 3) mm is so far within its obstacle `which` (c,), by -distances (c,) mm, that the
        normal twice as far in has a product below `side` with the one there."""
        if not len(self._shapes.others):
            return rounded_boxes.deep(self._boxes, which, points, distances, side)
        within = np.flatnonzero(distances < 0)
        which, points = which[within], points[within]
        normals = self.frames(which, points)[:, 0]
        deeper = self.frames(which, points + distances[within, None] * normals)[:, 0]
        return bool(((normals * deeper).sum(axis=1) < side).any())

    @property
    def curved(self) -> bool:
        """True where any obstacle has a curvature that `bends` knows."""
        return self._shapes.curved

    @property
    def sharp(self) -> bool:
        """True where any obstacle has sharp edges that `facing` knows."""
        return bool(self._shapes.sharp.any())

    def bends(self, which: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Derivative (c, 3, 3) 1/mm of the normal by the place. 0 on flat faces, and at edges, where there is none."""
        slopes = np.zeros((len(points), 3, 3))
        for mine, place in self._groups(which):
            if place is None:
                slopes[mine] = self.obstacles[which[mine][0]].bends(points[mine])
            else:
                slopes[mine] = rounded_boxes.bends(self._boxes, place, np.ascontiguousarray(points[mine], float))
        return slopes

    def _groups(self, which: np.ndarray) -> list[tuple[np.ndarray | slice, np.ndarray | None]]:
        """Points that are asked together, and which rounded boxes (c,) they meet, None for a point's own obstacle."""
        shapes = self._shapes
        if not len(shapes.others):
            return [(slice(None), which)] if len(which) else []
        mine = np.flatnonzero(shapes.place[which] >= 0)
        groups = [(mine, shapes.place[which[mine]])] if len(mine) else []
        alone = [np.flatnonzero(which == number) for number in shapes.others]
        return groups + [(points, None) for points in alone if len(points)]

    def between_nodes(self, places: np.ndarray, facets: Facets, within: float, kept: Collection[int] = ()) -> Touching:
        """`between_nodes` of rounded boxes, by the numbers of the obstacles. Other shapes meet
        nodes alone."""
        touching = between_nodes(places, facets, self._boxes, within, kept)
        return touching._replace(obstacles=self._shapes.round[touching.obstacles])

    def facing(self, places: np.ndarray, facets: Facets, points: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Mask (c,) of the nodes `points` (c,), of those at places (N, 3) mm, whose surface faces the nearest side of
        their obstacle `which` (c,). Before the others is an edge or a corner of a box."""
        faces, sharp = np.ones(len(points), dtype=bool), self._shapes.sharp[which]
        if sharp.any():
            points, which = points[sharp], which[sharp]
            faces[sharp] = facing(places, facets, points, self.frames(which, places[points])[:, 0])
        return faces

    @cached_property
    def _boxes(self) -> rounded_boxes.Boxes:
        shapes = self._shapes
        return self.boxes or rounded_boxes.Boxes(self.R[shapes.round], self.t[shapes.round], *shapes.sizes)


class _Shapes:
    """Shapes (n,) of obstacles, wherever they are.

    round, others: numbers of the rounded boxes and of the others
    place: (n,) of each obstacle among the rounded boxes, -1 of others
    sizes: of the rounded boxes, the last fields of `rounded_boxes.Boxes`
    curved: whether any has a curvature
    sharp: (n,) bool, boxes"""

    def __init__(self, shapes: tuple[Obstacle, ...]):
        self.shapes, is_round = shapes, np.array([isinstance(shape, Rounded) for shape in shapes], dtype=bool)
        self.round, self.others = np.flatnonzero(is_round), np.flatnonzero(~is_round)
        self.place = np.where(is_round, np.cumsum(is_round) - 1, -1)
        self.sizes = rounded_boxes.sizes([shapes[i] for i in self.round])
        self.sharp = np.array([isinstance(shape, Box) for shape in shapes], dtype=bool)
        self.curved = bool(self.sizes[1].any()) or any(shapes[i].curved for i in self.others)
