"""Specs: what the user writes. One frozen model a YAML file; unknown keys are errors with line and suggestion."""

import difflib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from cfem.core.errors import SpecError
from cfem.core.yaml import parse_value, read_yaml


class Spec(BaseModel):
    """Base of every spec and of every part of one. Defaults are written as the user would write them ('2 mm')."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True, validate_default=True)


S = TypeVar("S", bound=Spec)


def load_spec(path: Path, model: type[S], overrides: Iterable[str] = ()) -> S:
    """Read, override (`key.sub=value`) and validate a spec; paths inside it stay relative to `path.parent`.

    Raises SpecError naming file, line, key, what was expected and the nearest known key."""
    data, lines = read_yaml(path)
    for override in overrides:
        _set(data, lines, override)
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise SpecError("; ".join(_sentences(error, data, lines, str(path)))) from None


def _set(data: dict, lines: dict, override: str) -> None:
    key, sign, text = override.partition("=")
    if not sign or not key:
        raise SpecError(f"'{override}' is not key.sub=value", where="--set")
    *parents, last = (int(part) if part.isdigit() else part for part in key.split("."))
    node: Any = data
    try:
        for part in parents:
            node = node.setdefault(part, {}) if isinstance(node, dict) else node[part]
        node[last] = parse_value(text)
    except (IndexError, TypeError, KeyError):
        raise SpecError(f"no place '{key}' in the spec", where="--set", do="check the key path") from None
    lines[(*parents, last)] = 0


def _sentences(error: ValidationError, data: dict, lines: dict, source: str) -> list[str]:
    """One sentence an error: `file:line: key: what; nearest known key`."""
    found = []
    for item in error.errors(include_url=False):
        path = _present(item["loc"], data)
        line = next((lines[path[:n]] for n in range(len(path), -1, -1) if path[:n] in lines), 1)
        where = f"{source}:{line}" if line else "--set"
        key = ".".join(str(part) for part in path)
        if item["type"] == "extra_forbidden":
            what = f"unknown key '{path[-1]}'"
            near = difflib.get_close_matches(str(path[-1]), sorted(_known_keys(Spec)))
            what += f", did you mean '{near[0]}'?" if near else ""
        elif item["type"] == "missing":
            what = f"missing key '{item['loc'][-1]}'"
        else:
            what = item["msg"].removeprefix("Value error, ")
            if not isinstance(item["input"], dict | list) and "got" not in what:
                what += f", got {item['input']!r}"
        found.append(f"{where}: {key + ': ' if key else ''}{what}")
    return found


def _present(loc: tuple, data: Any) -> tuple:
    """The part of pydantic's location that exists in the document (it inserts tags of unions)."""
    path: list = []
    for part in loc:
        inside = (
            part in data
            if isinstance(data, dict)
            else isinstance(data, list) and isinstance(part, int) and part < len(data)
        )
        if inside:
            path.append(part)
            data = data[part]
    return tuple(path)


def _known_keys(model: type[BaseModel]) -> set[str]:
    """Every key that any part of any loaded spec knows: wide, but a suggestion need only be near."""
    return set(model.model_fields).union(*(_known_keys(child) for child in model.__subclasses__()))


def json_schema(model: type[Spec]) -> dict:
    """Draft-07 JSON Schema for editors (yaml-language-server reads no later draft in full)."""
    schema = model.model_json_schema(ref_template="#/definitions/{model}")
    if "$defs" in schema:
        schema["definitions"] = schema.pop("$defs")
    return {"$schema": "http://json-schema.org/draft-07/schema#", **schema}
