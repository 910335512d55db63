"""Signed distance to rigid obstacles, positive outside, its outward gradient, and a frame of the surface.

An obstacle is a shape and its pose, x = R s + t from the shape's own coordinates s; a moving one is given a new
pose with `dataclasses.replace`. Distances are exact on both sides. Where several points of the surface are the
nearest (at a sphere's centre, say), the normal is one of theirs. Formulas: Hart, *Sphere tracing* (1996), appendix."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Protocol, Self

import numpy as np

from cfem.contact.surface.closed_surface import ClosedSurface
from cfem.core.errors import SpecError

AXES = np.eye(3)
ROOT, EXACT = 100, 1e-14  # steps of Newton's method at most, and where it stops


class Obstacle(Protocol):
    """A rigid body of which the signed distance is known; points are (k, 3) mm."""

    def at_least(self, corners: np.ndarray, wanted: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """Distances (k,) mm at the centroids of triangles (k, 3, 3) mm, and a lower bound (k,) mm of the distance of
        each triangle. Bounds above `wanted` need not be sharp."""
        ...

    def posed(self, R: np.ndarray, t: np.ndarray) -> Self:
        """Returns the shape in another pose, which is not checked."""
        ...

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Signed distances (k,) mm, positive outside."""
        ...

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Unit gradients (k, 3) of the distance."""
        ...

    def frames(self, points: np.ndarray) -> np.ndarray:
        """Frames (k, 3, 3) with rows n, t1, t2, right-handed; they turn with the pose."""
        ...


@dataclass(frozen=True)
class _Posed(ABC):
    """An obstacle with a pose: rotation R (3, 3) and place t (3,) mm."""

    curved = False  # whether `bends` is more than 0
    R: np.ndarray = field(default_factory=lambda: np.eye(3), kw_only=True)
    t: np.ndarray = field(default_factory=lambda: np.zeros(3), kw_only=True)

    def __post_init__(self) -> None:
        rotates = np.allclose(self.R @ self.R.T, np.eye(3), atol=1e-9) and np.linalg.det(self.R) > 0
        _demand(rotates, "R is not a rotation")
        _demand(np.isfinite(self.t).all(), "its place must be finite numbers, mm")

    def posed(self, R: np.ndarray, t: np.ndarray) -> Self:
        posed = object.__new__(type(self))  # many a step, where checks would take most of the time
        posed.__dict__.update(self.__dict__, R=R, t=t)
        return posed

    def distance(self, points: np.ndarray) -> np.ndarray:
        return self._local((points - self.t) @ self.R)[0]

    def normals(self, points: np.ndarray) -> np.ndarray:
        return self._local((points - self.t) @ self.R)[1] @ self.R.T

    def frames(self, points: np.ndarray) -> np.ndarray:
        return tangents(self._local((points - self.t) @ self.R)[1]) @ self.R.T

    def at_least(self, corners: np.ndarray, wanted: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """Distances and bounds as `Obstacle.at_least`, of a convex shape: its distance is a convex function, so nowhere
        below its tangent at the centroid."""
        centroid = corners.mean(axis=1)
        distance, normal = self._local((centroid - self.t) @ self.R)
        along = np.einsum("kci,ki->kc", corners - centroid[:, None], normal @ self.R.T)
        return distance, distance + along.min(axis=1)

    def bends(self, points: np.ndarray) -> np.ndarray:
        """Derivative (k, 3, 3) 1/mm of the normal by the place; 0 on flat faces, and at edges, where there is none."""
        return self.R @ self._bends((points - self.t) @ self.R) @ self.R.T

    def _bends(self, s: np.ndarray) -> np.ndarray:
        """Derivative (k, 3, 3) 1/mm of the normal in the shape's coordinates."""
        return np.zeros((len(s), 3, 3))

    @abstractmethod
    def _local(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (k,) and normal (k, 3) in the shape's coordinates."""


class Rounded(_Posed):
    """The points within `rounding` mm of a box about its own origin, of half extents `core` (3,) mm; infinite ones are
    those of a half space, which is all below its own z = 0."""

    core: np.ndarray
    rounding: float

    def _local(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return rounded(s, self.core, self.rounding, np.isinf(self.core[0]))


@dataclass(frozen=True)
class Plane(Rounded):
    """The half space below its own z = 0."""

    core, rounding = np.array([np.inf, np.inf, 0.0]), 0.0


@dataclass(frozen=True)
class Sphere(Rounded):
    """The points within `radius` mm of its own origin."""

    radius: float
    core = np.zeros(3)

    def __post_init__(self) -> None:
        super().__post_init__()
        _demand(self.radius > 0, "the radius of a sphere must be above 0 mm")

    @property
    def rounding(self) -> float:
        return self.radius


@dataclass(frozen=True)
class Capsule(Rounded):
    """The points within `radius` mm of a segment of its own z axis, from -half_length to half_length mm."""

    radius: float
    half_length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        _demand(self.radius > 0, "the radius of a capsule must be above 0 mm")
        _demand(self.half_length >= 0, "the half length of a capsule must be 0 mm or more")

    @property
    def core(self) -> np.ndarray:
        return np.array([0.0, 0.0, self.half_length])

    @property
    def rounding(self) -> float:
        return self.radius


@dataclass(frozen=True)
class Box(Rounded):
    """A box about its own origin with half extents `half` (3,) mm."""

    half: np.ndarray
    rounding = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        half = np.asarray(self.half, float)
        _demand(half.shape == (3,) and (half > 0).all(), "the three half extents of a box must be above 0 mm")

    @property
    def core(self) -> np.ndarray:
        return np.asarray(self.half, float)


@dataclass(frozen=True)
class Cylinder(_Posed):
    """The points within `radius` mm of its own z axis, between -half_length and half_length mm."""

    radius: float
    half_length: float
    curved = True

    def __post_init__(self) -> None:
        super().__post_init__()
        _demand(self.radius > 0 and self.half_length > 0, "radius and half length of a cylinder must be above 0 mm")

    def _local(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance to a rectangle, in the plane of the axis and the point."""
        r = np.hypot(s[:, 0], s[:, 1])
        x, y = np.where(r[:, None] > 0, s[:, :2], [1.0, 0.0]).T / np.where(r > 0, r, 1.0)
        section = np.column_stack([r, np.zeros(len(s)), s[:, 2]])
        distance, n = rounded(section, np.array([self.radius, np.inf, self.half_length]), 0.0, False)
        return distance, np.column_stack([n[:, 0] * x, n[:, 0] * y, n[:, 2]])

    def _bends(self, s: np.ndarray) -> np.ndarray:
        n = self._local(s)[1]
        around = np.column_stack([-n[:, 1], n[:, 0], np.zeros(len(s))])
        of_side = (n[:, 2] == 0) / np.maximum(np.hypot(s[:, 0], s[:, 1]), 1e-9 * self.radius)
        return of_side[:, None, None] * around[:, :, None] * around[:, None]


@dataclass(frozen=True)
class Ellipsoid(_Posed):
    """The points of an ellipsoid about its own origin with half axes `half` (3,) mm along its own axes."""

    half: np.ndarray
    curved = True

    def __post_init__(self) -> None:
        super().__post_init__()
        half = np.asarray(self.half, float)
        _demand(half.shape == (3,) and (half > 0).all(), "the three half axes of an ellipsoid must be above 0 mm")

    def _local(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The nearest point of the surface is x_i = a_i^2 s_i / (u + a_i^2), where u is the largest root of a convex
        function, which Newton's method approaches from below (Eberly, *Distance from a point to an ellipse, an
        ellipsoid, or a hyperellipsoid*, 2013)."""
        a = np.asarray(self.half, float)
        p = np.maximum(np.abs(s), 1e-9 * a)
        u = (a * p - a**2).max(axis=1)
        for _ in range(ROOT):
            share = a * p / (u[:, None] + a**2)
            left = (share**2).sum(axis=1) - 1
            if (left <= EXACT).all():
                break
            u = u + left / (2 * share**2 / (u[:, None] + a**2)).sum(axis=1)
        x = a**2 * p / (u[:, None] + a**2)
        n = np.where(s < 0, -1.0, 1.0) * x / a**2
        n /= np.linalg.norm(n, axis=1)[:, None]
        return np.sign(u) * np.linalg.norm(p - x, axis=1), n

    def _bends(self, s: np.ndarray) -> np.ndarray:
        """S (1 + d S)^-1 with the curvature S of the surface at the nearest point, d away."""
        d, n = self._local(s)
        flat, slope = np.eye(3) - n[:, :, None] * n[:, None], np.diag(np.asarray(self.half, float) ** -2)
        S = flat @ slope @ flat / np.linalg.norm((s - d[:, None] * n) @ slope, axis=1)[:, None, None]
        return np.linalg.solve(np.eye(3) + d[:, None, None] * S, S)


@dataclass(frozen=True, eq=False)
class ClosedMesh(_Posed):
    """What a closed surface of triangles bounds (`cfem.contact.surface.closed_surface`, `read_stl`). A new pose costs
    nothing: the surface is checked and searched in its own coordinates."""

    surface: ClosedSurface

    def at_least(self, corners: np.ndarray, wanted: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        return self.surface.at_least((corners - self.t) @ self.R, wanted)

    def _local(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.surface.distance(s)


def _demand(holds: bool, what: str) -> None:
    if not holds:
        raise SpecError(f"obstacle: {what}")


def rounded(
    s: np.ndarray, core: np.ndarray, rounding: np.ndarray | float, below: np.ndarray | bool
) -> tuple[np.ndarray, np.ndarray]:
    """Distance (k,) mm and its gradient (k, 3) at own coordinates s (k, 3) of rounded boxes: of one, or of one a point,
    core (k, 3), rounding (k,), below (k, 1)."""
    excess = np.where(below, s, np.abs(s)) - core
    out = np.maximum(excess, 0.0)
    away = np.sqrt((out * out).sum(axis=1))
    outside = away > 0
    upwards = np.where(outside[:, None], out, AXES[excess.argmax(axis=1)])
    normal = np.where((s < 0) & ~np.asarray(below), -upwards, upwards) / np.where(outside, away, 1.0)[:, None]
    return np.where(outside, away, excess.max(axis=1)) - rounding, normal


def tangents(normals: np.ndarray) -> np.ndarray:
    """Frames (k, 3, 3) with rows n, t1, t2 for unit normals (k, 3): x, y, z turned by the shortest way that brings
    z to n, so smooth but for a jump near n = -z, which no field of frames can avoid (Duff et al., *Building an
    Orthonormal Basis, Revisited*, 2017, with the jump moved from the equator to 8 degrees from the pole)."""
    x, y, z = normals.T
    sign = np.where(z < -0.99, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    frames = np.empty((len(normals), 3, 3))
    frames[:, 0] = normals
    frames[:, 1, 0], frames[:, 1, 1], frames[:, 1, 2] = 1.0 + sign * x * x * a, sign * b, -sign * x
    frames[:, 2, 0], frames[:, 2, 1], frames[:, 2, 2] = b, sign + y * y * a, -y
    return frames
