"""Differences between two descriptions of what an artefact was made from, in words."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from cfem.core.artefact.files import plain
from cfem.core.spec import Spec
from cfem.core.units import unit_of, written

MOST = 3  # that are named
LONGEST = 60  # characters of a list or mapping that is written out


def changes(old: Any, new: Any, specs: Mapping[str, Spec]) -> list[str]:
    """A few words per difference between two results of `Stage.origin`, at most MOST and a count of the rest. specs:
    'spec' and 'scene' as they are now, for units and defaults."""
    if old is None:
        return ["made by an older version of cfem"]
    words = list(dict.fromkeys(_words(path, before, after, specs) for path, before, after in differences(old, new)))
    return words[:MOST] + ([f"and {len(words) - MOST} more"] if len(words) > MOST else [])


def differences(old: Any, new: Any, path: tuple = ()) -> Iterator[tuple[tuple, Any, Any]]:
    """Key path, old value and new value wherever plain data differs; None for a key that is not there."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in [*old, *(key for key in new if key not in old)]:
            yield from differences(old.get(key), new.get(key), (*path, key))
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, (before, after) in enumerate(zip(old, new, strict=True)):
            yield from differences(before, after, (*path, index))
    elif old != new:
        yield path, old, new


def _words(path: tuple, old: Any, new: Any, specs: Mapping[str, Spec]) -> str:
    """Keys of the spec go by their own name; those of the scene by 'scene'."""
    where, *key = path
    if where == "inputs":
        return f"its {'.'.join(map(str, key))} has changed"
    if where == "extra" and key[0] in ("scene", "parameters"):
        spec, inside = specs.get(key[0]), key[1:]
    elif where == "spec":
        spec, inside = specs.get("spec"), key
    else:
        return "cfem makes it in another way now"
    return f"{'.'.join(map(str, key))}: {in_words(spec, inside, old)} -> {in_words(spec, inside, new)}"


def in_words(spec: Any, key: Sequence[str | int], value: Any) -> str:
    """A value of a spec, with its unit, short enough for a sentence. None is the default of the key."""
    field = None
    for part in key:
        if isinstance(spec, Spec) and part in type(spec).model_fields:
            field, spec = type(spec).model_fields[part], getattr(spec, part)
        elif isinstance(spec, list) and isinstance(part, int) and part < len(spec):
            spec = spec[part]
        else:
            spec = None
    if value is None and field is not None and not field.is_required():
        value = plain(field.get_default(call_default_factory=True))
    if isinstance(value, int | float) and not isinstance(value, bool):
        unit = "1" if field is None else unit_of(field)
        return f"{value:.9g}" if unit == "1" else written(value, unit)
    if isinstance(value, dict | list) and len(written_out := str(value)) > LONGEST:
        return f"{len(value)} of them" if isinstance(value, list) else f"{written_out[:LONGEST]} ..."
    return "none" if value is None else str(value)
