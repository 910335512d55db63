"""Signed distance to rigid obstacles, positive outside, its outward gradient, and a frame of the surface.

An obstacle is a shape and its pose, x = R s + t from the shape's own coordinates s; a moving one is given a new
pose with `dataclasses.replace`. Distances are exact on both sides. Where several points of the surface are the
nearest (at a sphere's centre, say), the normal is one of theirs. Formulas: Hart, *Sphere tracing* (1996), appendix."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from cfem.contact.closed_surface import ClosedSurface
from cfem.core.errors import SpecError


class Obstacle(Protocol):
    """points (k, 3) mm."""

    def at_least(self, corners: np.ndarray, wanted: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """(k,) mm: at the centroids of triangles (k, 3, 3), and a bound each that none of its points is nearer than.
        Bounds above `wanted` need not be sharp."""
        ...

    def distance(self, points: np.ndarray) -> np.ndarray:
        """(k,) mm."""
        ...

    def normals(self, points: np.ndarray) -> np.ndarray:
        """(k, 3) unit gradients of the distance."""
        ...

    def frames(self, points: np.ndarray) -> np.ndarray:
        """(k, 3, 3) rows n, t1, t2, right-handed; they turn with the pose."""
        ...


@dataclass(frozen=True)
class _Posed(ABC):
    """R (3, 3) a rotation, t (3,) mm."""

    R: np.ndarray = field(default_factory=lambda: np.eye(3), kw_only=True)
    t: np.ndarray = field(default_factory=lambda: np.zeros(3), kw_only=True)

    def __post_init__(self) -> None:
        rotates = np.allclose(self.R @ self.R.T, np.eye(3), atol=1e-9) and np.linalg.det(self.R) > 0
        _demand(rotates, "R is not a rotation")
        _demand(np.isfinite(self.t).all(), "its place must be finite numbers, mm")

    def distance(self, points: np.ndarray) -> np.ndarray:
        return self._local((points - self.t) @ self.R)[0]

    def normals(self, points: np.ndarray) -> np.ndarray:
        return self._local((points - self.t) @ self.R)[1] @ self.R.T

    def frames(self, points: np.ndarray) -> np.ndarray:
        return tangents(self._local((points - self.t) @ self.R)[1]) @ self.R.T

    def at_least(self, corners: np.ndarray, wanted: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """The distance of a convex shape is a convex function, so nowhere below its tangent at the centroid."""
        centroid = corners.mean(axis=1)
        distance, normal = self._local((centroid - self.t) @ self.R)
        along = np.einsum("kci,ki->kc", corners - centroid[:, None], normal @ self.R.T)
        return distance, distance + along.min(axis=1)

    @abstractmethod
    def _local(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (k,) and normal (k, 3) in the shape's coordinates."""


@dataclass(frozen=True)
class Plane(_Posed):
    """The half space below its own z = 0."""

    def _local(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return s[:, 2], np.tile([0.0, 0.0, 1.0], (len(s), 1))


@dataclass(frozen=True)
class Sphere(_Posed):
    """About its own origin; radius mm."""

    radius: float

    def __post_init__(self) -> None:
        super().__post_init__()
        _demand(self.radius > 0, "the radius of a sphere must be above 0 mm")

    def _local(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _from_core(s, self.radius)


@dataclass(frozen=True)
class Capsule(_Posed):
    """The points within `radius` mm of a segment of its own z axis, from -half_length to half_length mm."""

    radius: float
    half_length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        _demand(self.radius > 0, "the radius of a capsule must be above 0 mm")
        _demand(self.half_length >= 0, "the half length of a capsule must be 0 mm or more")

    def _local(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nearest = np.zeros_like(s)
        nearest[:, 2] = np.clip(s[:, 2], -self.half_length, self.half_length)
        return _from_core(s - nearest, self.radius)


@dataclass(frozen=True)
class Box(_Posed):
    """half (3,) mm: half extents about its own origin."""

    half: np.ndarray

    def __post_init__(self) -> None:
        super().__post_init__()
        half = np.asarray(self.half, float)
        _demand(half.shape == (3,) and (half > 0).all(), "the three half extents of a box must be above 0 mm")

    def _local(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        excess = np.abs(s) - self.half
        sign = np.where(s < 0, -1.0, 1.0)
        out = np.maximum(excess, 0.0)
        away = np.linalg.norm(out, axis=1)
        outside = away > 0
        face = np.eye(3)[np.argmax(excess, axis=1)]
        normal = sign * np.where(outside[:, None], out / np.where(outside, away, 1.0)[:, None], face)
        return np.where(outside, away, excess.max(axis=1)), normal


@dataclass(frozen=True, eq=False)
class ClosedMesh(_Posed):
    """What a closed surface of triangles bounds (`cfem.contact.closed_surface`, `read_stl`). A new pose costs nothing:
    the surface is checked and searched in its own coordinates."""

    surface: ClosedSurface

    def at_least(self, corners: np.ndarray, wanted: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        return self.surface.at_least((corners - self.t) @ self.R, wanted)

    def _local(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.surface.distance(s)


def _demand(holds: bool, what: str) -> None:
    if not holds:
        raise SpecError(f"obstacle: {what}")


def _from_core(apart: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """apart (k, 3): from the nearest point of a round shape's core; on the core itself the normal is x."""
    away = np.linalg.norm(apart, axis=1)
    on = away == 0.0
    normal = np.where(on[:, None], [1.0, 0.0, 0.0], apart / np.where(on, 1.0, away)[:, None])
    return away - radius, normal


def tangents(normals: np.ndarray) -> np.ndarray:
    """(k, 3, 3) rows n, t1, t2 for unit normals (k, 3): x, y, z turned by the shortest way that brings
    z to n, so smooth but for a jump near n = -z, which no field of frames can avoid (Duff et al., *Building an
    Orthonormal Basis, Revisited*, 2017, with the jump moved from the equator to 8 degrees from the pole)."""
    x, y, z = normals.T
    sign = np.where(z < -0.99, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    t1 = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
    t2 = np.stack([b, sign + y * y * a, -y], axis=1)
    return np.stack([normals, t1, t2], axis=1)
