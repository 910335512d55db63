"""Cuts across a body: what of a plane lies inside, and where a ball does."""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from cfem.init.interior import Interior

_LATTICE = 40  # points across the longer side of a cut
# No direction is further than 27.6 deg from one of these, of which the cosine is 1 / 1.129.
_BALL = np.array([v for v in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(v)])
_BALL *= 1.129 / np.linalg.norm(_BALL, axis=1)[:, None]


@dataclass(frozen=True)
class Section:
    """The largest connected piece of a cut. centre: (3,) mm, its centroid; area mm^2; inscribed: mm, radius of the
    largest circle within; extent: mm, from the centre to the farthest point; thin: (3,) unit vector in which it is
    narrowest; slimness: its smallest second moment over its largest, 1 where it is as wide in all directions."""

    centre: np.ndarray
    area: float
    inscribed: float
    extent: float
    thin: np.ndarray
    slimness: float


def cut(body: Interior, axis: int, at: float) -> Section | None:
    """Where the coordinate along `axis` (0, 1, 2) is `at` mm; None where the plane misses the body. To the spacing of
    a lattice of points."""
    cells = body.near(axis, at)
    if len(cells) == 0:
        return None
    u, v = across(axis)
    low, high = body.low[cells].min(axis=0), body.high[cells].max(axis=0)
    step = max(high[u] - low[u], high[v] - low[v]) / _LATTICE
    ticks = [np.arange(low[side] + step / 2, high[side], step) for side in (u, v)]
    lattice = np.empty((len(ticks[0]), len(ticks[1]), 3))
    lattice[..., axis], lattice[..., u], lattice[..., v] = at, ticks[0][:, None], ticks[1]
    found = body.contains(lattice.reshape(-1, 3), cells)
    pieces, count = ndimage.label(found.reshape(lattice.shape[:2]))
    if count == 0:
        return None
    piece = pieces == 1 + np.bincount(pieces[pieces > 0] - 1).argmax()
    points = lattice[piece]
    centre = points.mean(axis=0)
    moments, directions = np.linalg.eigh(np.cov((points - centre).T[[u, v]], bias=True) + np.eye(2) * step**2 / 12)
    thin = np.zeros(3)
    thin[[u, v]] = directions[:, 0] * np.sign(directions[np.abs(directions[:, 0]).argmax(), 0])
    return Section(
        centre=centre,
        area=float(piece.sum() * step**2),
        inscribed=float((ndimage.distance_transform_edt(np.pad(piece, 1)).max() - 0.5) * step),
        extent=float(np.linalg.norm(points - centre, axis=1).max() + step),
        thin=thin,
        slimness=float(moments[0] / moments[1]),
    )


def clear(body: Interior, points: np.ndarray, radius: float, axis: int) -> np.ndarray:
    """(k,) whether the ball of `radius` mm around each point (k, 3) lies inside, judged by 26 points of its surface;
    points at one place along `axis`."""
    around = points[:, None] + radius * np.vstack([np.zeros(3), _BALL])
    inside = body.contains(around.reshape(-1, 3), body.near(axis, points[0, axis], 2 * radius))
    return inside.reshape(len(points), -1).all(axis=1)


def across(axis: int) -> tuple[int, int]:
    """The other two axes, right-handed."""
    return (axis + 1) % 3, (axis + 2) % 3
