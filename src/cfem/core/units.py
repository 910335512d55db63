"""Quantities with explicit units, parsed once at the boundary into one system: mm, N, MPa, s, tonne.

A field of a spec declares the unit that the code computes in, `young: Stress`; the user writes "3000 kPa" and the
code sees 3.0. Arrays are written once for many numbers: `{mm: [[0, 10, -120]]}`.
"""

from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, WithJsonSchema

_NUMBER = r"^\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*"


@lru_cache(maxsize=1)
def _registry():
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=256)
def _factor(unit: str, system_unit: str) -> float:
    """Size of `unit` in `system_unit`; ValueError where the two do not measure the same thing."""
    import pint

    try:
        return float(_registry().Quantity(1.0, unit).to(system_unit).magnitude)
    except (pint.PintError, AttributeError, AssertionError, TypeError, ValueError) as error:
        raise ValueError(f"'{unit}' is not a unit of {_DIMENSION[system_unit]}; expected e.g. {system_unit}") from error


_DIMENSION = {
    "mm": "length",
    "N": "force",
    "MPa": "stress",
    "rad": "angle",
    "s": "time",
    "tonne/mm**3": "density",
    "mm**3": "volume",
}


def parse_quantity(text: Any, system_unit: str) -> float:
    """'3000 kPa' -> 3.0 for system_unit 'MPa'. A bare number where a unit is due is an error naming the unit."""
    if isinstance(text, bool) or not isinstance(text, str):
        raise ValueError(f"expected a {_DIMENSION[system_unit]} with its unit, such as '{text} {system_unit}'")
    parts = text.strip().split(None, 1)
    try:
        number, unit = float(parts[0]), parts[1]
    except (IndexError, ValueError):
        raise ValueError(
            f"expected a {_DIMENSION[system_unit]}: number, space and unit, such as '1 {system_unit}'; got '{text}'"
        ) from None
    value = number * _factor(unit, system_unit)
    if not np.isfinite(value):
        raise ValueError(f"expected a finite {_DIMENSION[system_unit]}; got '{text}'")
    return value


def parse_array(data: Any, system_unit: str, ndim: int) -> np.ndarray:
    """{'mm': [[0, 10, -120]]} -> float array of the stated number of axes, read-only."""
    if isinstance(data, np.ndarray):
        return data
    if not isinstance(data, dict) or len(data) != 1:
        raise ValueError(f"expected numbers under their unit, such as {{{system_unit}: [...]}}")
    ((unit, numbers),) = data.items()
    try:
        array = np.array(numbers, dtype=float) * _factor(str(unit), system_unit)
    except (TypeError, ValueError) as error:
        if "is not a unit" in str(error):
            raise
        raise ValueError(f"expected {ndim}-dimensional numbers of equal row length under '{unit}'") from error
    if array.ndim != ndim or array.size == 0 or not np.isfinite(array).all():
        raise ValueError(f"expected finite numbers in {ndim} dimension(s) under '{unit}', got shape {array.shape}")
    array.setflags(write=False)
    return array


def _scalar(system_unit: str):
    schema = {
        "type": "string",
        "pattern": _NUMBER + r"\S.*$",
        "description": f"{_DIMENSION[system_unit]} with its unit, e.g. '1 {system_unit}'",
    }
    return Annotated[float, BeforeValidator(lambda value: parse_quantity(value, system_unit)), WithJsonSchema(schema)]


def _vector(system_unit: str, ndim: int):
    numbers: dict = {"type": "number"}
    for _ in range(ndim):
        numbers = {"type": "array", "items": numbers, "minItems": 1}
    schema = {
        "type": "object",
        "minProperties": 1,
        "maxProperties": 1,
        "additionalProperties": numbers,
        "description": f"numbers under their unit, e.g. {{{system_unit}: ...}}",
    }
    return Annotated[Any, BeforeValidator(lambda value: parse_array(value, system_unit, ndim)), WithJsonSchema(schema)]


Length = _scalar("mm")
Force = _scalar("N")
Stress = _scalar("MPa")
Angle = _scalar("rad")
Duration = _scalar("s")
LengthVector = _vector("mm", 1)  # (k,) mm
LengthMatrix = _vector("mm", 2)  # (m, k) mm
