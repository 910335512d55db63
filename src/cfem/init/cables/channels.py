"""Channels of a body for cables: holes through it, or through several walls in a row."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from cfem.contact.surface.facets import solid_angles
from cfem.init.body.section import lattice_across
from cfem.init.body.shape import Shape
from cfem.init.cables.line import CableLine, make_line
from cfem.init.cables.spine import straight
from cfem.init.chambers import chambers_of
from cfem.init.hold import Run

_CUTS, _FINE = 60, 90  # cuts along the body, and points across a cut
_SMALL = 0.12  # of the area within the outline of a cut: larger holes are no channel
_FEWEST = 4  # points of a cut in a hole
_SPAN = 0.5  # of the free length, over which a channel reaches at least
_WALLS, _FULL = 3, 0.8  # walls in a row with a hole, or cuts of the span with one
_MOST = 6  # points of a cable in one piece of a channel
_SHORT = _CUTS // 4  # cuts of a piece in which a cable has one point
_REGION = 2.5  # radii of a channel: the region through which its wall takes the force


@dataclass(frozen=True)
class InChannels:
    """cables: of a common attachment radius, mm; how, in words; through_air: whether they cross gaps between walls."""

    cables: tuple[CableLine, ...]
    radius: float
    how: str
    through_air: bool


@dataclass
class _Track:
    """places (3,) mm and radii mm of a hole, by the number of the cut."""

    places: dict[int, np.ndarray]
    radii: dict[int, float]

    @property
    def parts(self) -> list[list[int]]:
        """Numbers of cuts in a row."""
        numbers = sorted(self.places)
        breaks = np.flatnonzero(np.diff(numbers) > 1) + 1
        return [part.tolist() for part in np.split(np.array(numbers), breaks)]


def cables_in_channels(shape: Shape, run: Run) -> InChannels | None:
    """A cable in each channel that leads along the axis from the held part; None where there is none."""
    spine, shares = straight(run), np.linspace(0.01, 0.99, _CUTS)
    tracks: list[_Track] = []
    for number, share in enumerate(shares):
        place, normal = spine.at(share)
        for hole, radius in _holes(shape, place, normal):
            near = [track for track in tracks if _meets(track, hole, radius, run.axis)]
            if near:
                near[0].places[number], near[0].radii[number] = hole, radius
            else:
                tracks.append(_Track({number: hole}, {number: radius}))
    tracks = [track for track in tracks if _leads(track, shares)]
    if not tracks:
        return None
    air = any(len(track.parts) > 1 for track in tracks)
    radius = _REGION * float(np.median([max(track.radii.values()) for track in tracks]))
    lines = []
    for index, track in enumerate(tracks):
        chosen = [number for part in track.parts for number in _chosen(part)]
        points = np.array([track.places[number] for number in chosen])
        base = points[0].copy()
        base[run.axis] = run.base
        if abs(points[0, run.axis] - run.base) < 0.02 * run.length:
            points = points[1:]
        lines.append(make_line(f"cable-{index + 1}", np.vstack([base, points]), run, _offset(shape, points, run)))
    many = f"{len(lines)} channels" if len(lines) > 1 else "the channel"
    kind = "through the holes in its walls" if air else f"in {many} of the body"
    return InChannels(tuple(lines), radius, kind, air)


def _holes(shape: Shape, place: np.ndarray, normal: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Middle (3,) mm and radius mm of each small hole in a cut."""
    lattice = lattice_across(shape.interior, place, normal, _FINE)
    if lattice is None or not lattice.inside.any():
        return []
    filled = ndimage.binary_fill_holes(lattice.inside)
    label, count = ndimage.label(filled & ~lattice.inside)
    holes = []
    for number in range(1, count + 1):
        piece = label == number
        if _FEWEST <= piece.sum() <= _SMALL * filled.sum():
            middle = lattice.points[piece].mean(axis=0)
            if not any(abs(solid_angles(each.corners - middle).sum()) > 2 * np.pi for each in chambers_of(shape)):
                holes.append((middle, float(np.sqrt(piece.sum() / np.pi) * lattice.step)))
    return holes


def _meets(track: _Track, hole: np.ndarray, radius: float, axis: int) -> bool:
    last = max(track.places)
    apart = hole - track.places[last]
    apart[axis] = 0.0
    return bool(np.linalg.norm(apart) < 1.5 * radius) and 0.4 < radius / track.radii[last] < 2.5


def _leads(track: _Track, shares: np.ndarray) -> bool:
    numbers = sorted(track.places)
    span = shares[numbers[-1]] - shares[numbers[0]]
    full = len(numbers) >= _FULL * (numbers[-1] - numbers[0] + 1)
    return bool(span >= _SPAN) and (full or len(track.parts) >= _WALLS)


def _chosen(part: list[int]) -> list[int]:
    """Cuts of one piece in which the cable has a point: the middle of a short one."""
    if len(part) <= _SHORT:
        return [part[len(part) // 2]]
    inner = part[1:-1]
    return [inner[i] for i in np.linspace(0, len(inner) - 1, min(_MOST, len(part) // 8)).astype(int)]


def _offset(shape: Shape, points: np.ndarray, run: Run) -> float:
    """mm on average from the middle of the body."""
    middle = shape.voxels.centres.mean(axis=0)
    apart = points - middle
    apart[:, run.axis] = 0.0
    return float(np.linalg.norm(apart, axis=1).mean())
