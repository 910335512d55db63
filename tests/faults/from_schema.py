"""Specs drawn from the JSON Schemas that `cfem schema` writes (the part of draft-07 that they use)."""

import math
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Any

from hypothesis import strategies as st

NAMES = [
    "tip",
    "left",
    "right",
    "a",
    "x",
    "spectral",
    "train",
    "test",
    "finger",
    "module-1",
    ".",
    "..",
    "a/b",
    "é",
    " ",
]
UNITS = ["mm", "m", "kPa", "MPa", "N", "deg", "rad", "mm^3", "kg/m^3", "s", "Hz", "m/s^2", "furlong", "mm^0.5", "1"]
SIZES = [0.0, 1.0, -1.0, 1e-3, 0.3, 0.499, 0.5, 3, 40, 1e4, 1e-300, 1e300]
WORDS = st.sampled_from(NAMES) | st.text(max_size=8)


def specs(schema: Mapping[str, Any], paths: Sequence[str]) -> st.SearchStrategy[Any]:
    """Values that a schema allows. paths: what texts of the format `path` are."""
    known: dict[str, st.SearchStrategy[Any]] = {}
    places = st.sampled_from([*paths, "..", "/dev/null", "none"])

    def refer(name: str) -> st.SearchStrategy[Any]:
        if name not in known:
            known[name] = st.deferred(lambda: of(schema["definitions"][name]))
        return known[name]

    def of(node: Mapping[str, Any]) -> st.SearchStrategy[Any]:
        if "$ref" in node:
            return refer(node["$ref"].rsplit("/", 1)[1])
        if "const" in node:
            return st.just(node["const"])
        if "enum" in node:
            return st.sampled_from(node["enum"])
        for key in ("anyOf", "oneOf"):
            if key in node:
                return st.one_of([of(one) for one in node[key]])
        if "type" not in node:
            return st.sampled_from([*SIZES, *NAMES])
        kinds = [node["type"]] if isinstance(node["type"], str) else node["type"]
        return st.one_of([KINDS[kind]({**node, "type": kind}) for kind in kinds])

    def mapping(node: Mapping[str, Any]) -> st.SearchStrategy[dict]:
        needed = {key: of(one) for key, one in node.get("properties", {}).items() if key in node.get("required", ())}
        optional = {key: of(one) for key, one in node.get("properties", {}).items() if key not in needed}
        found = st.fixed_dictionaries(needed, optional=optional)
        others = [node.get("additionalProperties"), *node.get("patternProperties", {}).values()]
        others = [of(one) for one in others if isinstance(one, Mapping)]
        if not others:
            return found
        bounds = {"min_size": node.get("minProperties", 0), "max_size": node.get("maxProperties", 2)}
        keys = st.sampled_from(UNITS) if node.get("maxProperties") == 1 else WORDS
        return st.tuples(found, st.dictionaries(keys, st.one_of(others), **bounds)).map(
            lambda parts: reduce(dict.__or__, parts)
        )

    def number(node: Mapping[str, Any]) -> st.SearchStrategy[Any]:
        least = node.get("minimum", node.get("exclusiveMinimum", -math.inf))
        most = node.get("maximum", node.get("exclusiveMaximum", math.inf))
        if node["type"] == "integer":
            return st.integers(int(max(least, -10)), int(min(most, 10**6)))
        usual = [size for size in SIZES if least <= size <= most]
        floats = st.floats(max(least, -1e300), min(most, 1e300), allow_nan=False)
        return st.sampled_from(usual) | floats if usual else floats

    def text(node: Mapping[str, Any]) -> st.SearchStrategy[str]:
        if node.get("format") == "path":
            return places
        if "pattern" not in node:
            return WORDS
        if not node["pattern"].endswith(r"\S.*$"):  # of no quantity
            return st.from_regex(node["pattern"], fullmatch=True)
        near = [unit for unit in UNITS if f" {unit}'" in node.get("description", "")] or UNITS
        units = st.sampled_from(near) | st.sampled_from(UNITS)
        return st.builds("{} {}".format, st.sampled_from(SIZES) | st.floats(allow_nan=False), units)

    def array(node: Mapping[str, Any]) -> st.SearchStrategy[list]:
        fewest = node.get("minItems", 0)
        return st.lists(of(node.get("items", {})), min_size=fewest, max_size=node.get("maxItems", fewest + 3))

    KINDS = {
        "object": mapping,
        "array": array,
        "string": text,
        "number": number,
        "integer": number,
        "boolean": lambda node: st.booleans(),
        "null": lambda node: st.none(),
    }
    return of(schema)
