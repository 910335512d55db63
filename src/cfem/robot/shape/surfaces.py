"""The surfaces of a CAD tree as functions that vanish on them, in an order that depends on the tree's shape alone.

Two designs of one catalogue robot have the same tree with other numbers, so that a surface of one is known in the
other by its place."""

from dataclasses import dataclass

import numpy as np

from cfem.robot.cad import Box, Difference, Frustum, Loft, Prism, Solid, Union


@dataclass(frozen=True)
class PlaneSurface:
    """Plane x . normal = offset mm, with a unit normal (3,)."""

    normal: np.ndarray
    offset: float

    def value(self, x: np.ndarray) -> np.ndarray:
        """Signed distances (k,) mm of points x (k, 3) mm."""
        return x @ self.normal - self.offset

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Gradients (k, 3) of `value`."""
        return np.broadcast_to(self.normal, x.shape)


@dataclass(frozen=True)
class ConeSurface:
    """Cone about the line through `base` (3,) mm along the unit `axis` (3,): its radius is `radius` mm at the base, and
    changes by `slope` per mm along the axis."""

    base: np.ndarray
    axis: np.ndarray
    radius: float
    slope: float

    def value(self, x: np.ndarray) -> np.ndarray:
        along = (x - self.base) @ self.axis
        across = x - self.base - along[:, None] * self.axis
        return (np.linalg.norm(across, axis=1) - self.radius - self.slope * along) / np.hypot(1.0, self.slope)

    def gradient(self, x: np.ndarray) -> np.ndarray:
        along = (x - self.base) @ self.axis
        across = x - self.base - along[:, None] * self.axis
        away = np.linalg.norm(across, axis=1)[:, None]
        return (across / np.where(away > 0, away, 1.0) - self.slope * self.axis) / np.hypot(1.0, self.slope)


Surface = PlaneSurface | ConeSurface


def surfaces(solid: Solid) -> list[Surface]:
    """Surfaces of all primitives of a CAD tree. ValueError for a file or a placed solid, whose surfaces are not
    known."""
    match solid:
        case Union(parts):
            return [surface for part in parts for surface in surfaces(part)]
        case Difference(minuend, parts):
            return [surface for part in (minuend, *parts) for surface in surfaces(part)]
        case Box(low, high):
            return [PlaneSurface(axis, end[i]) for i, axis in enumerate(np.eye(3)) for end in (low, high)]
        case Prism(polygon, x_low, x_high):
            corners = np.array([(0.0, *corner) for corner in polygon])
            ends = np.roll(corners, -1, axis=0)
            sides = [_through(a, b, b + [1.0, 0, 0]) for a, b in zip(corners, ends, strict=True)]
            return [*sides, PlaneSurface(np.eye(3)[0], x_low), PlaneSurface(np.eye(3)[0], x_high)]
        case Frustum(base, axis, r0, r1):
            length = float(np.linalg.norm(axis))
            unit, foot = np.array(axis) / length, np.array(base, float)
            ends = [PlaneSurface(unit, float(foot @ unit)), PlaneSurface(unit, float(foot @ unit) + length)]
            return [ConeSurface(foot, unit, r0, (r1 - r0) / length), *ends]
        case Loft(first, second):
            bottom, top = np.array(first, float), np.array(second, float)
            following = np.roll(bottom, -1, axis=0)
            sides = [_through(a, b, c) for a, b, c in zip(bottom, following, top, strict=True)]
            return [*sides, _through(*bottom[:3]), _through(*top[:3])]
    raise ValueError(f"the surfaces of a {type(solid).__name__} are not known")


def _through(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> PlaneSurface:
    """The plane of three points (3,)."""
    normal = np.cross(b - a, c - a)
    normal = normal / np.linalg.norm(normal)
    return PlaneSurface(normal, float(normal @ a))
