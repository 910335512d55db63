"""Flat faces at the ends of a body, inclined to the axes or not."""

from dataclasses import dataclass

import numpy as np

from cfem.constraint.attachment import show
from cfem.constraint.surface import triangulated
from cfem.contact.surface.triangles import normals_of
from cfem.core.errors import SpecError
from cfem.init.body.section import cut_across
from cfem.init.body.shape import Shape
from cfem.robot.selection import Plane

_FLAT = 1e-4  # of the largest extent: single precision of a file that is far from its origin
_SLANT = 0.6  # cosine between an axis and the normal of a face at its end
_LARGE = 0.5  # of the section behind it
_BEHIND = 0.02  # of the largest extent, where that section is


@dataclass(frozen=True)
class Face:
    """centre (3,) mm and outward unit normal (3,), as tuples; depth: mm, within which nodes are on it."""

    centre: tuple[float, float, float]
    normal: tuple[float, float, float]
    depth: float

    @property
    def inside(self) -> np.ndarray:
        """Point (3,) mm behind its centre, rounded."""
        step = 10.0 ** np.floor(np.log10(self.depth) - 0.5)
        return np.round((self.centre - self.depth * np.array(self.normal)) / step) * step

    def beyond(self) -> Plane:
        """The region of the scene that holds its nodes."""
        return Plane(kind="plane", point={"mm": self.inside.tolist()}, normal=list(self.normal))

    def holds(self, place: np.ndarray) -> bool:
        """True where a point (3,) mm is on it or beyond."""
        return bool(np.dot(place - np.array(self.centre), self.normal) >= -self.depth)


def end_face(shape: Shape, axis: int, below: bool) -> Face | None:
    """The largest flat face that looks along an axis, `below` against it, at the end of the body; None where those
    are smaller than half of the body behind them."""
    corners, normals, areas = _facets(shape)
    looks = normals[:, axis] * (-1 if below else 1) > _SLANT
    best, largest = None, 0.0
    while looks.any():
        first = int(np.where(looks, areas, 0.0).argmax())
        flat = _coplanar(shape, corners, normals, first)
        looks[first] = False
        looks &= ~flat
        if areas[flat].sum() > largest and _bounds(shape, corners[flat], normals[first]):
            best, largest = _face(shape, corners[flat], areas[flat], normals[first]), float(areas[flat].sum())
    if best is None:
        return None
    behind = np.subtract(best.centre, _BEHIND * shape.extent.max() * np.array(best.normal))
    section = cut_across(shape.interior, behind, np.array(best.normal))
    return best if section is not None and largest > _LARGE * section.area else None


def face_at(shape: Shape, place: np.ndarray) -> Face:
    """The flat face around the facet that is nearest to a point (3,) mm. SpecError where the body goes beyond it."""
    corners, normals, areas = _facets(shape)
    shares = np.array([[i, j, 6 - i - j] for i in range(7) for j in range(7 - i)]) / 6
    near = np.linalg.norm(np.einsum("sc,tcd->tsd", shares, corners) - place, axis=2).min(axis=1)
    first = int(near.argmin())
    flat = _coplanar(shape, corners, normals, first)
    if not _bounds(shape, corners[flat], normals[first]):
        what = f"the body goes beyond the face at {show(np.round(place, 3))} mm"
        raise SpecError(what, do="name a flat face at an end of the body, or write 'z <= 5 mm'")
    return _face(shape, corners[flat], areas[flat], normals[first])


def _facets(shape: Shape) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners (t, 3, 3) mm, outward unit normals (t, 3) and areas (t,) mm^2 of the surface's triangles."""
    corners = shape.mesh.X[triangulated(shape.mesh.facets)]
    normals = normals_of(corners)
    lengths = np.linalg.norm(normals, axis=1)
    return corners, normals / np.where(lengths > 0, lengths, 1.0)[:, None], lengths / 2


def _coplanar(shape: Shape, corners: np.ndarray, normals: np.ndarray, first: int) -> np.ndarray:
    """Mask (t,) of the triangles in the plane of one of them, and on its side."""
    apart = np.abs((corners - corners[first].mean(axis=0)) @ normals[first]).max(axis=1)
    return (apart < _FLAT * shape.mesh.size) & (normals @ normals[first] > 0)


def _bounds(shape: Shape, corners: np.ndarray, normal: np.ndarray) -> bool:
    """True where all of the body is behind a face."""
    return bool(((shape.mesh.X - corners.mean(axis=(0, 1))) @ normal).max() < _FLAT * shape.mesh.size)


def _face(shape: Shape, corners: np.ndarray, areas: np.ndarray, normal: np.ndarray) -> Face:
    centre = (corners.mean(axis=1) * areas[:, None]).sum(axis=0) / areas.sum()
    step = 10.0 ** (np.floor(np.log10(shape.mesh.size)) - 4)
    centre = np.round(centre / step) * step
    return Face(tuple(centre.tolist()), tuple(normal.tolist()), _FLAT * shape.mesh.size)
