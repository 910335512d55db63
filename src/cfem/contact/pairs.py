"""Pairs of a patch and the surface before it: of another body or its own (`cfem.contact.detection`), or a rigid
obstacle; and of a rigid obstacle and the surface between its nodes (`cfem.contact.between_nodes`), where the row r has
the barycentric coordinates of the point that it presses.

Of the places x_j of all N patches, a pair has a row r of numbers, 1 at its own patch and -w_j at the faces that it
meets. What pushes the pair by f pushes each patch j by r_j f, so that forces balance. Its slip is counted from where
it stuck, or was at the end of the last step,

    slip = T (sum_j r_j x_j - o)

with r of that time: the point then before it, of the surface that is there, goes where that surface goes. o is 0
between surfaces, and the place at which a rigid obstacle held the patch. T are the tangents now."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from cfem.contact.between_nodes import features_of
from cfem.contact.detection import NEVER, MayMeet, detect, may_meet
from cfem.contact.law.modes import Mode
from cfem.contact.moving_least_squares import WITHIN
from cfem.contact.obstacle import tangents
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.prescribed_motion import PrescribedMotion
from cfem.contact.touching_facets import Facets

SETTLING = 0.01  # distances of patches
ENTERED = 0.1  # distances of patches: what was deeper where a step began has not come in
APART = 0.3  # of the length: patches of one body that are nearer along its surface never meet


@dataclass(frozen=True)
class Pairs:
    """Pairs of patches, of N in all, with the surface before them.

    slots: (p,) number of the patch, plus N where it meets an obstacle; from 2 N on, of facets and edges between nodes,
        which meet obstacles (`cfem.contact.between_nodes`)
    relative: (p, N) rows r of the patches' places
    frames: (p, 3, 3) rows n, t1, t2
    gaps: (p,) mm
    partners: (p,) number of the body that is met, or that of all bodies plus that of the obstacle"""

    slots: np.ndarray
    relative: np.ndarray
    frames: np.ndarray
    gaps: np.ndarray
    partners: np.ndarray

    def __len__(self) -> int:
        return len(self.slots)

    @property
    def points(self) -> np.ndarray:
        """Numbers (p,) of the patches, between nodes of the one that is nearest."""
        points, count = self.slots % self.relative.shape[1], self.relative.shape[1]
        between = self.slots >= 2 * count
        if between.any():
            points[between] = self.relative[between].argmax(axis=1)
        return points

    @property
    def at_nodes(self) -> np.ndarray:
        """(p,) bool: the pairs of patches that meet obstacles, at nodes where patches are nodes."""
        count = self.relative.shape[1]
        return (self.slots >= count) & (self.slots < 2 * count)

    def gaps_at(self, places: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Gaps (p,) mm of pairs that are known at `places`, were the patches at `moved` (N, 3) mm, on the same
        planes."""
        return self.gaps + (self.frames[:, 0] * (self.relative @ (moved - places))).sum(axis=1)

    @property
    def used(self) -> np.ndarray:
        """Numbers of all patches that any of them depends on."""
        return np.flatnonzero(self.relative.any(axis=0))

    @classmethod
    def none(cls, count: int) -> "Pairs":
        """No pairs, of `count` patches."""
        empty = np.zeros(0, dtype=np.int64)
        return cls(empty, np.zeros((0, count)), np.zeros((0, 3, 3)), np.zeros(0), empty)

    @property
    def faces(self) -> dict[int, np.ndarray]:
        """Faces of each point that has some: (N,) bool by the number of the point."""
        count = self.relative.shape[1]
        patches = np.arange(count)
        rows = zip(self.slots.tolist(), self.relative, strict=True)
        return {slot: (row != 0) & (patches != slot) for slot, row in rows if slot < count}

    def some(self, which: np.ndarray) -> "Pairs":
        """Those of `which` (p,) bool alone."""
        return Pairs(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    def joined(self, more: "Pairs") -> "Pairs":
        """These, and then those of `more`."""
        names = self.__dataclass_fields__
        return Pairs(*(np.concatenate([getattr(self, name), getattr(more, name)]) for name in names))


@dataclass(frozen=True)
class Pressing:
    """Forces of the pairs in one state.

    push: (p, 3) N of each on its own patch, 0 where it is open
    bodies: (N,) number of the body of each patch"""

    pairs: Pairs
    push: np.ndarray
    bodies: np.ndarray

    @property
    def gap(self) -> float:
        """Smallest gap, mm."""
        return float(self.pairs.gaps.min(initial=np.inf))

    @property
    def pressing(self) -> np.ndarray:
        """Normal forces (p,) N."""
        return (self.push * self.pairs.frames[:, 0]).sum(axis=1)

    @property
    def pressed(self) -> float:
        """Sum of all normal forces, N."""
        return float(self.pressing.sum())

    def among(self, body: int, other: int) -> np.ndarray:
        """Mask (p,) of the pairs of two bodies; an obstacle has the number of bodies plus its own."""
        mine, met = self.bodies[self.pairs.points], self.pairs.partners
        return ((mine == body) & (met == other)) | ((mine == other) & (met == body))

    def between(self, body: int, other: int) -> float:
        """N: the sum of the normal forces of two bodies (`among`)."""
        return float(self.pressing[self.among(body, other)].sum())


def numbers_of(itself: Sequence[str], others: Iterable[str], obstacles: Iterable[str]) -> dict[str, int]:
    """Numbers, by name, of what a robot, the body 0, meets: itself, other robots, rigid obstacles."""
    return dict.fromkeys(itself, 0) | {name: 1 + i for i, name in enumerate([*others, *obstacles])}


class Skin(Protocol):
    """A body whose surface touches by points.

    regions: numbers (N,) of the regions of its surface that points lie in, and distances (G, G) mm between regions
        along it
    spacings: (N,) mm between points and their neighbours
    held_still: (N,) bool, points where the body is held, which meet nothing
    facets: triangles of the points, but those that are held; none where points are no nodes"""

    facets: Facets
    regions: tuple[np.ndarray, np.ndarray]
    spacings: np.ndarray
    held_still: np.ndarray


@dataclass(frozen=True)
class Surroundings:
    """The bodies and obstacles of a scene, and who may meet whom.

    bodies: (N,) number of the body of each point
    may_meet: None where there is one body that does not touch itself
    spacings: (N,) mm between points and their neighbours
    still: (N,) bool, points that meet nothing
    facets: of all bodies"""

    bodies: np.ndarray
    may_meet: MayMeet | None
    spacings: np.ndarray
    still: np.ndarray
    facets: Facets

    @classmethod
    def of(cls, skins: Sequence[Skin], itself: Sequence[bool], length: float) -> "Surroundings":
        """Surroundings of bodies with these skins. itself: which of them may touch themselves, points APART of `length`
        mm or more from each other."""
        still = np.concatenate([skin.held_still for skin in skins])
        counts = [len(skin.held_still) for skin in skins]
        allowed = _allowed(skins, itself, length, still) if len(skins) > 1 or any(itself) else None
        spacings = np.concatenate([skin.spacings for skin in skins])
        bodies = np.repeat(np.arange(len(skins)), counts)
        facets = Facets.joined([skin.facets for skin in skins], np.cumsum([0, *counts]))
        return cls(bodies, allowed, spacings, still, facets)

    @cached_property
    def spacing(self) -> float:
        """mm: the median of the widest body's."""
        return max(float(np.median(self.spacings[self.bodies == body])) for body in np.unique(self.bodies))

    def pairs(
        self, places: np.ndarray, normals: np.ndarray, faces: Mapping[int, np.ndarray] | None = None, moved: float = 0.0
    ) -> Pairs:
        """Pairs of patches at places (N, 3) mm with outward unit normals (N, 3) and soft surfaces that are near. faces:
        see `detect`, of what has touched in this step. moved: mm by which patches last moved: as long as that is much,
        faces are kept only by points that would have none."""
        if self.may_meet is None:
            return Pairs.none(len(places))
        if faces and moved > SETTLING * self.spacing:
            pairs = self.pairs(places, normals)
            lost = {point: mine for point, mine in faces.items() if point not in pairs.slots}
            return self.pairs(places, normals, lost) if lost else pairs
        points, relative, frames = detect(places, normals, self.may_meet, self.spacings, faces)
        gaps = (frames[:, 0] * (relative @ places)).sum(axis=1)
        partners = self.bodies[relative.argmin(axis=1)] if len(points) else np.zeros(0, dtype=np.int64)
        return Pairs(points, relative, frames, gaps, partners)

    def onwards(self, before: Pairs, places: np.ndarray) -> Pairs:
        """Pairs of soft surfaces of a state before, on the same planes, where patches have gone to places (N, 3) mm."""
        soft = before.some(before.slots < len(places))
        return replace(soft, gaps=(soft.frames[:, 0] * (soft.relative @ places)).sum(axis=1))

    def entered(self, pairs: Pairs, places: np.ndarray, begin: np.ndarray | None, memory: "Memory") -> np.ndarray:
        """Mask (p,) of the pairs that touched before, and of those of robots that were not deep within each other where
        the step began, at (N, 3) mm (none: nothing is known): the others have not come in through the faces that they
        have."""
        if begin is None or not len(pairs):
            return np.ones(len(pairs), dtype=bool)
        outside = pairs.gaps_at(places, begin) > -ENTERED * self.spacing
        return outside | (pairs.slots >= len(places)) | np.isin(pairs.slots, list(memory.rows))

    def slots(self, obstacles: ObstacleSet) -> int:
        """Number of slots that pairs may have among these obstacles."""
        return 2 * len(self.bodies) + features_of(self.facets, len(obstacles.t))

    def with_obstacles(self, places: np.ndarray, obstacles: ObstacleSet, kept: Collection[int]) -> Pairs:
        """Pairs of patches at places (N, 3) mm, and of the surface between nodes, with rigid obstacles near them; kept:
        as `between_nodes` has it."""
        N = len(places)
        distance, which = obstacles.nearest(places)
        near = np.flatnonzero((distance < WITHIN * self.spacing) & ~self.still)
        near = near[obstacles.facing(places, self.facets, near, which[near])]
        relative = np.zeros((len(near), N))
        relative[np.arange(len(near)), near] = 1.0
        frames = obstacles.frames(which[near], places[near])
        pairs = Pairs(near + N, relative, frames, distance[near], which[near] + self.bodies[-1] + 1)
        return pairs.joined(self.between_nodes(places, obstacles, kept))

    def between_nodes(self, places: np.ndarray, obstacles: ObstacleSet, kept: Collection[int] = ()) -> Pairs:
        """Pairs of the surface between its nodes, which are at places (N, 3) mm, and rigid obstacles. kept: slots that
        have touched in this step, which would else come and go where they are as deep as the nodes beside them."""
        N = len(places)
        features = [slot - 2 * N for slot in kept if slot >= 2 * N]
        touching = obstacles.between_nodes(places, self.facets, self.spacing, features)
        relative = np.zeros((len(touching.gaps), N))
        np.add.at(relative, (np.arange(len(relative))[:, None], touching.nodes), touching.shares)
        partners = touching.obstacles + self.bodies[-1] + 1
        return Pairs(touching.features + 2 * N, relative, tangents(touching.normals), touching.gaps, partners)


@dataclass(frozen=True)
class Memory:
    """Origin of slip by slot: the rows r (N,) and the origins o (3,) mm."""

    rows: Mapping[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    def with_new(
        self, pairs: Pairs, begin: np.ndarray | None, places: np.ndarray, coming: np.ndarray | None = None
    ) -> "Memory":
        """Pairs that it does not know stick where they have touched: on the way from `begin` (none: at its end) to
        `coming`, (N, 3) mm both, `places` unless given, where the gap, linear about `places`, is 0; at its end where it
        closes later."""
        coming = places if coming is None else coming
        begin = coming if begin is None else begin
        new = [i for i, slot in enumerate(pairs.slots.tolist()) if slot not in self.rows]
        if not new:
            return self
        some, rows = pairs.some(np.isin(np.arange(len(pairs)), new)), dict(self.rows)
        first, last = (some.gaps_at(places, moment) for moment in (begin, coming))
        share = np.where(last < 0, first / np.maximum(first - last, 1e-300), 1.0)
        share = np.where(first <= 0, 0.0, share)
        for i, slot in enumerate(some.slots.tolist()):
            rows[slot] = _held(some.relative[i], some.frames[i], slot, begin + share[i] * (coming - begin))
        return Memory(rows)

    def after(self, pairs: Pairs, places: np.ndarray, modes: Mapping[int, Mode]) -> "Memory":
        """At the end of a step: what sticks remembers where, what slides where it is now."""
        N, rows = len(places), {}
        for i, slot in enumerate(pairs.slots.tolist()):
            mode = modes.get(slot, Mode.OPEN)
            if mode is Mode.STICK and slot in self.rows:
                rows[slot] = self.rows[slot]
            elif mode is not Mode.OPEN:
                rows[slot] = pairs.relative[i], pairs.relative[i] @ places if slot >= N else np.zeros(3)
        return Memory(rows)

    def slid(self, slid: Mapping[int, np.ndarray]) -> "Memory":
        """Memory with the origins of pairs where they have slid to; slid: (3,) mm by slot."""
        rows = {slot: (row, origin + slid.get(slot, 0.0)) for slot, (row, origin) in self.rows.items()}
        return Memory(rows)

    def carried(self, pairs: Pairs, courses: Mapping[int, PrescribedMotion], begin: float, end: float) -> "Memory":
        """Memory with the origins on moving obstacles moved along. courses: by number among the partners of pairs."""
        rows = dict(self.rows)
        for slot, partner in zip(pairs.slots.tolist(), pairs.partners.tolist(), strict=True):
            if partner in courses and slot in rows:
                row, origin = rows[slot]
                rows[slot] = row, courses[partner].carried(origin[None], begin, end)[0]
        return Memory(rows)

    def slips(self, pairs: Pairs, places: np.ndarray) -> np.ndarray:
        """Slips (p, 2) mm of pairs that it knows."""
        known = [self.rows[slot] for slot in pairs.slots.tolist()]
        rows = np.array([row for row, _ in known]).reshape(pairs.relative.shape)
        moved = rows @ places - np.array([origin for _, origin in known]).reshape(-1, 3)
        return (pairs.frames[:, 1:] @ moved[:, :, None])[..., 0]


def _allowed(skins: Sequence[Skin], itself: Sequence[bool], length: float, still: np.ndarray) -> MayMeet:
    """Who may meet whom (`Surroundings.of`)."""
    numbers, alongs = zip(*(skin.regions for skin in skins), strict=True)
    first = np.cumsum([0, *(len(along) for along in alongs)])
    regions = np.concatenate([begin + of_points for begin, of_points in zip(first, numbers, strict=False)])
    codes = may_meet(alongs, [APART * length if touches else np.inf for touches in itself])
    codes = np.pad(codes, (0, 1), constant_values=NEVER)  # of what is held
    return MayMeet(np.where(still, first[-1], regions), codes)


def _held(row: np.ndarray, frame: np.ndarray, slot: int, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row and origin of a pair that sticks where patches are at `places`: of its faces such shares that the point is
    before it there."""
    N = len(places)
    if slot >= N:
        return row, row @ places
    faces = np.setdiff1d(np.flatnonzero(row), slot)
    along = np.column_stack([np.ones(len(faces)), places[faces] @ frame[1:].T])
    aside = np.concatenate([[0.0], frame[1:] @ (row @ places)])
    held = row.copy()
    held[faces] -= np.linalg.pinv(along.T) @ aside
    return held, np.zeros(3)
