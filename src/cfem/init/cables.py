"""Cables as the user writes them on one line, and cables placed along a body."""

import re
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cfem.constraint.attachment import show
from cfem.core.errors import SpecError
from cfem.init.hold import Run
from cfem.init.interior import Interior
from cfem.init.question import point
from cfem.init.section import Section, across, clear, cut

_FIRST, _LAST = 0.1, 0.07  # shares of the free length before the first point and after the last
_FEWEST, _MOST = 3, 8  # points of a cable
_APART = 3.0  # of the points, in units of the radius that fits into the body there
_THIN = 0.3  # of the usual inscribed radius: a narrower end has no points
_ROUND = 0.8  # slimness from which the way that a section bends most easily is not sought
_ROWS = 40  # places tried from the centre of a section outwards
_SHRINK, _TRIES = 0.7, 6
_MARGINS = (1.0, 1.5, 2.25)  # times the radius: farther inside, a straight cable clears a bend
_BETWEEN = np.linspace(0, 1, 10)[1:-1]  # shares of a segment where it is looked at
_PERCENT, _TURN = 0.10, 1.5  # reach: share of the cable's length, and largest turn of the tip in rad


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
    name, colon, rest = text.partition(":")
    places = [part for part in rest.split(";") if part.strip()]
    if not (re.fullmatch(r"\s*[\w.-]+\s*", name) and colon and len(places) >= 2):
        raise ValueError(f"expected 'NAME: pull point; point; ...' with points 'x, y, z' in mm, got '{text}'")
    pull, *points = (point(place) for place in places)
    return CableLine(name.strip(), pull, np.array(points))


def sections_along(body: Interior, run: Run) -> list[Section]:
    """Cuts between the held part and the tip, where cables may have points: not where the body is much narrower than
    usual. None where the body has a gap half way."""
    free = abs(run.tip - run.level)
    middle = cut(body, run.axis, (run.level + run.tip) / 2)
    if middle is None:
        return []
    count = int(np.clip(round(free / (_APART * middle.inscribed)), _FEWEST, _MOST))
    places = run.level + run.forward * free * np.linspace(_FIRST, 1 - _LAST, count)
    cuts = [section for section in (cut(body, run.axis, place) for place in places) if section is not None]
    usual = np.median([section.inscribed for section in (middle, *cuts)])
    return [section for section in cuts if section.inscribed >= _THIN * usual]


def attachment_radius(sections: list[Section], run: Run) -> float:
    """mm: a third of the radius that fits into the body where it is narrowest, and no more than a fortieth of its
    length."""
    return min([run.length / 40, *(section.inscribed / 3 for section in sections)])


def place_cables(
    body: Interior, run: Run, sections: list[Section], count: int, radius: float
) -> tuple[tuple[CableLine, ...], float]:
    """`count` cables at equal angles about the middle of the body, the first on the side to which it bends most easily,
    each as far out as a ball of `radius` mm fits in, along its whole length; and that radius, made smaller where a wall
    is too thin for it. SpecError where there is no room even so, or the way leads through the air."""
    base = cut(body, run.axis, run.base + run.forward * max(1.2 * radius, 0.02 * run.length))
    ways = directions(sections, run.axis, count) if sections else np.empty((0, 3))
    fitted, outside = False, None
    for _ in range(_TRIES if len(sections) > 1 and base is not None else 0):
        for margin in _MARGINS:
            found = [_outermost(body, section, run.axis, ways, margin * radius) for section in (base, *sections)]
            if any(places is None for places in found):
                continue
            fitted = True
            outside = _outside(body, np.array(found), radius, run.axis)
            if outside is None:
                return tuple(_line(index, np.array(found)[:, index], sections, run) for index in range(count)), radius
        radius *= _SHRINK
    do = "hold another part (--fixed), ask for fewer, or give each as --cable 'NAME: pull point; point; ...'"
    if fitted:
        what = f"straight cables along {'xyz'[run.axis]} would leave the body near {show(np.round(outside, 1))} mm"
        raise SpecError(f"{what}, as in a body with a corner", where="--cables", do=do)
    what = f"there is no room for {count} cables along {'xyz'[run.axis]}"
    raise SpecError(f"{what}, even with an attachment radius of {radius:.2g} mm", where="--cables", do=do)


def _outside(body: Interior, places: np.ndarray, radius: float, axis: int) -> np.ndarray | None:
    """The first point (3,) mm of straight cables through places (k, count, 3), with a ball of `radius` around it, that
    is not inside; None where there is none."""
    for start, end in pairwise(places):
        for share in _BETWEEN:
            along = start + share * (end - start)
            inside = clear(body, along, radius, axis)
            if not inside.all():
                return along[~inside][0]
    return None


def guess_reach(cables: tuple[CableLine, ...]) -> tuple[float, str]:
    """The largest shortening in mm for all cables, and why in words: a tenth of the shortest, less where that would
    turn the tip by more than 1.5 rad."""
    tenth = _PERCENT * min(cable.length for cable in cables)
    turn = min((_TURN * cable.offset for cable in cables if cable.offset is not None), default=np.inf)
    if turn < tenth:
        return turn, f"turns the tip by about {np.degrees(_TURN):.0f} degrees"
    return tenth, "10 % of the shortest cable"


def directions(sections: list[Section], axis: int, count: int) -> np.ndarray:
    """(count, 3) unit vectors at equal angles: the first along the narrowest width of the middle section, or, where
    that is round, along the axis after `axis`."""
    middle = sections[len(sections) // 2]
    u, v = (np.eye(3)[side] for side in across(axis))
    first = np.arctan2(middle.thin @ v, middle.thin @ u) if middle.slimness < _ROUND else 0.0
    angles = first + np.arange(count) * 2 * np.pi / count
    return np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * v


def _line(index: int, places: np.ndarray, sections: list[Section], run: Run) -> CableLine:
    """Through places (1 + k, 3) mm, of which the first moves into the plane of the base."""
    step = 10.0 ** (np.floor(np.log10(run.length)) - 4)
    apart = [np.linalg.norm(place - section.centre) for place, section in zip(places[1:], sections, strict=True)]
    pull, *points = np.round(places / step) * step
    pull[run.axis] = run.base
    return CableLine(f"cable-{index + 1}", pull, np.array(points), float(np.mean(apart)))


def _outermost(body: Interior, section: Section, axis: int, ways: np.ndarray, radius: float) -> np.ndarray | None:
    """(count, 3) mm: the farthest point from the centre in each way around which a ball fits; None where there is none
    in one of them."""
    found = np.empty_like(ways)
    open_ = np.arange(len(ways))
    for apart in np.linspace(section.extent, 0, _ROWS)[:-1]:
        tried = section.centre + apart * ways[open_]
        fits = clear(body, tried, radius, axis)
        found[open_[fits]] = tried[fits]
        open_ = open_[~fits]
        if len(open_) == 0:
            return found
    return None
