"""The way through the middle of a body, from what is held to the part that is farthest along it."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from cfem.init.body.voxels import Voxels
from cfem.init.hold import Run

_LEVELS = 24
_SMALL = 0.15  # of the largest piece of a level: smaller ones are no branch
_SMOOTH = 1.5  # levels over which the middle is smoothed


@dataclass(frozen=True)
class Centreline:
    """points (k, 3) mm from the held part on; tangents (k, 3), unit; branches: how many pieces a level has, mostly;
    length: mm of the longest way through the body."""

    points: np.ndarray
    tangents: np.ndarray
    branches: int
    length: float


def held_cubes(shape: Voxels, run: Run) -> np.ndarray:
    """Mask (k,) of those at or beyond the level of the held part."""
    along = (shape.centres[:, run.axis] - run.level) * run.forward
    return along <= max(shape.step, along.min() + shape.step)


def centreline(shape: Voxels, run: Run) -> Centreline | None:
    """Middles of the sets of equal distance from what is held, each the largest piece that joins the one after
    it. None where nothing is held, or too little is free."""
    distance = shape.distances(held_cubes(shape, run))
    distance[~np.isfinite(distance)] = 0.0
    length = float(distance.max())
    if not length > 4 * shape.step:
        return None
    field = np.full(shape.inside.shape, -1.0)
    field[shape.inside] = distance
    band = max(length / _LEVELS / 2, shape.step)
    middles, counts, beyond = [], [], None
    for share in np.linspace(1, 0, _LEVELS, endpoint=False)[1:]:
        label, count = ndimage.label(np.abs(field - share * length) <= band, np.ones((3, 3, 3)))
        sizes = np.bincount(label.ravel(), minlength=count + 1)[1:]
        if count == 0:
            continue
        counts.append(int((sizes > _SMALL * sizes.max()).sum()))
        if beyond is None:
            chosen = 1 + int(sizes.argmax())
        else:
            touching = np.bincount(label[ndimage.binary_dilation(beyond, iterations=2)], minlength=count + 1)[1:]
            chosen = 1 + int((touching if touching.any() else sizes).argmax())
        beyond = label == chosen
        middles.append(shape.low + shape.step * np.argwhere(beyond).mean(axis=0))
    if len(middles) < 4:
        return None
    points = ndimage.gaussian_filter1d(np.array(middles)[::-1], _SMOOTH, axis=0, mode="nearest")
    tangents = np.gradient(points, axis=0)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1), 1e-12)[:, None]
    return Centreline(points, tangents, int(np.median(counts)), length)
