"""Cables as the user writes them on one line, and cables placed along a body."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import ndimage

from cfem.constraint.attachment import show
from cfem.core.errors import SpecError
from cfem.init.body.section import Section, clear, cut, frame
from cfem.init.body.shape import Shape
from cfem.init.cables.spine import Spine
from cfem.init.hold import Run
from cfem.init.question import named, point

_FIRST, _LAST = 0.1, 0.07  # shares of the free length before the first point and after the last
_FEWEST, _MOST, _MOST_CURVED = 3, 8, 12  # points of a cable
_FINE = 4  # cuts looked at for each point of a cable that keeps clear of all of them
_APART = 3.0  # of the points, in units of the radius that fits into the body there
_THIN = 0.3  # of the usual inscribed radius: a narrower end has no points
_WIDE = 1.4  # of the usual extent in either half of the spine: a wider cut is none across it
_ROUND = 0.8  # slimness from which the way that a section bends most easily is not sought
_ROWS = 40  # places tried from the centre of a section outwards
_SHRINK, _TRIES = 0.7, 6
_COARSE = 2.0  # steps of the voxels by which their depth may be wrong
_MARGINS = (1.0, 1.5, 2.25)  # times the radius: farther inside, a straight cable clears a bend
_BETWEEN = np.linspace(0, 1, 10)[1:-1]  # shares of a segment where it is looked at


@dataclass(frozen=True)
class CableLine:
    """name; pull: (3,) mm, where it is pulled; points: (k, 3) mm of the body; offset: mm from the middle of the body on
    average, None where nobody has looked."""

    name: str
    pull: np.ndarray
    points: np.ndarray
    offset: float | None = None

    @property
    def length(self) -> float:
        """mm."""
        return float(np.linalg.norm(np.diff(np.vstack([self.pull, self.points]), axis=0), axis=1).sum())


def read_cable(text: str) -> CableLine:
    """'NAME: pull point; point; ...', each point 'x, y, z' in mm. ValueError for anything else."""
    form = "'NAME: pull point; point; ...' with points 'x, y, z' in mm"
    name, rest = named(text, form)
    places = [part for part in rest.split(";") if part.strip()]
    if len(places) < 2:
        raise ValueError(f"expected {form}, got '{text}'")
    pull, *points = (point(place) for place in places)
    return CableLine(name, pull, np.array(points))


def sections_along(shape: Shape, spine: Spine, finer: int = 1) -> list[Section]:
    """Cuts along a spine where cables may have points, `finer` times as many as usual: not where the body is much
    narrower than usual, nor, on one through its middle, where it is much wider, as where another branch begins. None
    where the body has a gap half way."""
    middle = spine.section(shape.interior, 0.5)
    if middle is None:
        return []
    apart, most = (0.7 * _APART, _MOST_CURVED) if spine.follows else (_APART, _MOST)
    count = finer * int(np.clip(round(spine.length / (apart * middle.inscribed)), _FEWEST, most))
    cuts = _cuts(shape, spine, np.linspace(_FIRST, 1 - _LAST, count))
    usual = np.median([section.inscribed for section in (middle, *cuts)])
    halves = np.array_split([section.extent for section in cuts], 2) if spine.follows and len(cuts) > 1 else []
    widest = _WIDE * max((float(np.median(half)) for half in halves), default=np.inf)
    return [section for section in cuts if section.inscribed >= _THIN * usual and section.extent <= widest]


def attachment_radius(sections: Sequence[Section], run: Run) -> float:
    """mm: a third of the radius that fits into the body where it is narrowest, and no more than a fortieth of its
    length."""
    return min([run.length / 40, *(section.inscribed / 3 for section in sections)])


def place_cables(
    shape: Shape, run: Run, spine: Spine, sections: list[Section], count: int, radius: float
) -> tuple[tuple[CableLine, ...], float]:
    """`count` cables at equal angles about the middle of the body, the first on the side to which it bends most easily,
    each as far out as a ball of `radius` mm fits in, along its whole length; and that radius, made smaller where a wall
    is too thin for it. SpecError where there is no room even so, or the spine leads through the air."""
    base = cut(shape.interior, run.axis, run.base + run.forward * max(1.2 * radius, 0.02 * run.length))
    fitted, outside = False, None
    cuts = [base, *sections]
    rays = directions(cuts, count) if len(sections) > 1 and base is not None else []
    for attempt in range(_TRIES if rays else 0):
        for margin in _MARGINS:
            places = _outermost_of_all(shape, cuts, rays, margin * radius)
            if places is None:
                continue
            fitted = True
            outside = _outside(shape, places, radius)
            if outside is None:
                return _lines(places, sections, run), radius
        if attempt in (0, _TRIES // 2) and fitted:
            places = _clear_of_all(shape, spine, cuts, rays, radius)
            if places is not None and _outside(shape, places, radius) is None:
                return _lines(places, sections, run), radius
        radius *= _SHRINK
    do = "hold another part (--fixed), ask for fewer, or give each as --cable 'NAME: pull point; point; ...'"
    if fitted:
        kind = "cables along the body" if spine.follows else f"straight cables along {'xyz'[run.axis]}"
        raise SpecError(f"{kind} would leave the body near {show(np.round(outside, 1))} mm", where="--cables", do=do)
    what = f"there is no room for {count} cables along {'xyz'[run.axis]}"
    raise SpecError(f"{what}, even with an attachment radius of {radius:.2g} mm", where="--cables", do=do)


def _cuts(shape: Shape, spine: Spine, shares: np.ndarray) -> list[Section]:
    return [section for section in (spine.section(shape.interior, share) for share in shares) if section is not None]


def _clear_of_all(
    shape: Shape, spine: Spine, cuts: list[Section], rays: list[np.ndarray], radius: float
) -> np.ndarray | None:
    """Points (k, count, 3) mm in the cuts, no farther out than a ball of `radius` fits in the cuts between: inside the
    necks of a body of discs and necks. None where it fits nowhere."""
    shares = np.linspace(_FIRST, 1 - _LAST, _FINE * (len(cuts) - 2) + 1)
    fine = [cuts[0], *_cuts(shape, spine, shares)]
    fine_rays = directions(fine, len(rays[0]))
    outermost = _outermost_of_all(shape, fine, fine_rays, radius)
    if outermost is None:
        return None
    offsets = np.array(
        [np.linalg.norm(points - each.centre, axis=1) for points, each in zip(outermost, fine, strict=True)]
    )
    narrow = ndimage.minimum_filter1d(offsets, 2 * _FINE + 1, axis=0, mode="nearest")
    places = np.array([each.centre for each in cuts])
    near = [
        int(np.linalg.norm(np.array([each.centre for each in fine]) - centre, axis=1).argmin()) for centre in places
    ]
    return places[:, None] + 0.98 * narrow[near][:, :, None] * np.array(rays)


def _outside(shape: Shape, places: np.ndarray, radius: float) -> np.ndarray | None:
    """The first point (3,) mm of straight cables through places (k, count, 3), with a ball of `radius` around it, that
    is not inside; None where there is none."""
    for start, end in pairwise(places):
        along = np.concatenate([start + share * (end - start) for share in _BETWEEN])
        inside = clear(shape.interior, along, radius)
        if not inside.all():
            return along[~inside][0]
    return None


def directions(sections: Sequence[Section], count: int) -> list[np.ndarray]:
    """Unit vectors (count, 3) in each section, at equal angles: the first along the narrowest width of the middle
    section, or, where that is round, along an axis; carried to the others without a turn about the normal."""
    half = len(sections) // 2
    middle = sections[half]
    u, v = frame(middle.normal)
    first = np.arctan2(middle.thin @ v, middle.thin @ u) if middle.slimness < _ROUND else 0.0
    angles = first + np.arange(count) * 2 * np.pi / count
    vectors = {half: np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * v}
    for index in [*range(half + 1, len(sections)), *range(half - 1, -1, -1)]:
        before = vectors[index - 1 if index > half else index + 1]
        normal = sections[index].normal
        turned = before - (before @ normal)[:, None] * normal
        vectors[index] = turned / np.linalg.norm(turned, axis=1)[:, None]
    return [vectors[index] for index in range(len(sections))]


def _lines(places: np.ndarray, sections: list[Section], run: Run) -> tuple[CableLine, ...]:
    """Through places (1 + k, count, 3) mm, of which the first moves into the plane of the base."""
    middles = np.array([section.centre for section in sections])
    apart = np.linalg.norm(places[1:] - middles[:, None], axis=2).mean(axis=0)
    return tuple(make_line(f"cable-{i + 1}", places[:, i], run, float(apart[i])) for i in range(places.shape[1]))


def make_line(name: str, places: np.ndarray, run: Run, offset: float | None) -> CableLine:
    """A cable through places (1 + k, 3) mm, rounded, of which the first moves into the plane of the base."""
    step = 10.0 ** (np.floor(np.log10(run.length)) - 4)
    pull, *points = np.round(places / step) * step
    pull[run.axis] = run.base
    return CableLine(name, pull, np.array(points), offset)


def _outermost_of_all(
    shape: Shape, sections: list[Section], rays: list[np.ndarray], radius: float
) -> np.ndarray | None:
    """Points (k, count, 3) mm: `_outermost` of each section; None as soon as one has none."""
    outermost = []
    for section, outward in zip(sections, rays, strict=True):
        places = _outermost(shape, section, outward, radius)
        if places is None:
            return None
        outermost.append(places)
    return np.array(outermost)


def _outermost(shape: Shape, section: Section, rays: np.ndarray, radius: float) -> np.ndarray | None:
    """Points (count, 3) mm: the farthest point from the centre along each ray around which a ball fits; None where
    there is none on one of them."""
    places = np.empty_like(rays)
    open_ = np.arange(len(rays))
    for apart in np.linspace(section.extent, 0, _ROWS)[:-1]:
        tried = section.centre + apart * rays[open_]
        fits = shape.voxels.depth_at(tried) > radius - _COARSE * shape.voxels.step
        if fits.any():
            fits[fits] = clear(shape.interior, tried[fits], radius)
        places[open_[fits]] = tried[fits]
        open_ = open_[~fits]
        if len(open_) == 0:
            return places
    return None
