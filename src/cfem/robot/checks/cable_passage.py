"""Places where a cable leaves the body between its points."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cfem.constraint.attachment import distance_outside, show, tolerance_outside
from cfem.core.errors import SpecError
from cfem.mechanics.element import SECTIONED
from cfem.mechanics.mesh import Mesh
from cfem.robot.catalogue.stiff_flop import StiffFlop
from cfem.robot.constraints import Cable
from cfem.robot.places import cable_points
from cfem.robot.selection import cells_of
from cfem.robot.spec import SceneSpec

_STEP, _FEWEST, _MOST = 0.25, 10, 200  # of samples along a segment: in mean sizes of a cell, and how many


@dataclass(frozen=True)
class Gap:
    """A segment of a cable that leaves the body."""

    segment: int  # from the point of this number to the next
    length: float  # mm of it that lie outside
    distance: float  # mm from the body at its farthest
    where: np.ndarray  # (3,) mm, that farthest place


def demand_inside(scene: SceneSpec, mesh: Mesh) -> None:
    """Raises SpecError where a cable leaves the body without being allowed to. A route along a soft finger crosses its
    bellows by design, and the sections of a stiff-flop are rigid."""
    if isinstance(scene.geometry, StiffFlop) or scene.mesh.element in SECTIONED:
        return
    for index, item in enumerate(scene.actuators):
        if not isinstance(item, Cable) or item.through_air or item.route is not None:
            continue
        with scene.locating("actuators", index):
            outside = gaps(mesh, cable_points(scene, item), item.radius, item.body)
        if outside:
            worst = max(outside, key=lambda gap: gap.length)
            more = f"; {len(outside) - 1} more segments leave it too" if len(outside) > 1 else ""
            what = (
                f"cable '{item.name}' leaves the body between points {worst.segment} and {worst.segment + 1}: "
                f"for {worst.length:.3g} mm, up to {worst.distance:.3g} mm away, at {show(np.round(worst.where, 1))} mm"
            )
            do = "move the points, add some along the body, or set through_air: true where it is meant"
            raise SpecError(what + more, where=scene.place("actuators", index, "points", worst.segment), do=do)


def gaps(mesh: Mesh, points: np.ndarray, radius: float, body: str | None = None) -> list[Gap]:
    """Segments of a cable through points (k, 3) mm that leave the body by more than attached points may."""
    cells = None if body is None else cells_of(mesh, body, "body")
    allowed, size = tolerance_outside(mesh, radius), float(np.cbrt(np.abs(mesh.volumes).mean()))
    outside = []
    for segment, (start, end) in enumerate(pairwise(points)):
        length = float(np.linalg.norm(end - start))
        count = int(np.clip(length / (_STEP * size), _FEWEST, _MOST))
        along = start + np.linspace(0, 1, count + 1)[:, None] * (end - start)
        away = distance_outside(mesh, along, cells)
        if away.max() > allowed:
            share = (away > allowed).mean()
            outside.append(Gap(segment, float(share * length), float(away.max()), along[away.argmax()]))
    return outside
