"""A round body of cones in a row: as a solid, as a rod of plane sections, and what its sections amount to."""

from itertools import pairwise
from typing import Literal

import numpy as np

from cfem.core.spec import Spec
from cfem.core.units import LengthVector
from cfem.mechanics.mesh import Mesh, tet_volumes
from cfem.robot.cad import Frustum, Solid, Union
from cfem.robot.catalogue.sections import sliced_mesh, steps

SIDES = 8
# A polygon of eight sides as three quadrilaterals.
_LID = np.array([[0, 1, 2, 3], [0, 3, 4, 7], [4, 5, 6, 7]])
_SPAN = 3.0  # cells between places where the volume of the tetrahedra is that of the cones
_ROUNDS = 20


class Taper(Spec):
    """A round body along x from the origin, such as a tentacle: cones in a row."""

    kind: Literal["taper"]
    """A round body whose radius changes along its axis."""
    places: LengthVector
    """Places along x where the radius is given, from 0 to the length."""
    radii: LengthVector
    """Radius at each place. It is linear in between."""

    def check(self) -> None:
        places, radii = self.places, self.radii
        if len(places) < 2 or len(places) != len(radii):
            raise ValueError(f"taper: needs as many places as radii, at least two; got {len(places)} and {len(radii)}")
        if places[0] != 0 or not (places[1:] > places[:-1]).all():
            raise ValueError("taper: places must begin at 0 and ascend")
        if not (radii > 0).all():
            raise ValueError("taper: radii must be above 0")


def taper(spec: Taper) -> Solid:
    """Solid of the cones, joined."""
    parts = tuple(
        Frustum((float(a), 0.0, 0.0), (float(b - a), 0.0, 0.0), float(r), float(s))
        for (a, b), (r, s) in zip(pairwise(spec.places), pairwise(spec.radii), strict=True)
    )
    return parts[0] if len(parts) == 1 else Union(parts)


def rod_mesh(spec: Taper, size: float) -> Mesh:
    """Mesh of plane sections, each a node set, at most `size` mm apart, one at every place where the radius is given.
    The hexahedra between them carry pictures and attachments."""
    places = steps(spec.places, size)
    angles = (np.arange(SIDES) + 0.5) * 2 * np.pi / SIDES
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    radii = np.interp(places, spec.places, spec.radii)
    sections = [np.column_stack([np.full(SIDES, x), r * ring]) for x, r in zip(places, radii, strict=True)]
    return sliced_mesh(sections, _LID)


def filled(spec: Taper, X: np.ndarray, cells: np.ndarray, size: float) -> np.ndarray:
    """X (n, 3) mm of tetrahedra with the nodes of their skin moved outward, so that they hold as much as the cones all
    along. Flat facets between nodes on a circle cut it short: by 4.5 % of its area with twelve of them, and the bending
    stiffness by twice that."""
    count = max(int(spec.places[-1] / (_SPAN * size)), 1) + 1
    knots = np.linspace(0, spec.places[-1], count)
    step = spec.places[-1] / (200 * count)
    fine = (np.arange(200 * count) + 0.5) * step
    wanted = _hats(knots, fine, np.pi * np.interp(fine, spec.places, spec.radii) ** 2 * step)
    radius = np.interp(X[:, 0], spec.places, spec.radii)
    skin = np.linalg.norm(X[:, 1:], axis=1) > (1 - 1e-6) * radius
    factor, moved = np.ones(count), X.copy()
    for _ in range(_ROUNDS):
        volumes = _hats(knots, moved[cells].mean(axis=1)[:, 0], np.abs(tet_volumes(moved, cells)))
        factor *= np.sqrt(wanted / volumes)
        moved[skin, 1:] = X[skin, 1:] * np.interp(X[skin, 0], knots, factor)[:, None]
    return moved


def _hats(knots: np.ndarray, places: np.ndarray, amounts: np.ndarray) -> np.ndarray:
    """Sums (k,) at the knots of amounts at places, each shared between the two knots beside it."""
    left = np.clip(np.searchsorted(knots, places) - 1, 0, len(knots) - 2)
    part = (places - knots[left]) / (knots[left + 1] - knots[left])
    count = len(knots)
    return np.bincount(left, amounts * (1 - part), count) + np.bincount(left + 1, amounts * part, count)


def shifted(points: np.ndarray, y: float, z: float, outward: float) -> np.ndarray:
    """Points (k, 3) mm moved away from the x axis, then along y and z. Those on the axis stay there."""
    away = points[:, 1:] / np.maximum(np.linalg.norm(points[:, 1:], axis=1), 1e-300)[:, None]
    return points + np.column_stack([np.zeros(len(points)), outward * away + [y, z]])


def volume(spec: Taper) -> float:
    """Volume mm^3 of the cones."""
    a, b = spec.radii[:-1], spec.radii[1:]
    return float((np.pi / 3 * np.diff(spec.places) * (a * a + a * b + b * b)).sum())
