"""Cables that lead from part to part of a body through the air between them, as through the discs of a backbone."""

from dataclasses import replace

import numpy as np

from cfem.core.errors import SpecError
from cfem.init.body.section import Section, clear
from cfem.init.body.shape import Shape
from cfem.init.cables.line import CableLine, directions, make_line
from cfem.init.cables.spine import straight
from cfem.init.hold import Run

_CUTS = 60
_SHARES = np.linspace(0.9, 0.3, 13)  # of the way from the middle to the surface
_PARTS = 3  # that a cable passes at least
_FIRST, _LAST = 0.4, 0.7  # shares of the way by which the first part has come, and the last


def cables_through_air(shape: Shape, run: Run, count: int) -> tuple[tuple[CableLine, ...], float]:
    """Up to `count` cables at equal angles, as far out as parts of the body stand in their way; and the attachment
    radius, mm. SpecError where no cable would pass three parts."""
    spine = straight(run)
    shares = np.linspace(0.01, 0.99, _CUTS)
    cuts = [(share, spine.section(shape.interior, share)) for share in shares]
    cuts = [(share, _whole(shape, run, section)) for share, section in cuts if section is not None]
    radius = min(run.length / 40, max((section.inscribed for _, section in cuts), default=0.0) / 4)
    if len(cuts) > _PARTS:
        for _ in range(3):
            best: list[np.ndarray] = []
            for out in _SHARES:
                lines = _lines(shape, [each for _, each in cuts], np.array([s for s, _ in cuts]), count, out, radius)
                best = lines if len(lines) > len(best) else best
                if len(best) == count:
                    break
            if best:
                return tuple(make_line(f"cable-{i + 1}", each, run, None) for i, each in enumerate(best)), radius
            radius *= 0.6
    what = f"no straight cable along {'xyz'[run.axis]} passes {_PARTS} parts of the body"
    do = "hold another part (--fixed), or give each as --cable 'NAME: pull point; point; ...'"
    raise SpecError(what, where="--cables", do=do)


def _whole(shape: Shape, run: Run, section: Section) -> Section:
    """The section about the middle of all pieces of the cut, as far as the farthest: those of a lattice are apart."""
    across = np.delete(np.arange(3), run.axis)
    places = shape.voxels.centres
    near = places[np.abs(places[:, run.axis] - section.centre[run.axis]) <= shape.voxels.step]
    if len(near) == 0:
        return section
    centre = section.centre.copy()
    centre[across] = near[:, across].mean(axis=0)
    extent = float(np.linalg.norm((near - centre)[:, across], axis=1).max())
    return replace(section, centre=centre, extent=extent)


def _lines(
    shape: Shape, cuts: list[Section], shares: np.ndarray, count: int, out: float, radius: float
) -> list[np.ndarray]:
    """Points (1 + k, 3) mm of each cable that passes enough parts: where it begins, and the middle of each part."""
    centres, widths = np.array([each.centre for each in cuts]), np.array([each.extent for each in cuts])
    middle = (
        np.polynomial.Polynomial.fit(shares, centres[:, 0], 1),
        *(np.polynomial.Polynomial.fit(shares, centres[:, axis], 1) for axis in (1, 2)),
    )
    straightened = np.stack([line(shares) for line in middle], axis=1)
    wide = np.polynomial.Polynomial.fit(shares, widths, 1)(shares)
    wide *= (widths / wide).max()
    cables = []
    for side in np.array(directions(cuts, count)).swapaxes(0, 1):
        line = straightened + out * wide[:, None] * side
        within = clear(shape.interior, line, radius)
        ends = np.flatnonzero(np.diff(np.concatenate([[0], within.astype(int), [0]])))
        parts = [(start + end - 1) // 2 for start, end in ends.reshape(-1, 2)]
        if len(parts) >= _PARTS and shares[parts[0]] <= _FIRST and shares[parts[-1]] >= _LAST:
            parts = [each for each in parts if shares[each] > 0.05]
            cables.append(np.vstack([line[0], line[parts]]))
    return cables
