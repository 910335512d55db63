"""What of the body is held, and along which axis it stretches from there."""

import re
from dataclasses import dataclass

import numpy as np

from cfem.core.errors import SpecError
from cfem.core.units import parse_quantity
from cfem.init.body.face import Face, end_face, face_at
from cfem.init.body.section import cut
from cfem.init.body.shape import Shape, surface_area
from cfem.init.question import point
from cfem.robot.selection import Named, Plane, select_nodes

AXES = "xyz"
FACES = {"left": "x <=", "right": "x >=", "front": "y <=", "back": "y >=", "bottom": "z <=", "top": "z >="}
_SET_NAME = re.compile(r"(?i)(?<![a-z])(fix|clamp|held|hold|encastre|base|mount|root)")  # words that begin so
_FACE = "face at "
_SLICES = (0.05, 0.1, 0.15)  # of the length, where the end is not flat
_THICKER = 1.15


@dataclass(frozen=True)
class Hold:
    """The half space beyond `level` mm of an axis: held where the coordinate is smaller (below) or larger. name: the
    set of the mesh, face: the flat face that is held in its place."""

    axis: int
    below: bool
    level: float
    name: str | None = None
    face: Face | None = None

    def selection(self) -> Plane | Named:
        """Region of the scene that is held."""
        if self.name is not None:
            return Named(kind="name", name=self.name)
        if self.face is not None:
            return self.face.beyond()
        normal = np.eye(3)[self.axis] * (-1 if self.below else 1)
        return Plane(kind="plane", point={"mm": (np.eye(3)[self.axis] * self.level).tolist()}, normal=normal.tolist())

    def holds(self, place: np.ndarray) -> bool:
        """True where what is held is a half space with a point (3,) mm inside."""
        if self.face is not None:
            return self.face.holds(place)
        beyond = (self.level - place[self.axis]) * (1 if self.below else -1)
        return self.name is None and bool(beyond >= -1e-9 * abs(self.level))

    def __str__(self) -> str:
        if self.face is not None:
            return f"{_FACE}{', '.join(f'{value + 0.0:.6g}' for value in self.face.centre)} mm"
        level = 0.0 if abs(self.level) < 1e-12 else self.level
        return self.name or f"{AXES[self.axis]} {'<=' if self.below else '>='} {level:.9g} mm"


@dataclass(frozen=True)
class Run:
    """The way from the held end to the free end along an axis, by coordinates in mm: base, the body's end; level, up to
    where it is held; tip, the other end."""

    axis: int
    base: float
    level: float
    tip: float

    @property
    def length(self) -> float:
        """mm, of the whole body."""
        return abs(self.tip - self.base)

    @property
    def forward(self) -> float:
        """1 or -1: from the base to the tip."""
        return float(np.sign(self.tip - self.base))

    def inwards(self, depth: float) -> float:
        """The coordinate `depth` mm before the tip."""
        return self.tip - self.forward * depth


def read_hold(text: str, shape: Shape) -> Hold:
    """'z <= 5 mm', 'bottom' and its like, 'face at 1, 2, 3 mm', or the name of a set of the mesh. SpecError where it
    holds nothing, too little, or everything."""
    hold = read_part(text, shape)
    held = _held_nodes(shape, hold)
    if not _holds(held):
        raise SpecError(f"'{text}' holds {len(held)} nodes on one line, about which the body can turn", do="hold more")
    run = run_from(hold, shape)
    if (run.tip - run.level) * run.forward < 0.1 * run.length:
        raise SpecError(f"'{text}' holds all of the body or nearly so", do=_between(shape, hold.axis))
    return hold


def read_part(text: str, shape: Shape) -> Hold:
    """Hold as `read_hold` reads it, of however little or much of the body. SpecError where there is nothing."""
    part = _read(text.strip(), shape)
    if part.name is None:
        _held_nodes(shape, part)
    return part


def guess_hold(shape: Shape) -> tuple[Hold, str]:
    """The thicker end of the longest axis, of ends alike the one nearer to the origin; and why in words. The flat face
    there is held, across the axis or inclined, or a slice where there is none."""
    mesh = shape.mesh
    names = [name for name in (*mesh.facet_sets, *mesh.node_sets) if _SET_NAME.search(name) and _can_hold(shape, name)]
    axis = int(shape.extent.argmax())
    if names:
        return Hold(axis, True, float(shape.low[axis]), names[0]), f"the set '{names[0]}' of the mesh file"
    ends, inwards = (shape.low[axis], shape.high[axis]), shape.extent[axis] * np.array([1, -1])
    areas = [_area(shape, axis, end + 0.1 * inward) for end, inward in zip(ends, inwards, strict=True)]
    if max(areas) > _THICKER * min(areas):
        side, why = int(np.argmax(areas)), "thicker"
    else:
        side, why = int(np.argmin(np.abs(ends))), "alike at both ends; nearer to the origin"
    hold, flat = end_hold(shape, axis, side == 0)
    return hold, f"{'the face' if flat else 'a slice'} at one end of the longest axis ({why})"


def end_hold(shape: Shape, axis: int, below: bool) -> tuple[Hold, bool]:
    """The flat face at an end of the body, or a slice where there is none; and whether there is."""
    end, inwards = float((shape.low if below else shape.high)[axis]), shape.extent[axis] * (1 if below else -1)
    if is_flat(shape, axis, end, _area(shape, axis, end + 0.02 * inwards)):
        return Hold(axis, below, end), True
    face = end_face(shape, axis, below)
    if face is not None:
        return Hold(axis, below, end, face=face), True
    slices = [Hold(axis, below, float(f"{end + share * inwards:.4g}")) for share in _SLICES]
    enough = (hold for hold in slices if _holds(_held_nodes(shape, hold)))
    return next(enough, slices[-1]), False


def run_from(hold: Hold, shape: Shape) -> Run:
    """Along the axis of the plane that is held; from a named set or an inclined face, along the longest axis."""
    if hold.name is None and hold.face is None:
        axis, below, level = hold.axis, hold.below, hold.level
    else:
        along = _held_nodes(shape, hold)
        axis = int(shape.extent.argmax())
        below = bool(along[:, axis].mean() < (shape.low[axis] + shape.high[axis]) / 2)
        level = float(along[:, axis].max() if below else along[:, axis].min())
    ends = (float(shape.low[axis]), float(shape.high[axis]))
    base, tip = ends if below else ends[::-1]
    return Run(axis, base, min(max(level, ends[0]), ends[1]), tip)


def is_flat(shape: Shape, axis: int, end: float, area: float) -> bool:
    """True where the facets in the plane of an end make up half of `area` mm^2 or more."""
    mesh = shape.mesh
    facets = mesh.facets[(np.abs(mesh.X[mesh.facets][:, :, axis] - end) < 1e-6 * mesh.size).all(axis=1)]
    return bool(0 < 0.5 * area < surface_area(mesh.X[facets]))


def _read(text: str, shape: Shape) -> Hold:
    """The part of the body that a text names: a set of the mesh, a side, a face, or what lies beyond a plane."""
    mesh = shape.mesh
    if text in {*mesh.node_sets, *mesh.facet_sets, *mesh.cell_sets}:
        return Hold(int(shape.extent.argmax()), True, 0.0, text)
    if side := FACES.get(text.lower()):
        axis, below = AXES.index(side[0]), side.endswith("<=")
        return Hold(axis, below, float(shape.low[axis] if below else shape.high[axis]))
    if text.startswith(_FACE):
        return _at_face(text, shape)
    match = re.fullmatch(r"([xyz])\s*(<=|>=|<|>)\s*(.+)", text)
    if match is None:
        sets = sorted({*mesh.node_sets, *mesh.facet_sets})
        named = f", or a set of the mesh: {', '.join(sets)}" if sets else ""
        raise SpecError(
            f"cannot make sense of '{text}'",
            do=f"write 'z <= 5 mm', 'face at 1, 2, 3 mm', or one of {', '.join(FACES)}{named}",
        )
    axis = AXES.index(match[1])
    level, slack = parse_quantity(match[3], "mm"), 1e-6 * mesh.size
    if not shape.low[axis] - slack <= level <= shape.high[axis] + slack:
        raise SpecError(f"'{text}' lies outside the body", do=_between(shape, axis))
    return Hold(axis, match[2][0] == "<", level)


def _at_face(text: str, shape: Shape) -> Hold:
    axis = int(shape.extent.argmax())
    face = face_at(shape, point(text.removeprefix(_FACE)))
    below = face.normal[axis] < 0
    return Hold(axis, below, float((shape.low if below else shape.high)[axis]), face=face)


def _held_nodes(shape: Shape, hold: Hold) -> np.ndarray:
    """Nodes (k, 3) mm that are held. SpecError where there are none."""
    return shape.mesh.X[select_nodes(shape.mesh, hold.selection(), "fixed")]


def _can_hold(shape: Shape, name: str) -> bool:
    return _holds(_held_nodes(shape, Hold(0, True, 0.0, name)))


def _holds(held: np.ndarray) -> bool:
    """True where nodes (k, 3) are not on one line."""
    spread = np.linalg.svd(held - held.mean(axis=0), compute_uv=False)
    return len(held) > 2 and bool(spread[1] > 1e-6 * np.ptp(held, axis=0).max())


def _between(shape: Shape, axis: int) -> str:
    return f"the body's {AXES[axis]} goes from {shape.low[axis]:.6g} to {shape.high[axis]:.6g} mm"


def _area(shape: Shape, axis: int, coordinate: float) -> float:
    """mm^2 of the largest piece of a cut."""
    section = cut(shape.interior, axis, coordinate)
    return 0.0 if section is None else section.area
