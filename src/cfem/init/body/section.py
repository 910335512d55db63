"""Cuts across a body: what of a plane lies inside, and where a ball does."""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from cfem.init.body.interior import Interior

_LATTICE = 40  # points across the longer side of a cut
# No direction is further than 27.6 deg from one of these, of which the cosine is 1 / 1.129.
_BALL = np.array([v for v in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(v)])
_BALL *= 1.129 / np.linalg.norm(_BALL, axis=1)[:, None]


@dataclass(frozen=True)
class Section:
    """A connected piece of a cut. centre: (3,) mm, its centroid; normal: (3,) unit vector across the cut; area mm^2;
    inscribed: mm, radius of the largest circle within; extent: mm, from the centre to the farthest point; thin: (3,)
    unit vector in which it is narrowest; slimness: its smallest second moment over its largest, 1 where it is as wide
    in all directions."""

    centre: np.ndarray
    normal: np.ndarray
    area: float
    inscribed: float
    extent: float
    thin: np.ndarray
    slimness: float


@dataclass(frozen=True)
class Lattice:
    """Points of a plane across a body, (a, b, 3) mm, `step` mm apart along u and v (3,); inside (a, b) bool."""

    points: np.ndarray
    inside: np.ndarray
    step: float
    u: np.ndarray
    v: np.ndarray


def cut(body: Interior, axis: int, coordinate: float) -> Section | None:
    """The largest piece where the coordinate along `axis` (0, 1, 2) is `coordinate` mm; None where the body is not
    there."""
    return cut_across(body, np.eye(3)[axis] * coordinate, np.eye(3)[axis])


def cut_across(body: Interior, place: np.ndarray, normal: np.ndarray, near: np.ndarray | None = None) -> Section | None:
    """The largest piece of the plane through `place` (3,) mm across `normal` (3,), or, where given, the piece nearest
    to `near` (3,) mm; None where the plane misses the body. To the spacing of a lattice of points."""
    lattice = lattice_across(body, place, normal)
    if lattice is None:
        return None
    pieces, count = ndimage.label(lattice.inside)
    if count == 0:
        return None
    if near is None:
        number = 1 + np.bincount(pieces[pieces > 0] - 1).argmax()
    else:
        apart = np.where(pieces > 0, np.linalg.norm(lattice.points - near, axis=2), np.inf)
        number = pieces[np.unravel_index(apart.argmin(), apart.shape)]
    piece, step = pieces == number, lattice.step
    points = lattice.points[piece]
    centre = points.mean(axis=0)
    across_plane = (points - centre) @ np.stack([lattice.u, lattice.v], axis=1)
    moments, directions = np.linalg.eigh(np.cov(across_plane.T, bias=True) + np.eye(2) * step**2 / 12)
    thin = directions[:, 0] * np.sign(directions[np.abs(directions[:, 0]).argmax(), 0])
    return Section(
        centre=centre,
        normal=normal,
        area=float(piece.sum() * step**2),
        inscribed=float((ndimage.distance_transform_edt(np.pad(piece, 1)).max() - 0.5) * step),
        extent=float(np.linalg.norm(points - centre, axis=1).max() + step),
        thin=thin[0] * lattice.u + thin[1] * lattice.v,
        slimness=float(moments[0] / moments[1]),
    )


def lattice_across(body: Interior, place: np.ndarray, normal: np.ndarray, fineness: int = _LATTICE) -> Lattice | None:
    """Over all of the body that the plane meets, `fineness` points along its longer side; None where it misses it."""
    cells = body.near_plane(place, normal)
    if len(cells) == 0:
        return None
    u, v = frame(normal)
    low, high = [], []
    for side in (u, v):  # of the boxes
        middle, half = (body.low[cells] + body.high[cells]) / 2 @ side, (body.high - body.low)[cells] / 2 @ np.abs(side)
        low.append(float((middle - half).min()))
        high.append(float((middle + half).max()))
    step = max(high[0] - low[0], high[1] - low[1]) / fineness
    ticks = [np.arange(low[side] + step / 2, high[side], step) for side in (0, 1)]
    points = ticks[0][:, None, None] * u + ticks[1][:, None] * v + (place @ normal) * normal
    return Lattice(points, body.contains(points.reshape(-1, 3), cells).reshape(points.shape[:2]), step, u, v)


def clear(body: Interior, points: np.ndarray, radius: float) -> np.ndarray:
    """Mask (k,) of the points (k, 3) mm around which a ball of `radius` mm lies inside, judged by 26 points of its
    surface."""
    around = points[:, None] + radius * np.vstack([np.zeros(3), _BALL])
    inside = body.contains(around.reshape(-1, 3), body.near_points(points, 1.2 * radius))
    return inside.reshape(len(points), -1).all(axis=1)


def frame(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (3,) across `normal` (3,), right-handed: the other axes where it is an axis."""
    axis = int(np.abs(normal).argmax())
    u = np.eye(3)[(axis + 1) % 3] * np.sign(normal[axis])
    u = u - (u @ normal) * normal
    u /= np.linalg.norm(u)
    return u, np.cross(normal, u)
