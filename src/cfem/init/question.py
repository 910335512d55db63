"""What a new scene is asked, one value at a time."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.core.errors import SpecError
from cfem.core.names import plain
from cfem.core.units import parse_number, parse_quantity


@dataclass(frozen=True)
class Question:
    """flag: the option that answers it; text: of the question; default: what a person would type; why: where the
    default comes from; read: from what was typed to the value, SpecError where that cannot be."""

    flag: str
    text: str
    default: str
    why: str
    read: Callable[[str], Any]


NONE = "none"  # the answer that there is no such thing


@dataclass(frozen=True)
class Answer:
    """value; guess: why it is so where nobody said so, else None."""

    value: Any
    guess: str | None = None


Ask = Callable[[Question], Answer]


def answer(question: Question, text: str | None) -> Answer:
    """Answer that `text` gives, the default where it is None. SpecError, naming the option, where it makes no sense."""
    try:
        value = question.read(question.default if text is None else text)
    except (SpecError, ValueError) as error:
        reason = error.what if isinstance(error, SpecError) else str(error)
        example = None if question.default == NONE else f"write it as in '{question.default}'"
        do = error.do if isinstance(error, SpecError) else example
        raise SpecError(reason, where=f"--{question.flag}", do=do) from None
    return Answer(value, question.why if text is None else None)


def positive(text: str, unit: str) -> float:
    """A quantity above zero in `unit`. ValueError for anything else."""
    value = parse_quantity(text, unit)
    if not value > 0:
        raise ValueError(f"must be above zero, got '{text}'")
    return value


def integer(text: str, least: int, most: int) -> int:
    """An integer within bounds. ValueError for anything else."""
    if not re.fullmatch(r"\s*\d+\s*", text) or not least <= int(text) <= most:
        raise ValueError(f"expected a whole number from {least} to {most}, got '{text}'")
    return int(text)


def named(text: str, form: str) -> tuple[str, str]:
    """Name and the rest of a text 'NAME: ...'. ValueError where it has none, or one that a scene does not take.

    form: that is expected, as text"""
    name, colon, rest = text.partition(":")
    if not (name.strip() and colon):
        raise ValueError(f"expected {form}, got '{text}'")
    return plain(name.strip()), rest


def point(text: str) -> np.ndarray:
    """Point (3,) mm from the text 'x, y, z', in mm or in the unit that follows. ValueError for anything else."""
    match = re.fullmatch(r"(.*[\d.])\s*([a-z]+)?", text.strip())
    numbers, unit = match.groups() if match else ("", None)
    x = triple(numbers, f"expected three coordinates 'x, y, z' in mm, got '{text.strip()}'")
    return x * parse_quantity(f"1 {unit or 'mm'}", "mm")


def triple(numbers: str, refusal: str) -> np.ndarray:
    """(3,) finite numbers of 'x, y, z'. ValueError with the text `refusal` for anything else."""
    try:
        x = np.array([parse_number(part) for part in numbers.split(",")])
    except ValueError:
        x = np.empty(0)
    if x.shape != (3,) or not np.isfinite(x).all():
        raise ValueError(refusal)
    return x


def choice(text: str, choices: tuple[str, ...]) -> str:
    """One of several words. ValueError for anything else."""
    if text.strip() not in choices:
        raise ValueError(f"expected one of {', '.join(choices)}, got '{text.strip()}'")
    return text.strip()


def parts(text: str) -> list[str]:
    """Those of 'a | b', none of an empty text."""
    return [part.strip() for part in text.split("|") if part.strip()]


def stress(text: str) -> str:
    """Stress as text with its unit, as it is written. ValueError where it is not above zero."""
    positive(text, "MPa")
    return " ".join(text.split())


def ratio(text: str) -> float:
    """Poisson's. ValueError where it is none of a body that can be compressed."""
    value = parse_number(text)
    if not 0 <= value <= 0.4999:
        raise ValueError(f"expected a number from 0 to 0.4999, got '{text}'")
    return value
