"""How cables are suggested, and the end of the body that is proposed to be held: one from which they stay inside."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cfem.core.console.shown import counted
from cfem.core.errors import SpecError
from cfem.init.body.shape import Shape
from cfem.init.cables.centreline import Centreline, centreline
from cfem.init.cables.channels import cables_in_channels
from cfem.init.cables.legs import cables_in_legs
from cfem.init.cables.line import CableLine, attachment_radius, place_cables, sections_along
from cfem.init.cables.spine import Spine, along, straight
from cfem.init.cables.through_air import cables_through_air
from cfem.init.hold import Hold, Run, end_hold, guess_hold, run_from

_LONG = 0.5  # of the longest extent: shorter axes have no ends
_WIDER = 1.6  # times the lever: for so much more, cables go through the air
_LONGER = 1.2  # times the way from another end: such an end of the body is one where it is held


@dataclass(frozen=True)
class Placement:
    """cables: of a common attachment radius, mm; how they were placed, in words; through_air: whether they leave the
    body between their points; ways: how many of them the body has, in words, where that decides."""

    cables: tuple[CableLine, ...]
    radius: float
    how: str
    through_air: bool = False
    ways: str = ""

    def fewer(self, count: int, stated: bool) -> str | None:
        """Sentence to say where there are fewer cables than `count`, which a person stated or nobody did; else
        None."""
        made = len(self.cables)
        if made >= count:
            return None
        asked = f"{counted(made, 'cable')} where {count} {'were asked for' if stated else 'are usual'}"
        do = "for more, hold another part (--fixed), or give each as --cable 'NAME: pull point; point; ...'"
        return f"{asked}: {self.ways}; {do}"


@dataclass(frozen=True)
class Proposal:
    """hold, and why in words; placement: of `count` cables from there, None where there is none, or nobody asked."""

    hold: Hold
    why: str
    count: int = 0
    placement: Placement | None = None


def place(shape: Shape, run: Run, count: int, air: bool | None = None) -> Placement:
    """Cables from what is held: in channels where the body has some, whatever the count; else `count` of them inside
    the body, straight or along its middle, or one in each leg; else through the air between parts of the body.

    air: whether they have to go through the air, may (None) or must not. SpecError where there are none: what is in the
    way of straight cables up to the tip."""
    if air:
        lines, radius = cables_through_air(shape, run, count)
        many = f"{len(lines)} of {count} straight ways along {'xyz'[run.axis]} pass enough parts of the body"
        return Placement(lines, radius, "through the air from part to part", True, many)
    in_channels = cables_in_channels(shape, run)
    if in_channels is not None and (not in_channels.through_air or air is None):
        many = f"the body has {counted(len(in_channels.cables), 'channel')}, and each gets one"
        return Placement(in_channels.cables, in_channels.radius, in_channels.how, in_channels.through_air, many)
    middle = centreline(shape.voxels, run)
    try:
        return _or_wider(shape, run, count, inside(shape, run, count, middle), air)
    except SpecError as error:
        refused = error
    if middle is not None and middle.branches > 1:
        legs = cables_in_legs(shape, run)
        if legs is not None:
            many = f"{counted(len(legs[0]), 'way')} around the body lead to the tip"
            return Placement(*legs, f"one along each of {len(legs[0])} legs, on its outer side", ways=many)
    if air is None:
        try:
            return place(shape, run, count, air=True)
        except SpecError:
            pass  # `refused` says what keeps cables inside, which is what a person can change
    raise refused


def inside(shape: Shape, run: Run, count: int, middle: Centreline | None) -> Placement:
    """`count` cables up to the tip that stay inside: straight, or along the middle of a body that turns. SpecError, of
    straight ones, where there are none."""
    how = "at equal angles near the surface, at least `radius` within it"
    try:
        return Placement(*_along(shape, run, straight(run), count), how)
    except SpecError as error:
        if middle is None or middle.branches > 1:
            raise
        refused = error
    for finer in (1, 2):
        try:
            return Placement(*_along(shape, run, along(middle), count, finer), f"{how}, along the middle of the body")
        except SpecError:
            continue
    raise refused


def _along(shape: Shape, run: Run, spine: Spine, count: int, finer: int = 1) -> tuple[tuple[CableLine, ...], float]:
    sections = sections_along(shape, spine, finer)
    return place_cables(shape, run, spine, sections, count, attachment_radius(sections, run))


def _or_wider(shape: Shape, run: Run, count: int, placement: Placement, air: bool | None) -> Placement:
    """Cables through the air instead, where those have much more of a lever: a backbone with discs is made for them."""
    if air is not None:
        return placement
    try:
        wider = place(shape, run, count, air=True)
    except SpecError:
        return placement
    if len(wider.cables) == count and _lever(wider) > _WIDER * _lever(placement):
        return wider
    return placement


def _lever(placement: Placement) -> float:
    """mm, half the mean distance between the cables; 0 of a single one."""
    middles = np.array([cable.points.mean(axis=0) for cable in placement.cables])
    return float(np.linalg.norm(middles - middles.mean(axis=0), axis=1).mean())


def propose(shape: Shape, count: int) -> Proposal:
    """Hold of `guess_hold` where `count` cables from there stay inside up to the tip, or where the mesh names what
    is held. Else the end from which the longest way leads through the body, where cables along it stay inside. Else the
    first end with `count` cables, or with most: the guess, the other end of that axis, then the ends of the other axes,
    the longer first, of each the smaller coordinate first. The guess itself where there is none."""
    guess, why = guess_hold(shape)
    if guess.name is not None:
        return Proposal(guess, why)
    if cables_in_channels(shape, run_from(guess, shape)) is not None:
        return Proposal(guess, why, count, place(shape, run_from(guess, shape), count))
    middles = {}
    for hold in (guess, *_others(shape, guess)):
        middles[hold] = centreline(shape.voxels, run_from(hold, shape))
    lengths = {hold: middle.length for hold, middle in middles.items() if middle is not None}
    longest = max(lengths, key=lengths.get, default=guess)
    first = [guess] if lengths.get(longest, 0) <= _LONGER * lengths.get(guess, 0) else [longest, guess]
    for hold in dict.fromkeys([*first, longest]):
        run = run_from(hold, shape)
        try:
            placement = _or_wider(shape, run, count, inside(shape, run, count, middles[hold]), None)
        except SpecError:
            continue
        because = why if hold is guess else "the longest way through the body begins here"
        return Proposal(hold, because, count, placement)
    placements = {hold: placement for hold in middles if (placement := _placed(shape, hold, count)) is not None}
    if not placements:
        return Proposal(guess, why)
    hold = max(placements, key=lambda hold: min(count, len(placements[hold].cables)))
    if hold is not guess:
        number, of_guess = len(placements[hold].cables), placements.get(guess)
        why = f"cables from here stay inside the body, and those from {guess} would leave it"
        if of_guess is not None:
            why = f"{number} cables find a way from here, and {len(of_guess.cables)} from {guess}"
    return Proposal(hold, why, count, placements[hold])


def _placed(shape: Shape, hold: Hold, count: int) -> Placement | None:
    """Cables from what is held, None where there are none."""
    try:
        return place(shape, run_from(hold, shape), count)
    except SpecError:
        return None


def _others(shape: Shape, guess: Hold) -> Iterator[Hold]:
    """Ends of the body, in the order in which they are tried."""
    yield end_hold(shape, guess.axis, not guess.below)[0]
    for axis in np.argsort(-shape.extent, kind="stable").tolist():
        if axis != guess.axis and shape.extent[axis] >= _LONG * shape.extent.max():
            yield from (end_hold(shape, axis, below)[0] for below in (True, False))
