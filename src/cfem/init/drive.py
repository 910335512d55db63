"""What drives a new robot: chambers where the body has closed inner surfaces, else cables that are placed or stated."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from cfem.core.errors import SpecError
from cfem.init.body.shape import Shape
from cfem.init.cables.ends import Proposal, place, propose
from cfem.init.cables.line import CableLine, attachment_radius, read_cable, sections_along
from cfem.init.cables.spine import straight
from cfem.init.chambers import Chamber, chambers_of, read_chamber
from cfem.init.hold import Run, guess_hold
from cfem.init.question import Ask, Question, choice, integer

_AIR = {"yes": True, "no": False, "auto": None}


@dataclass(frozen=True)
class Drive:
    """cables and chambers, and how each came to be so where nobody said so; radius: mm, of the attachments;
    through_air: of all cables; missing: why there are none where some were wanted; fewer: why there are fewer cables
    than were asked for."""

    cables: tuple[CableLine, ...] = ()
    chambers: tuple[Chamber, ...] = ()
    placed: str | None = None
    offered: str | None = None
    radius: float = 0.0
    through_air: bool = False
    missing: str | None = None
    fewer: str | None = None


@dataclass(frozen=True)
class Stated:
    """What options say about actuators, each text as typed; flags: all options that say something."""

    cables: Sequence[str] = ()
    chambers: Sequence[str] = ()
    flags: Collection[str] = ()


NOTHING = Stated()


def wants_cables(shape: Shape, stated: Stated, ask: Ask) -> int:
    """Number of cables to be placed before it is known what is held: none where some are stated, or chambers."""
    if stated.cables or stated.chambers:
        return 0
    if "cables" in stated.flags:
        return ask(count_question(3)).value
    return 0 if chambers_of(shape) else 3


def proposal(shape: Shape, stated: Stated, ask: Ask) -> Proposal:
    """Suggestion of what to hold; from where cables stay inside, where both are to be guessed."""
    count = 0 if "fixed" in stated.flags else wants_cables(shape, stated, ask)
    return propose(shape, count) if count else Proposal(*guess_hold(shape))


def drive(shape: Shape, run: Run, stated: Stated, known: Proposal | None, ask: Ask) -> Drive:
    """known: of what is held, if that was taken."""
    radius = attachment_radius(sections_along(shape, straight(run)), run)
    chambers, offered = _chambers(shape, stated, ask)
    if stated.cables:
        lines = tuple(_stated(text, read_cable, "--cable") for text in stated.cables)
        _demand_distinct([*lines, *chambers])
        air = ask(_air_question("no")).value is True
        return Drive(lines, chambers, None, offered, radius, air)
    many = None if chambers and "cables" not in stated.flags else ask(count_question(0 if chambers else 3))
    count = many.value if many else 0
    if count == 0:
        missing = None if chambers else "none were wanted: state each with --cable, or --chamber"
        return Drive((), chambers, None, offered, radius, missing=missing)
    air = ask(_air_question("auto")).value
    placement = known.placement if known and known.count == count and air is None else None
    try:
        placement = placement or place(shape, run, count, air)
    except SpecError as error:
        return Drive((), chambers, None, offered, radius, missing=error.what)
    _demand_distinct([*placement.cables, *chambers])
    few = placement.fewer(count, many.guess is None)
    return Drive(placement.cables, chambers, placement.how, offered, placement.radius, placement.through_air, fewer=few)


def count_question(default: int) -> Question:
    return Question(
        "cables",
        "How many cables, placed for you?",
        str(default),
        "along channels of the body, else at equal angles near its surface",
        lambda text: integer(text, 0, 12),
    )


def _air_question(default: str) -> Question:
    return Question(
        "through-air",
        "May cables cross the air between parts of the body (yes, no, auto)?",
        default,
        "where they find no way inside, or a much shorter lever" if default == "auto" else "they stay inside the body",
        lambda text: _AIR[choice(text, tuple(_AIR))],
    )


def _chambers(shape: Shape, stated: Stated, ask: Ask) -> tuple[tuple[Chamber, ...], str | None]:
    """And where they come from, in words, where nobody stated them."""
    if stated.chambers:
        chambers = tuple(_stated(text, lambda text: read_chamber(text, shape), "--chamber") for text in stated.chambers)
        return chambers, None
    known = chambers_of(shape)
    if not known or (stated.cables and "chambers" not in stated.flags):
        return (), None
    volumes = ", ".join(f"{each.volume:.4g}" for each in known)
    closed = "the closed inner surface" if len(known) == 1 else f"the {len(known)} closed inner surfaces"
    question = Question(
        "chambers",
        f"Is {closed} of {volumes} mm^3 inflated (all, none)?"
        if len(known) == 1
        else f"Are {closed} of {volumes} mm^3 inflated (all, none)?",
        "all",
        f"{closed} of the body",
        lambda text: choice(text, ("all", "none")),
    )
    answer = ask(question)
    return (known, answer.guess) if answer.value == "all" else ((), None)


def _stated(text: str, read, flag: str):
    try:
        return read(text)
    except ValueError as error:
        raise SpecError(str(error), where=flag) from None


def _demand_distinct(actuators: Sequence[CableLine | Chamber]) -> None:
    names = [each.name for each in actuators]
    if len(set(names)) < len(names):
        raise SpecError(f"names must differ, got {', '.join(names)}", where="--cable")
