"""The point that is watched."""

import numpy as np

from cfem.constraint.attachment import locate
from cfem.init.body.face import end_face
from cfem.init.body.section import cut
from cfem.init.body.shape import Shape
from cfem.init.hold import Run, is_flat
from cfem.mechanics.mesh import Mesh

_BEFORE = (0.0005, 0.02, 0.05, 0.1)  # the tip, in shares of the length
_CARRIERS = 20  # nodes of the coarse mesh


def guess_watched(shape: Shape, run: Run) -> tuple[np.ndarray, str]:
    """Watched point (3,) mm, and what it is in words: the centre of the free end where that lies in the body, else a
    centre a little before it, else the centre outside the body."""
    step = 10.0 ** np.round(np.log10(run.length) - 3)
    sections = [cut(shape.interior, run.axis, run.inwards(share * run.length)) for share in _BEFORE]
    sections = [section for section in sections if section is not None]
    places = [np.round(section.centre / step) * step for section in sections]
    if sections and is_flat(shape, run.axis, run.tip, sections[0].area):
        face = places[0].copy()
        face[run.axis] = run.tip
        places.insert(0, face)
    elif (inclined := end_face(shape, run.axis, run.forward < 0)) is not None:
        places.insert(0, inclined.inside)
    if not places:
        middle = (shape.low + shape.high) / 2
        middle[run.axis] = run.tip
        places = [middle]
    for place in places:
        if is_inside(shape.mesh, place):
            return place, "the centre of the free end"
    return places[0], "the centre of the free end, which lies outside the body: what is near carries it"


def is_inside(mesh: Mesh, place: np.ndarray) -> bool:
    return bool(locate(mesh, place[None], within=1e-9)[0][0] >= 0)


def carrier_radius(mesh: Mesh, place: np.ndarray) -> float:
    """mm, around a point outside the body: far enough to reach some part of it."""
    apart = np.sort(np.linalg.norm(mesh.X - place, axis=1))
    return float(1.2 * apart[min(_CARRIERS, len(apart)) - 1])
