"""What else belongs to a new robot where somebody says so: pushes, weight, regions of another material, rigid parts,
points that something touches, symmetry."""

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from cfem.core.errors import SpecError
from cfem.core.units import parse_quantity
from cfem.init.body.shape import BREP, STEP, Shape, Source
from cfem.init.hold import AXES, Hold, read_part
from cfem.init.question import NONE, Answer, Ask, Question, choice, named, parts, point, ratio, stress, triple
from cfem.init.written import note, number, selection, short, vector

T = TypeVar("T")

WORDS = ("push", "gravity", "region", "rigid", "contact", "symmetry")
_GRAVITY = 9.81  # m/s^2
_OFF = 1e-3  # of the extent: so far the middle of a mirror image may be from its plane


@dataclass(frozen=True)
class PushLine:
    """name; place: (3,) mm of the body; direction: (3,) of the force."""

    name: str
    place: np.ndarray
    direction: np.ndarray


@dataclass(frozen=True)
class Region:
    """part of the body; young: text; poisson: of its material."""

    part: Hold
    young: str
    poisson: float


@dataclass(frozen=True)
class Further:
    """gravity: (3,) m/s^2 and density: an Answer, text, or None both; rigid: parts of the body; contacts: name and (3,)
    mm each; symmetry: the axis across which the body is its own mirror image, None where nobody says so."""

    pushes: tuple[PushLine, ...] = ()
    gravity: np.ndarray | None = None
    density: Answer | None = None
    regions: tuple[Region, ...] = ()
    rigid: tuple[Hold, ...] = ()
    contacts: tuple[tuple[str, np.ndarray], ...] = ()
    symmetry: str | None = None

    @property
    def dense(self) -> str:
        """Density that each material states."""
        return "" if self.density is None else f", density: {self.density.value}"

    @property
    def guessed(self) -> tuple[Answer, ...]:
        """Answers that may be guesses."""
        return () if self.density is None else (self.density,)


def further(shape: Shape, source: Source, stated: Collection[str], ask: Ask) -> Further:
    """Asks which of these there are, then for each of them; those that an option states are not asked for.

    stated: flags to which `ask` has an answer already."""
    wanted = {word for word in WORDS if word in stated}
    if wanted != set(WORDS):
        text = f"What else belongs to the robot ({', '.join(WORDS)}; several with commas)?"
        why = "what options say is all" if wanted else "none of these"
        wanted |= ask(Question("also", text, NONE, why, _words)).value
    answers = {word: ask(question).value for word, question in _questions(shape, source).items() if word in wanted}
    dense = answers.get("gravity") is not None or "density" in stated  # motion needs it too
    density = ask(_density_question()) if dense else None
    return Further(
        answers.get("push", ()),
        answers.get("gravity"),
        density,
        answers.get("region", ()),
        answers.get("rigid", ()),
        answers.get("contact", ()),
        answers.get("symmetry"),
    )


def further_lines(extras: Further, radius: float) -> list[str]:
    """Lines of a scene, all but the actuators; radius: mm, of attachments."""
    lines = []
    if extras.regions:
        lines.append("materials:")
        for region in extras.regions:
            material = f"young: {region.young}, poisson: {number(region.poisson)}{extras.dense}"
            shown, _, comment = selection(region.part).partition("    #")
            lines.append(f"  - region: {shown}" + note(comment.strip()))
            lines.append(f"    material: {{law: neo-hookean-log, {material}}}")
    if extras.rigid:
        lines += ["rigid:", *(f"  - {selection(part)}" for part in extras.rigid)]
    if extras.gravity is not None:
        lines.append(f"gravity: {{acceleration: {{m/s^2: {vector(extras.gravity)}}}}}")
    if extras.contacts:
        lines.append("contacts:")
        for name, place in extras.contacts:
            lines.append(f"  - {{name: {name}, point: {{mm: {vector(place)}}}, radius: {short(radius)} mm}}")
    return lines


def push_lines(push: PushLine, radius: float) -> list[str]:
    """Lines of an actuator of kind push, without its reach."""
    return [
        "  - kind: push",
        f"    name: {push.name}",
        f"    points: {{mm: [{vector(push.place)}]}}",
        f"    direction: {vector(push.direction)}",
        f"    radius: {short(radius)} mm" + note("of the region through which it acts"),
        "    unilateral: true" + note("it never pulls"),
    ]


def _questions(shape: Shape, source: Source) -> dict[str, Question]:
    """Questions about what a robot may have further, by the word that asks for each."""
    several = "several with | between them"
    low, high = (", ".join(f"{value:.4g}" for value in ends) for ends in (shape.low, shape.high))

    def question(
        flag: str, text: str, read: Callable[[str], object], default: str = NONE, why: str = "none"
    ) -> Question:
        return Question(flag, text, default, why, lambda text: read("" if text.strip() == NONE else text))

    return {
        "push": question(
            "push",
            f"Which forces push, each 'NAME: x, y, z; dx, dy, dz', its place in mm from {low} to {high} and its "
            f"direction, {several}?",
            _each(_push),
        ),
        "gravity": question(
            "gravity", "Which way is down (-z, or 'x, y, z' in m/s^2)?", gravity, "-z", "on a table as it is drawn"
        ),
        "region": question(
            "region",
            f"Where is another material, each 'z >= 5 mm: 2 MPa, 0.45', {several}?",
            _each(lambda text: _region(text, shape)),
        ),
        "rigid": question(
            "rigid", f"What is rigid, each as in 'z >= 5 mm', {several}?", _each(lambda text: read_part(text, shape))
        ),
        "contact": question(
            "contact", f"Which points may something touch, each 'NAME: x, y, z' in mm, {several}?", _each(_contact)
        ),
        "symmetry": question(
            "symmetry",
            "Across which axis is the body its own mirror image (x, y, z)?",
            lambda text: _symmetry(text, shape, source),
        ),
    }


def _density_question() -> Question:
    return Question("density", "Density?", "1070 kg/m^3", "silicone rubber", _density)


def _words(text: str) -> set[str]:
    words = [] if text.strip() == NONE else [word.strip() for word in text.split(",")]
    return {choice(word, WORDS) for word in words}


def _each(read: Callable[[str], T]) -> Callable[[str], tuple[T, ...]]:
    return lambda text: tuple(read(part) for part in parts(text))


def _push(text: str) -> PushLine:
    """A push from the text 'NAME: x, y, z; dx, dy, dz'."""
    name, places = named(text, "'NAME: x, y, z; dx, dy, dz'")
    place_text, semicolon, direction_text = places.partition(";")
    if not semicolon:
        raise ValueError(f"expected 'NAME: x, y, z; dx, dy, dz', got '{text}'")
    direction = point(direction_text)
    if not direction.any():
        raise ValueError(f"expected a direction, got '{direction_text.strip()}'")
    return PushLine(name, point(place_text), direction)


def _contact(text: str) -> tuple[str, np.ndarray]:
    name, place = named(text, "'NAME: x, y, z' in mm")
    return name, point(place)


def gravity(text: str) -> np.ndarray | None:
    """Acceleration (3,) m/s^2 from the text '-z' or 'x, y, z'; None of an empty text. ValueError for anything else."""
    if not text:
        return None
    match = re.fullmatch(r"\s*([+-]?)([xyz])\s*", text)
    if match:
        return _GRAVITY * (-1 if match[1] == "-" else 1) * np.eye(3)[AXES.index(match[2])]
    numbers = text.strip().removesuffix("m/s^2")
    acceleration = triple(numbers, f"expected '-z', or three numbers 'x, y, z' in m/s^2, got '{text.strip()}'")
    if not acceleration.any():
        raise ValueError(f"expected a direction such as '-z', got '{text}'")
    return acceleration


def _density(text: str) -> str:
    if not parse_quantity(text, "t/mm^3") > 0:
        raise ValueError(f"must be above zero, got '{text}'")
    return " ".join(text.split())


def _region(text: str, shape: Shape) -> Region:
    part, colon, material = text.partition(":")
    young, _, poisson = material.partition(",")
    if not colon:
        raise ValueError(f"expected 'z >= 5 mm: 2 MPa, 0.45', got '{text}'")
    return Region(read_part(part, shape), stress(young), ratio(poisson or "0.45"))


def _symmetry(text: str, shape: Shape, source: Source) -> str | None:
    """Axis across which the body is its own mirror image, None of an empty text. SpecError where it cannot be."""
    if not text:
        return None
    axis = choice(text, tuple(AXES))
    if source.path.suffix.lower() not in STEP + BREP:
        raise SpecError(
            f"a {source.path.suffix} file is not meshed half by half", do="leave it out: it is for .step and .brep"
        )
    index = AXES.index(axis)
    middle = (shape.low + shape.high)[index] / 2
    if abs(middle) > _OFF * shape.extent[index]:
        raise SpecError(
            f"the body's {axis} goes from {shape.low[index]:.6g} to {shape.high[index]:.6g} mm",
            do=f"move its plane of symmetry to {axis} = 0, or leave it out",
        )
    return axis
