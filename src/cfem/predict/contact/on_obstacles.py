"""Patches on obstacles: how deep they begin, the pairs that they make, and where friction holds them."""

import numpy as np

from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.pairs import Pairs

SIDE = 0.7  # product of normals: less is another side of an obstacle


def begins_deep(obstacles: ObstacleSet, places: np.ndarray, distance: np.ndarray, which: np.ndarray) -> bool:
    """True where a patch, at places (N, 3) mm, is so far within its obstacle `which` (N,), by -distance (N,) mm, that,
    twice as far in, another side of it is nearer."""
    within = distance < 0
    if not within.any():
        return False
    which, places = which[within], places[within]
    normals = obstacles.frames(which, places)[:, 0]
    deeper = obstacles.frames(which, places + distance[within, None] * normals)[:, 0]
    return bool(((normals * deeper).sum(axis=1) < SIDE).any())


def pairs_with_obstacles(
    patches: np.ndarray, frames: np.ndarray, gaps: np.ndarray, partners: np.ndarray, count: int
) -> Pairs:
    """Pairs of patches (p,), among `count`, and an obstacle each; frames (p, 3, 3), gaps (p,) mm and partners (p,) as
    `Pairs` has them."""
    relative = np.zeros((len(patches), count))
    relative[np.arange(len(patches)), patches] = 1.0
    return Pairs(patches + count, relative, frames, gaps, partners)


def held_by_friction(
    places: np.ndarray, stuck: np.ndarray, pressed: np.ndarray, sticking: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """(N, 3) mm from where slip counts in the next step, NaN of patches that are not pressed. Those that slide are at
    places (N, 3) mm; those that stick, by their numbers (s,), where they were, stuck (N, 3) mm, brought to the surface
    along its normals (s, 3)."""
    held = np.full_like(places, np.nan)
    held[pressed] = places[pressed]
    away = ((places[sticking] - stuck[sticking]) * normals).sum(axis=1)
    held[sticking] = stuck[sticking] + away[:, None] * normals
    return held
