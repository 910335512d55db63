"""A round body of cones in a row: as a solid, as a rod of plane sections, and what its sections amount to."""

from itertools import pairwise

import numpy as np

from cfem.mechanics.mesh import Mesh, tet_volumes
from cfem.mechanics.rod.region import CrossSection
from cfem.robot.cad import Frustum, Solid, Union
from cfem.robot.catalogue.sections import sliced_mesh, steps
from cfem.robot.geometry import Taper

SIDES = 8
# A polygon of eight sides as three quadrilaterals.
_LID = np.array([[0, 1, 2, 3], [0, 3, 4, 7], [4, 5, 6, 7]])
_SPAN = 3.0  # cells between places where the volume of the tetrahedra is that of the cones
_ROUNDS = 20
_GAUSS = (np.array([-1, 0, 1]) * np.sqrt(0.6), np.array([5, 8, 5]) / 18)


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


def section_shape(spec: Taper, places: np.ndarray, poisson: float) -> CrossSection:
    """Mean cross section of each element between neighbouring `places` (s,) mm, by Gauss's rule of three points.
    Sections are free to contract; shear as Cowper's for a circle of the main material."""
    middle, half = (places[1:] + places[:-1]) / 2, np.diff(places) / 2
    radii = np.interp(middle[:, None] + half[:, None] * _GAUSS[0], spec.places, spec.radii)
    area, bending = np.pi * radii**2 @ _GAUSS[1], np.pi / 4 * radii**4 @ _GAUSS[1]
    return CrossSection(area, bending, 2 * bending, True, 6 * (1 + poisson) / (7 + 6 * poisson))


def shifted(points: np.ndarray, y: float, z: float, outward: float) -> np.ndarray:
    """Points (k, 3) mm moved away from the x axis, then along y and z. Those on the axis stay there."""
    away = points[:, 1:] / np.maximum(np.linalg.norm(points[:, 1:], axis=1), 1e-300)[:, None]
    return points + np.column_stack([np.zeros(len(points)), outward * away + [y, z]])


def volume(spec: Taper) -> float:
    """Volume mm^3 of the cones."""
    a, b = spec.radii[:-1], spec.radii[1:]
    return float((np.pi / 3 * np.diff(spec.places) * (a * a + a * b + b * b)).sum())
