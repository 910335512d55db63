"""Checks of a device's answers: one JSON object a line, of bounded length and depth, numbers that a robot can have."""

import json
from typing import Any

import numpy as np

from cfem.core.console.terminal import printable

LONGEST = 2**18  # bytes of a line
DEEPEST = 8  # objects and lists within each other
FAR = 10.0  # times the robot's length, the range of an actuator or a turn: a number beyond is of another unit


class Malformed(ValueError):
    """Error of an answer that the protocol does not know; its text says why."""


def shown(value: Any) -> str:
    """The beginning of what was said, on one line."""
    text = " ".join(printable(value if isinstance(value, str) else json.dumps(value)).split())
    return text if len(text) <= 80 else text[:80] + " ..."


def answer_of(line: str) -> dict[str, Any]:
    """The object of a line. Malformed where it has none, or reports an error."""
    if nesting(line) > DEEPEST:
        raise Malformed(f"answered {shown(line)}, which is nested deeper than {DEEPEST}")
    try:
        answer = json.loads(line)
    except ValueError:  # also an integer of thousands of digits
        answer = None
    if not isinstance(answer, dict):
        raise Malformed(f"answered '{shown(line)}', which is no JSON object on a line")
    if "error" in answer:
        raise Malformed(f"reports: {shown(answer['error'])}")
    return answer


def nesting(line: str) -> int:
    """Largest number of brackets that are open in a line, those in strings left out."""
    depth = most = 0
    quoted = escaped = False
    for character in line:
        if quoted:
            quoted, escaped = escaped or character != '"', not escaped and character == "\\"
        elif character == '"':
            quoted = True
        elif character in "[{":
            depth += 1
            most = max(most, depth)
        elif character in "]}":
            depth -= 1
    return most


def numbers(
    answer: dict[str, Any], name: str, rest: np.ndarray, farthest: np.ndarray | float = np.inf
) -> np.ndarray | None:
    """Numbers (n,) as `rest`, or None where the device says null or nothing. Malformed where these are not finite
    numbers, or one is farther from rest (n,) than farthest (n,)."""
    value = answer.get(name)
    if value is None:
        return None
    count = len(rest)
    listed = isinstance(value, list) and len(value) == count and all(type(number) in (int, float) for number in value)
    read = np.array([_float(number) for number in value] if listed else [np.nan])
    if not np.isfinite(read).all():
        raise Malformed(f"answered {name} = {shown(value)}, expected {count} finite numbers or null")
    beyond = np.abs(read - rest) > farthest
    if beyond.any():
        k = int(beyond.argmax())
        what = f"{abs(read[k] - rest[k]):.3g} from rest, at most {np.broadcast_to(farthest, count)[k]:.3g}"
        do = "are its units mm, mm^3, rad, N and MPa?"
        raise Malformed(f"answered {name} = {shown(value)}: number {k + 1} is {what}: {do}")
    return read


def step_of(answer: dict[str, Any], step: int, last: int) -> int:
    """The step that was measured, not before the last one that was answered. Malformed where it is none."""
    t = answer.get("t")
    if type(t) is not int or not 0 <= t <= step:
        raise Malformed(f"answered t = {shown(t)} to step {step}, expected the step that it measured")
    if t < last:
        raise Malformed(f"answered t = {t} after t = {last}: samples must not go back")
    return t


def _float(number: int | float) -> float:
    try:
        return float(number)
    except OverflowError:  # an integer beyond all floating-point numbers
        return np.inf
