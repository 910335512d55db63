"""Strict YAML 1.2: duplicate keys are errors, `1e-3` is a number, and every value knows its line."""

import re
from pathlib import Path
from typing import Any

from cfem.core.errors import InputError, SpecError

Key = str | int
# No spec comes near any of these; what does is a mistake, or meant to fill the memory.
MAX_BYTES = 1_000_000
MAX_VALUES = 100_000
MAX_DEPTH = 50
MAX_OPEN = 4 * MAX_DEPTH  # brackets, those in texts included
MAX_LENGTH = 10_000  # characters of one text
MAX_INTEGER = 2**63 - 1


def read_yaml(path: Path) -> tuple[dict, dict[tuple[Key, ...], int]]:
    """Plain data of a YAML mapping, and the line (from 1) of every key path in it."""
    try:
        return parse_yaml(_text(path), str(path))
    except (SpecError, InputError) as error:
        if path.suffix.lower() in ("", ".yaml", ".yml") or not path.is_file():
            raise
        do = "give a YAML file; `cfem init NAME --from FILE` makes those of a robot from its shape"
        raise SpecError(f"is not a spec: {error.what}", where=str(path), do=do) from error


def _text(path: Path) -> str:
    """Text of a file of specs. SpecError or InputError where it cannot be read."""
    try:
        with open(path, "rb") as file:
            data = file.read(MAX_BYTES + 1)  # no more, whatever the file
        if len(data) > MAX_BYTES:
            raise SpecError(
                f"is larger than {MAX_BYTES} bytes, the limit of a spec", where=str(path), do="check the path"
            )
        return data.decode()
    except FileNotFoundError:
        raise InputError("no such file", where=str(path), do="check the path") from None
    except IsADirectoryError:
        raise InputError("is a folder", where=str(path), do="name the YAML file in it") from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path), do="check its permissions") from error
    except ValueError as error:
        raise InputError(f"is not text in UTF-8: {error}", where=str(path), do="save it as UTF-8") from error


def parse_yaml(text: str, source: str) -> tuple[dict, dict[tuple[Key, ...], int]]:
    """Data and lines as of `read_yaml`, from text; `source` is named in errors."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError

    deepest = _deepest_line(text)
    if deepest:
        raise SpecError(f"a spec must not have more than {MAX_DEPTH} levels", where=f"{source}:{deepest}")
    try:
        tree = YAML(typ="rt", pure=True).load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}" if mark else ""
        problem = (error.problem or "not valid YAML").strip().splitlines()[0]
        raise SpecError(problem, where=f"{source}{line}", do="correct the YAML there") from None
    except Exception as error:  # besides YAMLError, ruamel stumbles over garbage in many ways
        raise SpecError(
            f"not valid YAML: {str(error).splitlines()[0] if str(error) else error!r}", where=source
        ) from None
    if not isinstance(tree, dict):
        raise SpecError(
            "expected a mapping of keys to values at the top", where=source, do="begin with a line such as `out: ...`"
        )
    lines: dict[tuple[Key, ...], int] = {(): 1}
    try:
        return _plain(tree, (), lines, set()), lines
    except _Refused as refused:
        line = f":{lines[refused.path]}" if refused.path in lines else ""
        raise SpecError(f"a spec must not have {refused}", where=f"{source}{line}") from None


def _deepest_line(text: str) -> int:
    """Line (from 1) on which so many brackets are open that a reader, whose time grows with their square, would take
    long; 0 where none is. Brackets in texts and comments count, and no spec has so many of these open."""
    depth = 0
    for number, line in enumerate(text.splitlines(), 1):
        for bracket in re.findall(r"[\[\]{}]", line):
            depth = depth + 1 if bracket in "[{" else max(depth - 1, 0)
            if depth > MAX_OPEN:
                return number
    return 0


class _Refused(Exception):
    def __init__(self, what: str, path: tuple[Key, ...]):
        super().__init__(what)
        self.path = path


def parse_value(text: str) -> Any:
    """The value of a `--set key=value`, read as YAML."""
    data, _ = parse_yaml(f"value: {text}", f"--set ...={text}")
    return data["value"]


def _plain(node: Any, path: tuple[Key, ...], lines: dict, open_nodes: set[int]) -> Any:
    """Plain data of a node, whose lines are noted. Raises _Refused where a spec must not have it."""
    from ruamel.yaml.comments import CommentedMap, CommentedSeq

    tag = getattr(node, "tag", None)
    if tag is not None and tag.value:
        name = str(tag.value).replace("tag:yaml.org,2002:", "!!")
        raise _Refused(f"the tag {name[:40]!r}", path)
    if not isinstance(node, CommentedMap | CommentedSeq):
        return _scalar(node, path)
    if id(node) in open_nodes:
        raise _Refused("aliases that expand without end", path)
    if len(path) >= MAX_DEPTH:
        raise _Refused(f"more than {MAX_DEPTH} levels", path)
    open_nodes.add(id(node))
    items = node.items() if isinstance(node, CommentedMap) else enumerate(node)
    plain = {}
    for key, value in items:
        key = key if isinstance(key, int) else _scalar(str(key), path)
        where = node.lc.key(key) if isinstance(node, CommentedMap) and key in (node.lc.data or {}) else None
        where = where or (node.lc.item(key) if isinstance(node, CommentedSeq) else (node.lc.line, 0))
        lines[(*path, key)] = where[0] + 1
        if len(lines) > MAX_VALUES:
            raise _Refused(f"more than {MAX_VALUES} values, by aliases that expand or in full", path)
        plain[key] = _plain(value, (*path, key), lines, open_nodes)
    open_nodes.discard(id(node))
    return plain if isinstance(node, CommentedMap) else list(plain.values())


def _scalar(node: Any, path: tuple[Key, ...]) -> Any:
    """Plain Python value of a scalar, without the notation that ruamel keeps."""
    for kind in (bool, int, float):
        if isinstance(node, kind):
            if kind is int and abs(node) > MAX_INTEGER:
                raise _Refused("an integer of more than 64 bits", path)
            return kind(node)
    if node is None:
        return None
    text = str(node)
    if len(text) > MAX_LENGTH:
        raise _Refused(f"a text of more than {MAX_LENGTH} characters", path)
    if any(not char.isprintable() and char not in "\n\t" for char in text):
        raise _Refused(f"a text with characters that cannot be printed, {text[:40]!r}", path)
    return text
