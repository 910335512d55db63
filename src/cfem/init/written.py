"""Numbers, vectors and parts of the body as a scene has them."""

import json
from collections.abc import Sequence

from cfem.init.hold import Hold


def number(value: float) -> str:
    """Number as text, to nine digits, which node coordinates are compared to."""
    return f"{value + 0.0:.9g}" if abs(value) > 1e-12 else "0"


def short(value: float) -> str:
    """A quantity that was guessed, to three digits."""
    return f"{float(f'{value:.3g}'):.9g}"


def vector(values: Sequence[float]) -> str:
    return "[" + ", ".join(number(value) for value in values) + "]"


def selection(hold: Hold) -> str:
    if hold.name is not None:
        return f"{{kind: name, name: {json.dumps(hold.name)}}}"
    plane = hold.selection()
    return f"{{kind: plane, point: {{mm: {vector(plane.point)}}}, normal: {vector(plane.normal)}}}" + note(str(hold))


def note(text: str) -> str:
    """A comment behind a value, none where there is nothing to say."""
    return f"    # {text}" if text else ""
