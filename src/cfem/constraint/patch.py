"""A force on a patch of a body's surface.

It spreads over all surface nodes within a radius of a point, each with its share of the area times a bump that fades to
the rim, (1 - (distance / radius)^2)^2: a dead load, as smooth as the mesh allows, and next to the same on another
mesh."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.contact.surface.triangles import closest
from cfem.core.errors import InputError, SpecError

LEAST = 4  # nodes of a patch
OFF = 0.5  # of the radius: how far from the surface its point may lie


@dataclass(frozen=True)
class PatchLoad:
    """A force on a patch of a surface.

    at: (3,) mm, a point of the surface at rest
    radius: mm
    force: (3,) N
    name: for messages"""

    at: np.ndarray
    radius: float
    force: np.ndarray
    name: str = "patch"

    def __post_init__(self) -> None:
        """Takes `at` and `force` as arrays. InputError where a number is not finite, or the radius not positive."""
        for key in ("at", "force"):
            value = np.asarray(getattr(self, key), float)
            object.__setattr__(self, key, value)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise InputError(
                    f"{key} of the load on {self.name!r} must have three finite numbers", do="give x, y and z"
                )
        if not 0 < self.radius < np.inf:
            raise InputError(f"the radius of the load on {self.name!r} must be above 0 mm, got {self.radius}")

    def __str__(self) -> str:
        force, place = (", ".join(f"{value:g}" for value in values) for values in (self.force, self.at))
        return f"{force} N on {self.name!r} at ({place}) mm, radius {self.radius:g} mm"

    def same(self, load: "PatchLoad") -> bool:
        """True where both loads agree but for the name and rounding."""
        a, b = (np.r_[patch.at, patch.radius, patch.force] for patch in (self, load))
        return np.allclose(a, b, rtol=1e-9, atol=0.0)

    def to_json(self) -> dict[str, Any]:
        """Plain data, whose keys are those of the constructor."""
        return {**vars(self), "at": self.at.tolist(), "force": self.force.tolist()}

    def shares(self, rest: np.ndarray, triangles: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Shares (m,) of the force, of sum 1, on the nodes rest (m, 3) mm of a surface; triangles (t, 3); weights (m,):
        shares of the area. SpecError where the point is not on the surface, or the radius catches too few nodes."""
        bary, distance = closest(rest[triangles], self.at)
        nearest = int(np.argmin(distance))
        place, where = ", ".join(f"{value:g}" for value in self.at), f"loads.{self.name}"
        if distance[nearest] > OFF * self.radius:
            nearest_place = ", ".join(f"{value:.4g}" for value in bary[nearest] @ rest[triangles[nearest]])
            what = f"({place}) mm is {distance[nearest]:.3g} mm off the surface, more than half of the radius"
            raise SpecError(what, where=where, do=f"take the nearest point of the surface, ({nearest_place}) mm")
        apart = np.linalg.norm(rest - self.at, axis=1)
        if (apart < self.radius).sum() < LEAST:
            count, needed = (apart < self.radius).sum(), np.sort(apart)[LEAST - 1]
            what = f"a radius of {self.radius:g} mm about ({place}) mm holds {count} nodes of the surface, not {LEAST}"
            raise SpecError(what, where=where, do=f"take a radius of more than {1.05 * needed:.2g} mm")
        shares = weights * np.maximum(1 - (apart / self.radius) ** 2, 0.0) ** 2
        return shares / shares.sum()
