"""Strict YAML 1.2: duplicate keys are errors, `1e-3` is a number, and every value knows its line."""

from pathlib import Path
from typing import Any

from cfem.core.errors import InputError, SpecError

Key = str | int
MAX_BYTES = 1_000_000


def read_yaml(path: Path) -> tuple[dict, dict[tuple[Key, ...], int]]:
    """Plain data of a YAML mapping, and the line (from 1) of every key path in it."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError("no such file", where=str(path), do="check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", where=str(path)) from error
    if len(text) > MAX_BYTES:
        raise SpecError(f"larger than {MAX_BYTES} bytes, which no spec is", where=str(path))
    return parse_yaml(text, str(path))


def parse_yaml(text: str, source: str) -> tuple[dict, dict[tuple[Key, ...], int]]:
    """As `read_yaml`, from text; `source` is named in errors."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    try:
        tree = YAML(typ="rt", pure=True).load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}" if mark else ""
        problem = (error.problem or "not valid YAML").strip().splitlines()[0]
        raise SpecError(problem, where=f"{source}{line}", do="mend the YAML there") from None
    except (YAMLError, ValueError, RecursionError) as error:
        raise SpecError(
            f"not valid YAML: {str(error).splitlines()[0] if str(error) else error!r}", where=source
        ) from None
    if not isinstance(tree, dict):
        raise SpecError("expected a mapping of keys to values at the top", where=source)
    lines: dict[tuple[Key, ...], int] = {(): 1}
    return _plain(tree, (), lines, set()), lines


def parse_value(text: str) -> Any:
    """The value of a `--set key=value`, read as YAML."""
    data, _ = parse_yaml(f"value: {text}", f"--set ...={text}")
    return data["value"]


def _plain(node: Any, path: tuple[Key, ...], lines: dict, open_nodes: set[int]) -> Any:
    from ruamel.yaml.comments import CommentedMap, CommentedSeq

    if not isinstance(node, CommentedMap | CommentedSeq):
        return _scalar(node)
    if id(node) in open_nodes or len(lines) > 100_000:
        raise SpecError("aliases that expand without end are refused")
    open_nodes.add(id(node))
    items = node.items() if isinstance(node, CommentedMap) else enumerate(node)
    plain = {}
    for key, value in items:
        key = key if isinstance(key, int) else str(key)
        where = node.lc.key(key) if isinstance(node, CommentedMap) and key in (node.lc.data or {}) else None
        where = where or (node.lc.item(key) if isinstance(node, CommentedSeq) else (node.lc.line, 0))
        lines[(*path, key)] = where[0] + 1
        plain[key] = _plain(value, (*path, key), lines, open_nodes)
    open_nodes.discard(id(node))
    return plain if isinstance(node, CommentedMap) else list(plain.values())


def _scalar(node: Any) -> Any:
    """ruamel's scalar subclasses (which remember their notation) as plain Python values."""
    for kind in (bool, int, float, str):
        if isinstance(node, kind):
            return kind(node)
    if node is None:
        return None
    return str(node)
