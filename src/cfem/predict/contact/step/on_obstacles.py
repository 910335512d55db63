"""Patches and the obstacles that they may touch in the rounds of a step (`cfem.predict.contact.step.rounds`): how far
they are, which stick, from where they slip, and whether their forces obey the law where patches have come to."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from cfem.contact.law.modes import Mode
from cfem.contact.pairs import Pairs
from cfem.contact.patch_forces import TurningCompliance, lawful, turned
from cfem.predict.contact.step.poses import Poses, carry, gaps_of
from cfem.predict.contact.step.state import ContactState

BEHIND = 1e-4  # of the length: a node that is farther within a box has an edge or a corner behind it, which was not met
SIDE = 0.7  # product of normals: less is another side of an obstacle
TOLERANCE = 1e-9  # of the length: how far gaps, and places by their forces, may be from what the law says
OVERLAP = 1e-6  # of the length: how far a patch may be within an obstacle
CLOSE = 0.005  # of the length: farther patches on which no obstacle presses are forgotten between steps
FAR = 0.1  # of the length: no distance is larger, as none is asked
NOTHING, NO_MOBILITY = np.zeros(0, dtype=np.int64), np.zeros((0, 0))


class OnObstacles:
    """Patches (N) among obstacles during one step.

    near: (d,) patches that may touch an obstacle
    push: (N, 3) N, force of obstacles on the patches
    distance: (N,) mm from obstacles, or less where that is far above 0
    which: (N,) nearest obstacle
    held: (N, 3) mm, where patches stuck at the begin of the step
    stuck: (N, 3) mm, from where slip along obstacles counts: there, or where the last part of the step begins
    sticks: (N,) bool, in the last round
    stood: where obstacles stood before, None where nothing is known of it
    missed: mm, by which patches missed the law where the last round brought them
    behind: mm, how far the deepest node that faces no side of a box was within it: 0 where its edges are met"""

    def __init__(self, poses: Poses, before: ContactState | None, forces: np.ndarray | None = None):
        """Begins with what presses in the state `before`, None: with nothing. forces: (N, 3) N on all patches, with
        which obstacles press where nothing else may touch."""
        self.scene, self.poses = poses.scene, poses
        count = len(self.scene.bodies)
        self.which, self.stood, self.missed = np.zeros(count, dtype=np.int64), None, 0.0
        self.behind = 0.0
        self._frames: np.ndarray | None = None  # of obstacles at the places, where they are known
        if before is None:
            self.near, self.push, self.sticks = NOTHING, np.zeros((count, 3)), np.zeros(count, dtype=bool)
            return
        self.near, self.push = before.near, forces
        if self.scene.soft or self.scene.meets_between_nodes:
            pressed = before.on_obstacles
            self.push = np.zeros((count, 3))
            self.push[before.pairs.points[pressed]] = before.push[pressed]
        self.sticks = before.sticks
        self.stood, self.which[before.near] = before.obstacles, before.met

    def place(self) -> np.ndarray:
        """Puts rigid bodies where the forces bring them. Places (N, 3) mm of all patches then."""
        return self.poses.follow(self.near, self.which, self.push)

    def look_at_all(self, places: np.ndarray) -> None:
        """Finds how far all patches, at places (N, 3) mm, are from obstacles."""
        self.distance, self.which = self.poses.obstacles.nearest(places, FAR * self.scene.length)
        self.distance[self.scene.surfaces.held_still] = np.inf
        self.behind = self._turn_away(np.flatnonzero(self.distance <= 0), places)

    def look(self, places: np.ndarray, before: np.ndarray) -> None:
        """Finds the distances after patches have moved from places `before` (N, 3) mm. Where nothing but robots moves,
        patches that cannot have come near an obstacle keep a distance that is certain."""
        if self.scene.rigid is not None or (self.scene.meets_between_nodes and self.poses.obstacles.sharp):
            return self.look_at_all(places)
        self.distance = self.distance - 2 * np.abs(places - before).max()  # more than the root of 3
        near = self.distance <= 0
        near[self.near] = True
        self.distance[near], self.which[near] = self.poses.obstacles.nearest(places[near])

    def look_again(self, places: np.ndarray) -> None:
        """Finds the distances of patches that may touch, which those beside them have moved."""
        near, self._frames = self.near, None
        self.distance[near], self.which[near] = self.poses.obstacles.nearest(places[near])
        self._turn_away(near[self.distance[near] <= 0], places)

    def _turn_away(self, within: np.ndarray, places: np.ndarray) -> float:
        """Puts nodes `within` (c,) obstacles far away where the surface, whose nodes are at places (N, 3) mm, does not
        face the nearest side: before them is an edge or a corner (`cfem.contact.between_nodes`). How far, mm, the
        deepest of these is within an obstacle."""
        if not self.scene.meets_between_nodes or not len(within):
            return 0.0
        facets = self.scene.surroundings.facets
        behind = within[~self.poses.obstacles.facing(places, facets, within, self.which[within])]
        depth = -float(self.distance[behind].min(initial=0.0))
        self.distance[behind] = FAR * self.scene.length
        return depth

    def take(self, near: np.ndarray) -> None:
        """Patches (d,) that may touch in this round."""
        if len(near) != len(self.near) or not np.array_equal(near, self.near):
            self.near, self._frames = near, None

    def let_go(self) -> None:
        """Takes all forces off."""
        self.near, self.push, self._frames = NOTHING, np.zeros_like(self.push), None

    def forget_frames(self) -> None:
        """Patches have moved, or obstacles."""
        self._frames = None

    def frames(self, places: np.ndarray) -> np.ndarray:
        """Frames (d, 3, 3) of the obstacles at patches near them, at places (N, 3) mm."""
        if self._frames is None:
            self._frames = self.poses.obstacles.frames(self.which[self.near], places[self.near])
        return self._frames

    def turned(self, compliance: np.ndarray, places: np.ndarray, known: np.ndarray) -> TurningCompliance | None:
        """Compliance of known patches (c,) with forces that turn by the curvature of obstacles, None without."""
        near = self.near
        if not self.poses.obstacles.curved:
            return None
        pressing = np.where(self.sticks[near], 0.0, (self.frames(places)[:, 0] * self.push[near]).sum(axis=1))
        if not pressing.any():
            return None
        turning = np.zeros((len(known), 3, 3))
        bends = self.poses.obstacles.bends(self.which[near], places[near])
        turning[np.searchsorted(known, near)] = pressing[:, None, None] * bends
        return turned(compliance, turning)

    def slide(self, slid: np.ndarray) -> None:
        """Counts slip of the patches near obstacles from where they have slid to, (d, 3) mm from where they stuck."""
        if slid.any():
            self.stuck = self.held.copy()
            self.stuck[self.near] += slid

    def gaps(self, places: np.ndarray) -> np.ndarray:
        """(d, 3) mm of patches near obstacles, in the frames of these: from them, and from where they last stuck."""
        frames, stuck = self.frames(places), (self.stuck, self.distance, self.stood)
        return self.poses.gaps(frames, places, self.near, self.which, *stuck)

    def lawful(
        self,
        local: np.ndarray,
        push: np.ndarray,
        places: np.ndarray,
        compliance: np.ndarray,
        at: np.ndarray,
        mobility: np.ndarray | None,
    ) -> np.ndarray | None:
        """(d, 3) N: what obstacles press by the frames at places (N, 3) mm, `push` itself where none turns; None where
        the law does not hold there with this.

        local (d, 3) N: in the frames before; push (d, 3) N: in the scene
        compliance (3 c, 3 c) mm/N: of patches among which these have places `at` (d,)
        mobility: of rigid bodies, of these and more patches (`Poses.mobility`)"""
        scene, self._frames = self.scene, None
        there = self.frames(places), places, self.near, self.which, self.stuck, self.distance
        yields = compliance, at, NO_MOBILITY if mobility is None else mobility
        by_law, missed, turns, beyond, within, largest, turned = _lawful(
            local, push, self.sticks, *there, self.poses.since(self.stood), float(scene.mu), *yields
        )
        self.missed = max(missed, within, 0.0)
        if max(missed, turns) > TOLERANCE * scene.length or within > OVERLAP * scene.length:
            return None
        if beyond > TOLERANCE * largest:
            return None
        return by_law if turned else push

    def ended(self, places: np.ndarray, modes: Sequence[Mode]) -> "Ended":
        """State of what is near obstacles from which the next step goes on, with these modes of the patches."""
        of_near = self.near, self.push, self.sticks, self.which, self.frames(places), self.distance
        keeps, close = self.scene.mu > 0 and len(modes) > 0, CLOSE * self.scene.length
        return ended(places, self.stuck, *of_near, self.poses.since(self.stood), close, keeps, len(self.scene.R))


class Ended(NamedTuple):
    """Patches (m,) near obstacles and those (p,) of them that touch, at the end of a step.

    slots, relative, frames, gaps, partners: of `Pairs`
    push: (p, 3) N
    touching: (p,), of all that were near in the step
    near (m,), met (m,) and stuck (N, 3) mm: of `ContactState`"""

    slots: np.ndarray
    relative: np.ndarray
    frames: np.ndarray
    gaps: np.ndarray
    partners: np.ndarray
    push: np.ndarray
    touching: np.ndarray
    near: np.ndarray
    met: np.ndarray
    stuck: np.ndarray

    @property
    def pairs(self) -> Pairs:
        return Pairs(*self[:5])


@njit(cache=True, error_model="numpy")
def ended(places, stuck, near, push, sticks, which, frames, distance, poses, close, keeps, r):
    """`Ended` of patches near (d,) of r robots; poses: the last arguments of `held_by_friction`, which see for the
    others; distance (N,) mm from obstacles. keeps: whether any is stuck."""
    d, p, m, N = len(near), 0, 0, len(places)
    touches, stays = np.zeros(d, dtype=np.bool_), np.zeros(d, dtype=np.bool_)
    for i in range(d):
        n = near[i]
        touches[i] = distance[n] <= 0 or push[n, 0] != 0.0 or push[n, 1] != 0.0 or push[n, 2] != 0.0
        stays[i] = touches[i] or distance[n] < close
        p, m = p + touches[i], m + stays[i]
    slots, partners, touching = np.empty(p, dtype=np.int64), np.empty(p, dtype=np.int64), np.empty(p, dtype=np.int64)
    relative, axes, gaps, pushes = np.zeros((p, N)), np.empty((p, 3, 3)), np.empty(p), np.empty((p, 3))
    kept, met = np.empty(m, dtype=np.int64), np.empty(m, dtype=np.int64)
    p, m = 0, 0
    for i in range(d):
        n = near[i]
        if stays[i]:
            kept[m], met[m] = n, which[n]
            m += 1
        if touches[i]:
            slots[p], partners[p], touching[p], relative[p, n], gaps[p] = n + N, which[n] + r, i, 1.0, distance[n]
            for a in range(3):
                pushes[p, a] = push[n, a]
                for b in range(3):
                    axes[p, a, b] = frames[i, a, b]
            p += 1
    held = held_by_friction(places, stuck, near[: d if keeps else 0], push, sticks, which, frames, *poses)
    return Ended(slots, relative, axes, gaps, partners, pushes, touching, kept, met, held)


@njit(cache=True, error_model="numpy")
def held_by_friction(places, stuck, near, push, sticks, which, frames, R_then, t_then, R_now, t_now, moves):
    """(N, 3) mm from where slip counts in the next step, NaN of patches that are not pressed. Those of the patches near
    (d,) that slide, push (N, 3) N, are at places (N, 3) mm; those that stick, (N,) bool, where they were, stuck (N, 3)
    mm, carried by obstacles `which` (N,) from poses then to poses now, and brought to the surface along the normals of
    its frames (d, 3, 3)."""
    held = np.full(places.shape, np.nan)
    for i in range(len(near)):
        p, away, normal = near[i], 0.0, frames[i, 0]
        if not sticks[p]:
            if push[p, 0] != 0.0 or push[p, 1] != 0.0 or push[p, 2] != 0.0:
                for a in range(3):
                    held[p, a] = places[p, a]
            continue
        for a in range(3):
            held[p, a] = stuck[p, a]
        if moves:
            o = which[p]
            carry(held[p], R_then[o], t_then[o], R_now[o], t_now[o])
        for a in range(3):
            away += (places[p, a] - held[p, a]) * normal[a]
        for a in range(3):
            held[p, a] += away * normal[a]
    return held


@njit(cache=True, error_model="numpy")
def _lawful(local, push, sticks, frames, places, near, which, stuck, distance, poses, mu, compliance, at, by_bodies):
    """`cfem.contact.patch_forces.lawful` of patches near (d,) obstacles at the gaps that they have there
    (`cfem.predict.contact.step.poses.gaps_of`); how far a patch is within one, mm; the largest entry of push, N; if
    any turns."""
    stay, within, largest, turned = np.empty(len(near), dtype=np.bool_), -np.inf, 0.0, False
    for p in range(len(distance)):
        within = max(within, -distance[p])
    for i in range(len(near)):
        stay[i] = sticks[near[i]]
    gaps = gaps_of(frames, places, near, which, stuck, distance, *poses, mu)
    by_law, missed, turns, beyond = lawful(local, push, stay, frames, gaps, compliance, at, by_bodies, mu)
    for i in range(len(near)):
        for a in range(3):
            largest = max(largest, abs(push[i, a]))
            turned |= by_law[i, a] != push[i, a]
    return by_law, missed, turns, beyond, within, largest, turned
