"""Names that users give to what drives and watches a robot. They become names of columns and text in generated C."""

import re
from typing import Annotated

from pydantic import AfterValidator, WithJsonSchema

from cfem.core.errors import SpecError

NAME = r"^[A-Za-z0-9_.-]{1,100}$"


def plain(text: str) -> str:
    """The text itself. ValueError where it is no name."""
    if not re.fullmatch(NAME[1:-1], text):
        raise ValueError(f"a name has letters (a to z), digits, '_', '.' and '-' only, at most 100; got {text[:120]!r}")
    return text


Name = Annotated[str, AfterValidator(plain), WithJsonSchema({"type": "string", "pattern": NAME})]

LABEL = r"""^[^/\\<>&"'`${}\x00-\x1f\x7f-\x9f]{1,100}$"""


def _printable(text: str) -> str:
    if not re.fullmatch(LABEL[1:-1], text):
        what = "a name has 1 to 100 characters, none of them / \\ < > & \" ' ` $ { } or a control character"
        raise ValueError(f"{what}; got {text[:120]!r}")
    return text


Label = Annotated[str, AfterValidator(_printable), WithJsonSchema({"type": "string", "pattern": LABEL})]
"""What a person calls one thing of several on a page: text in pictures and names of their files."""


def demand_scene_name(name: str) -> None:
    """Raises SpecError unless it can be the name of a scene and of its folder."""
    if not re.fullmatch(r"[a-z0-9][a-z0-9-]*", name):
        raise SpecError("expected small letters, digits and hyphens", where=f"name '{name}'", do="such as my-robot")
