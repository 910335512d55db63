"""Specs: what the user writes. One frozen model a YAML file; unknown keys are errors with line and suggestion."""

import ast
import difflib
import inspect
import re
import textwrap
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache, reduce
from itertools import pairwise
from operator import getitem
from pathlib import Path
from typing import Any, TypeVar, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler, PrivateAttr, TypeAdapter, ValidationError

from cfem.core.artefact.files import plain
from cfem.core.errors import SpecError
from cfem.core.kinds import classes_of, other_kind
from cfem.core.origin import Origin, key_path
from cfem.core.reading import Checked
from cfem.core.units import in_unit, unit_of, written
from cfem.core.yaml import parse_value, read_yaml


class Spec(Checked):
    """Base of every spec and of every part of one. A spec that was read from a file knows its file and lines."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True, allow_inf_nan=False)
    _origin: Origin | None = PrivateAttr(default=None)

    def place(self, *key: str | int) -> str:
        """'file:line: key.sub', or the key where no file is known."""
        return self._origin.place(key) if self._origin else ".".join(map(str, key))

    @contextmanager
    def locating(self, *key: str | int) -> Iterator[None]:
        """A SpecError that is raised within says file and line, those of `key` where it has no `where` of its own. Its
        own may be a key path, of the spec or of the part that `key` names: 'points.1' in `locating("actuators", 0)`."""
        try:
            yield
        except SpecError as error:
            path = self._path(error.where, key)
            if path is None:
                raise
            raise SpecError(error.what, where=self.place(*path) or None, do=error.do) from None

    def _path(self, where: str | None, key: tuple) -> tuple | None:
        """Key path in this spec that is meant; None where `where` is something else: a file, an option."""
        if where is None:
            return key
        if not re.fullmatch(r"[\w-]+(\.[\w-]+)*", where):
            return None
        stated = key_path(where)
        if key and (self._origin is None or self._origin.has(key + stated)):
            return key + stated
        known = stated[0] in type(self).model_fields
        return stated if known and (self._origin is None or self._origin.has(stated)) else None

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: GetJsonSchemaHandler) -> dict:
        """The string below a field describes it, and its default has a unit. pydantic reads such strings too, but at
        each import (1 ms per class); only schemas need them."""
        schema = handler(core)
        properties = handler.resolve_ref_schema(schema)["properties"]
        for name, text in described(cls).items():
            kind = properties[name].get("description")
            properties[name]["description"] = f"{text} ({kind})" if kind else text
        for name, field in cls.model_fields.items():
            if isinstance(field.default, Spec):
                properties[name]["default"] = {}
            elif isinstance(field.default, float) and (unit := unit_of(field)) != "1":
                properties[name]["default"] = written(field.default, unit)
        return schema


def described(model: type[BaseModel]) -> dict[str, str]:
    """Field -> the string below it, in the class itself or in those that it inherits from."""
    bases = [base for base in reversed(model.__mro__) if issubclass(base, BaseModel) and base not in Spec.__mro__]
    return {name: text for base in bases for name, text in _own_strings(base).items() if name in model.model_fields}


@cache
def _own_strings(model: type[BaseModel]) -> dict[str, str]:
    body = ast.parse(textwrap.dedent(inspect.getsource(model))).body[0].body
    return {
        field.target.id: " ".join(below.value.value.split())
        for field, below in pairwise(body)
        if isinstance(field, ast.AnnAssign) and isinstance(below, ast.Expr)
    }


S = TypeVar("S", bound=Spec)


def meaning(spec: Any, without: Iterable[str] = ()) -> Any:
    """A spec as plain data, without the fields named, without those that only allow something (`exclude`), and without
    values that are their defaults: an optional field that a later version adds leaves the meaning of what is written
    today alone."""
    if isinstance(spec, Spec):
        fields = type(spec).model_fields.items()
        values = {name: getattr(spec, name) for name, field in fields if name not in without and not field.exclude}
        optional = {name: field.get_default(call_default_factory=True) for name, field in fields if name in values}
        return {
            name: meaning(value)
            for name, value in values.items()
            if type(spec).model_fields[name].is_required() or not _same(value, optional[name])
        }
    if isinstance(spec, dict):
        return {key: meaning(value) for key, value in spec.items()}
    return [meaning(value) for value in spec] if isinstance(spec, list | tuple) else spec


def _same(before: Any, after: Any) -> bool:
    """True if two values are the same, arrays at any depth (of which pydantic's own comparison makes an error)."""
    if isinstance(before, Spec) or isinstance(after, Spec):
        return type(before) is type(after) and plain(meaning(before)) == plain(meaning(after))
    if isinstance(before, list | tuple) and isinstance(after, list | tuple):
        return len(before) == len(after) and all(map(_same, before, after))
    return np.array_equal(before, after)


def load_spec(path: Path, model: type[S], overrides: Iterable[str] = ()) -> S:
    """Reads a spec, overrides (`key.sub=value`) and validates it; paths inside it stay relative to `path.parent`.
    model: a class, or an annotated union of several.

    Raises SpecError naming file, line, key, what was expected and the nearest known key."""
    data, lines = read_yaml(path)
    for override in overrides:
        set_key(data, lines, override)
    origin = Origin(str(path), lines)
    try:
        spec = TypeAdapter(model).validate_python(data)
        spec._origin = origin
        return spec
    except ValidationError as error:
        belongs_elsewhere = other_kind(data, model)
        if belongs_elsewhere:
            raise SpecError(belongs_elsewhere, where=str(path)) from None
        sentences = _sentences(error, data, origin, model)
        more = f"; and {len(sentences) - 3} more" if len(sentences) > 3 else ""
        raise SpecError("; ".join(sentences[:3]) + more) from None


def set_key(data: dict, lines: dict, override: str) -> None:
    """Sets a key of the document, 'key.sub=value'. SpecError where there is none."""
    key, sign, text = override.partition("=")
    if not sign or not key:
        raise SpecError(f"'{override}' is not of the form key.sub=value", where="--set")
    *parents, last = key_path(key)
    node: Any = data
    try:
        unit = None
        for part in parents:
            node, unit = _numbers(node, part, unit)
            node = node.setdefault(part, {}) if isinstance(node, dict) else node[part]
        node, unit = _numbers(node, last, unit)
        node[last] = parse_value(text) if unit is None else in_unit(parse_value(text), unit)
    except (IndexError, TypeError, KeyError):
        raise SpecError(f"the spec has no key '{key}'", where="--set", do="check the key path") from None
    except ValueError as error:
        raise SpecError(f"{key}: {error}", where="--set") from None
    path = (*parents, last)
    for below in [below for below in lines if below[: len(path)] == path]:
        del lines[below]
    lines[path] = 0


def _numbers(node: Any, part: str | int, unit: str | None) -> tuple[Any, str | None]:
    """Numbers and unit where `part` counts from 0 and `node` is numbers under their unit, {mm: [...]}; else the node
    itself."""
    if isinstance(part, int) and isinstance(node, dict) and len(node) == 1:
        ((name, numbers),) = node.items()
        if isinstance(numbers, list):
            return numbers, name
    return node, unit


def _sentences(error: ValidationError, data: dict, origin: Origin, model: type[Spec]) -> list[str]:
    """Sentences on the errors, one each: `file:line: key: what; nearest known key`."""
    items = error.errors(include_url=False)
    sentences = []
    for item in items:
        # pydantic also counts a list short whose items failed: the items' own errors say all.
        if item["type"] == "too_short" and any(item["loc"] == deeper["loc"][:-1] for deeper in _deeper(items, item)):
            continue
        path = _present(item["loc"], data)
        what = _what(item, path, model, reduce(getitem, path, data))
        named = re.match(r"([\w-]+(\.[\w-]+)*): ", what) if item["type"] == "value_error" else None
        if named and path + key_path(named[1]) in origin.lines:  # a check of several keys names the one that is wrong
            path, what = path + key_path(named[1]), what[named.end() :]
        sentences.append(f"{origin.place(path)}: {what}")
    return sentences


def _deeper(items: list, item: Any) -> list:
    depth = len(item["loc"])
    return [{"loc": inner["loc"][: depth + 1]} for inner in items if len(inner["loc"]) > depth]


def _what(item: Any, path: tuple, model: type[Spec], stated: Any) -> str:
    """Sentence about what is wrong with one key, what was expected, and the nearest that is known. stated: its value as
    it is written."""
    if item["type"] == "extra_forbidden":
        if len(path) == 1 and any(path[0] in kind.model_fields for kind in classes_of(model)):
            return f"'{path[0]}' does not go with {item['loc'][0]}"
        return f"unknown key '{path[-1]}'{_nearest(str(path[-1]), _keys_at(model, item['loc'][:-1]))}"
    if item["type"] == "missing":
        return f"missing key '{item['loc'][-1]}'"
    if item["type"] == "union_tag_not_found":
        return f"missing key {item['ctx']['discriminator']}"
    if item["type"] == "union_tag_invalid":
        context = item["ctx"]
        known = context["expected_tags"].replace("'", "").split(", ")
        near = _nearest(context["tag"], known)
        return f"{context['discriminator']}: expected one of {', '.join(known)}; got '{context['tag']}'{near}"
    if item["type"] == "string_pattern_mismatch":
        what = f"expected {_PATTERNS.get(item['ctx']['pattern'], item['ctx']['pattern'])}"
    elif item["type"] in _WORDS:
        what = _WORDS[item["type"]].format(**item.get("ctx", {}))
    else:
        what = item["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
    if not isinstance(item["input"], dict | list | tuple) and "got" not in what:
        what += f", got {(stated if isinstance(stated, str) else item['input'])!r}"
    return what


# pydantic's words for these are about types of Python
_WORDS = {
    "too_short": "needs {min_length} or more, got {actual_length}",
    "too_long": "takes {max_length} at most, got {actual_length}",
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be at most {le:g}",
    "literal_error": "expected {expected}",
    "int_type": "expected a whole number",
    "int_parsing": "expected a whole number",
    "int_from_float": "expected a whole number",
    "float_type": "expected a number",
    "float_parsing": "expected a number",
    "finite_number": "expected a finite number",
    "bool_type": "expected true or false",
    "bool_parsing": "expected true or false",
    "string_type": "expected a text",
    "path_type": "expected a path",
    "list_type": "expected a list",
    "dict_type": "expected a mapping of names to values",
    "model_type": "expected a mapping of keys to values",
    "model_attributes_type": "expected a mapping of keys to values",
}


_PATTERNS = {
    r"^[a-z0-9][a-z0-9-]*$": "small letters (a to z), digits and hyphens",
    r"^[A-Za-z0-9_-]+$": "letters (a to z), digits, '_' and '-'",
    r"^[A-Za-z_][A-Za-z0-9_]*$": "letters (a to z), digits and '_', the first no digit",
}


def _nearest(word: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(word, sorted(known), n=1)
    return f", did you mean '{near[0]}'?" if near else ""


def _present(loc: tuple, data: Any) -> tuple:
    """The part of pydantic's location that exists in the document (it inserts tags of unions)."""
    path: list = []
    tagged = False
    for part in loc:
        if isinstance(data, dict):
            is_tag = not tagged and part == data.get("kind")  # also where a key has the name of its kind
            tagged, inside = tagged or is_tag, part in data and not is_tag
        else:
            inside = isinstance(data, list) and isinstance(part, int) and part < len(data)
        if inside:
            path.append(part)
            data, tagged = data[part], False
    return tuple(path)


def _keys_at(model: type[Spec], loc: tuple) -> set[str]:
    """The keys that a part of a spec may have, at pydantic's location of it: names of fields, numbers of items, keys of
    mappings and tags of unions."""
    parts = _specs_of(model)
    for step in loc:
        tagged = {part for part in parts if step in _tags(part)}
        inside = [_specs_of(part.model_fields[step].annotation) for part in parts if step in part.model_fields]
        parts = tagged or set().union(*inside) or parts
    return {key for part in parts for key in part.model_fields}


def _tags(part: type[BaseModel]) -> tuple:
    """Names by which pydantic calls a class of specs where several are possible."""
    kind = part.model_fields.get("kind")
    return (part.__name__, *(get_args(kind.annotation) if kind else ()))


def _specs_of(annotation: Any) -> set[type[BaseModel]]:
    """The classes of specs that an annotation names, also in lists, mappings and unions."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return {annotation}
    return set().union(*map(_specs_of, get_args(annotation)))


def json_schema(model: type[Spec]) -> dict:
    """Draft-07 JSON Schema for editors (yaml-language-server reads no later draft in full)."""
    schema = TypeAdapter(model).json_schema(ref_template="#/definitions/{model}")
    if "$defs" in schema:
        schema["definitions"] = schema.pop("$defs")
    return {"$schema": "http://json-schema.org/draft-07/schema#", **schema}
