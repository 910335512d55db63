"""The end of the body that is proposed to be held: one from which cables stay inside."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cfem.core.errors import SpecError
from cfem.init.cables import CableLine, attachment_radius, place_cables, sections_along
from cfem.init.hold import Hold, Run, end_hold, guess_hold, run_from
from cfem.init.shape import Shape

_LONG = 0.5  # of the longest extent: shorter axes have no ends
_ENOUGH = 0.5  # of the free length, which cables have to follow at least


@dataclass(frozen=True)
class Placement:
    """cables: of a common attachment radius, mm; whole: whether they go to the tip, and do not end where the body
    turns."""

    cables: tuple[CableLine, ...]
    radius: float
    whole: bool


@dataclass(frozen=True)
class Proposal:
    """hold, and why in words; placement: of `count` cables from there, None where there is none, or nobody asked."""

    hold: Hold
    why: str
    count: int = 0
    placement: Placement | None = None


def place(shape: Shape, run: Run, count: int) -> Placement:
    """`count` cables along the body. Where they do not stay inside up to the tip, they end earlier, after half of the
    free length at least. SpecError where that fails too: what is in the way of cables up to the tip."""
    sections = sections_along(shape.interior, run)
    radius = attachment_radius(sections, run)
    try:
        return Placement(*place_cables(shape.interior, run, sections, count, radius), whole=True)
    except SpecError as error:
        refused = error
    middle = run.level + run.forward * _ENOUGH * abs(run.tip - run.level)
    while len(sections) > 2 and (sections[-2].centre[run.axis] - middle) * run.forward >= 0:
        sections = sections[:-1]
        try:
            return Placement(*place_cables(shape.interior, run, sections, count, radius), whole=False)
        except SpecError:
            continue
    raise refused


def propose(shape: Shape, count: int) -> Proposal:
    """What `guess_hold` says where `count` cables from there stay inside. Else the first end from which they do: the
    other end of that axis, then the ends of the other axes, the longer first, of each the smaller coordinate first. The
    guess itself where there is none, or where the mesh names what is held."""
    guess, why = guess_hold(shape)
    if guess.name is not None:
        return Proposal(guess, why)
    for hold in (guess, *_others(shape, guess)):
        try:
            placement = place(shape, run_from(hold, shape), count)
        except SpecError:
            continue
        if hold is not guess:
            why = f"cables from here stay inside the body, and those from {guess} would leave it"
        return Proposal(hold, why, count, placement)
    return Proposal(guess, why)


def _others(shape: Shape, guess: Hold) -> Iterator[Hold]:
    """Ends of the body, in the order in which they are tried."""
    yield end_hold(shape, guess.axis, not guess.below)[0]
    for axis in np.argsort(-shape.extent, kind="stable").tolist():
        if axis != guess.axis and shape.extent[axis] >= _LONG * shape.extent.max():
            yield from (end_hold(shape, axis, below)[0] for below in (True, False))
