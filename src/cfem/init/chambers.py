"""Closed inner surfaces of a body: each may be a chamber."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cfem.constraint.attachment import show
from cfem.constraint.surface import triangulated
from cfem.contact.surface.facets import components, solid_angles
from cfem.contact.surface.triangles import normals_of, volumes_within
from cfem.init.body.shape import Shape
from cfem.init.question import named, point
from cfem.robot.mesh.surface_file import read_surface

_LEAST = 1e-4  # of the body's volume: a smaller void is a bubble


@dataclass(frozen=True)
class Chamber:
    """name; inside: (3,) mm, a point in the void; volume mm^3; corners (t, 3, 3) mm of the triangles of its wall."""

    name: str
    inside: np.ndarray
    volume: float
    corners: np.ndarray


def chambers_of(shape: Shape) -> tuple[Chamber, ...]:
    """The largest first."""
    return _enclosed(shape.mesh.X, triangulated(shape.mesh.facets), float(np.abs(shape.mesh.volumes).sum()))


def read_chamber(text: str, shape: Shape) -> Chamber:
    """'NAME: x, y, z', a point in the void in mm, or 'NAME: FILE', the closed surface of the void in mm. ValueError for
    anything else, or where no closed inner surface is around the point."""
    name, rest = named(text, "'NAME: x, y, z' in mm or 'NAME: FILE'")
    path = Path(rest.strip())
    if path.suffix and path.is_file():
        X, triangles, _ = read_surface(path)
        place = _point_inside(X[triangles[:, ::-1]])
    else:
        place = point(rest)
    for each in chambers_of(shape):
        if abs(solid_angles(each.corners - place).sum()) > 2 * np.pi:
            return replace(each, name=name, inside=place)
    places = "; ".join(show(np.round(each.inside, 1)) for each in chambers_of(shape))
    others = f"those of the body are around {places}" if places else "the body has none"
    raise ValueError(f"no closed inner surface is around {show(place)} mm; {others}")


def _enclosed(X: np.ndarray, triangles: np.ndarray, volume: float) -> tuple[Chamber, ...]:
    """Chambers of a body, the largest first: closed inner surfaces that enclose more than _LEAST of its `volume` mm^3.
    X (n, 3) mm, triangles (t, 3)."""
    _, part = components(triangles)
    voids = -volumes_within(X, triangles, part)
    largest_first = [number for number in np.argsort(-voids, kind="stable") if voids[number] > _LEAST * volume]
    chambers = []
    for index, number in enumerate(largest_first):
        name, corners = f"chamber-{index + 1}" if len(largest_first) > 1 else "chamber", X[triangles[part == number]]
        chambers.append(Chamber(name, _point_inside(corners), float(voids[number]), corners))
    return tuple(chambers)


def _point_inside(corners: np.ndarray) -> np.ndarray:
    """Point (3,) mm far from the walls (t, 3, 3), whose normals point into the void: half way across it from the middle
    of some facet, the one from which the way across is longest."""
    normals, middles = normals_of(corners), corners.mean(axis=1)
    areas = np.linalg.norm(normals, axis=1)
    best, longest = middles[0], -1.0
    for facet in np.argsort(-areas)[:40]:
        direction = normals[facet] / areas[facet]
        across = _first_hit(corners, middles[facet], direction, facet)
        place = middles[facet] + direction * across / 2
        room = float(np.linalg.norm(middles - place, axis=1).min()) if np.isfinite(across) else -1.0
        if room > longest:
            best, longest = place, room
    return best


def _first_hit(corners: np.ndarray, start: np.ndarray, direction: np.ndarray, left_out: int) -> float:
    """mm along a ray to the first of the triangles (Moeller and Trumbore, Journal of Graphics Tools 2, 1997); infinite
    where it meets none."""
    a, b, c = corners.swapaxes(0, 1)
    first, second = b - a, c - a
    across = np.cross(direction, second)
    det = (first * across).sum(axis=1)
    with np.errstate(all="ignore"):
        offset = start - a
        u = (offset * across).sum(axis=1) / det
        q = np.cross(offset, first)
        v = q @ direction / det
        distance = (second * q).sum(axis=1) / det
        hits = (np.abs(det) > 1e-14) & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (distance > 1e-9)
    hits[left_out] = False
    return float(distance[hits].min()) if hits.any() else np.inf
