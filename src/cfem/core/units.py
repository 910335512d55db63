"""Quantities with explicit units, parsed once at the boundary into one system: mm, N, MPa, s, tonne.

A field of a spec declares the unit that the code computes in, `young: Stress`; the user writes "3000 kPa" or "3MPa"
and the code sees 3.0. Arrays are written once for many numbers: `{mm: [[0, 10, -120]]}`. A unit is a name, or powers,
products and quotients of names: `N/mm^2`. It is never evaluated as an expression.
"""

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, get_args

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema
from pydantic.fields import FieldInfo

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NAME = r"[A-Za-zµ°][A-Za-z0-9_]*"
_POWER = rf"{_NAME}(?:(?:\^|\*\*)-?\d)?"
_UNIT = rf"{_POWER}(?:\s*[*/]\s*{_POWER})*"
_QUANTITY = rf"^\s*{_NUMBER}\s*[A-Za-zµ°][A-Za-z0-9_ ^*/-]*$"  # for editors
_LONGEST = 60  # characters of a unit

# The units that specs are written in, so that reading one need not import pint (0.25 s); a test compares them with it.
_USUAL = {
    "mm": {"mm": 1.0, "um": 1e-3, "cm": 10.0, "m": 1e3, "inch": 25.4},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "MPa": {"MPa": 1.0, "Pa": 1e-6, "kPa": 1e-3, "GPa": 1e3, "N/mm^2": 1.0},
    "rad": {"rad": 1.0, "deg": math.pi / 180},
    "mm^3": {"mm^3": 1.0, "ul": 1.0, "ml": 1e3, "cm^3": 1e3, "l": 1e6},
    "mm/s^2": {"mm/s^2": 1.0, "m/s^2": 1e3},
    "t/mm^3": {"kg/m^3": 1e-12, "g/cm^3": 1e-9, "t/mm^3": 1.0},
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "Hz": {"Hz": 1.0, "kHz": 1e3},
}


@lru_cache(maxsize=1)
def _registry():
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=256)
def _factor(unit: str, system_unit: str) -> float:
    """Size of `unit` in `system_unit`; ValueError where the two do not measure the same thing."""
    usual = _USUAL.get(system_unit, {})
    if unit in usual:
        return usual[unit]
    try:
        if len(unit) > _LONGEST or not re.fullmatch(_UNIT, unit):
            raise ValueError
        bases = [str(_registry().get_base_units(name)[1]) for name in re.findall(_NAME, unit)]
        if "dimensionless" in bases or any("radian" in base for base in bases) != (system_unit == "rad"):
            raise ValueError  # a number in disguise, such as pi or percent; or a turn, such as in rpm
        return float(_registry().Quantity(1.0, unit).to(system_unit).magnitude)
    except Exception as error:  # pint's errors share no base class
        shown = unit if len(unit) <= _LONGEST else f"{unit[:_LONGEST]} ..."
        alike = [name for name in usual if name.lower() == unit.lower()]
        hint = f"did you mean {' or '.join(alike)}?" if alike else f"expected e.g. {_customary(system_unit)}"
        raise ValueError(f"'{shown}' is not a unit of {DIMENSION[system_unit]}; {hint}") from error


DIMENSION = {
    "mm": "length",
    "N": "force",
    "MPa": "stress",
    "rad": "angle",
    "mm^2": "area",
    "mm^3": "volume",
    "mm/s^2": "acceleration",
    "t": "mass",
    "t/mm^3": "density",
    "s": "time",
    "Hz": "frequency",
}


def _customary(system_unit: str) -> str:
    """The unit that a person would write, where nobody would write the system's."""
    return {"rad": "deg", "t": "g", "t/mm^3": "kg/m^3", "mm/s^2": "m/s^2"}.get(system_unit, system_unit)


def parse_number(text: str) -> float:
    """'-1.5e3' -> -1500.0. ValueError for anything but a finite number in digits with a point, such as '1_0' or 'inf',
    which `float` takes."""
    if not re.fullmatch(_NUMBER, text.strip(), re.ASCII):
        raise ValueError(f"'{text}' is not a number")
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"'{text}' is too large a number")
    return value


def parse_quantity(text: Any, system_unit: str) -> float:
    """'3000 kPa' -> 3.0 for system_unit 'MPa'. A bare number where a unit is due is an error naming the unit."""
    article = "an" if DIMENSION[system_unit][0] in "aeiou" else "a"
    expected = f"expected {article} {DIMENSION[system_unit]} with its unit"
    if isinstance(text, int | float) and not isinstance(text, bool):
        raise ValueError(f"{expected}, such as '1 {_customary(system_unit)}'; got the bare number {text:g}")
    match = re.match(rf"\s*({_NUMBER})(.*)", text, re.DOTALL) if isinstance(text, str) else None
    if match is None or not match[2].strip() or match[2].startswith(","):
        point = " (decimals have a point, not a comma)" if match and match[2].startswith(",") else ""
        raise ValueError(f"{expected}: a number and a unit, such as '1 {_customary(system_unit)}'; got {text!r}{point}")
    value = float(match[1]) * _factor(match[2].strip(), system_unit)
    if not np.isfinite(value):
        raise ValueError(f"expected a finite {DIMENSION[system_unit]}; got '{text}'")
    return value


def in_unit(text: Any, unit: str) -> float:
    """'1.5 cm' -> 15.0 for unit 'mm': one number as a list under `unit` has it. ValueError as `parse_quantity`."""
    usual = [system_unit for system_unit, known in _USUAL.items() if unit in known]
    for system_unit in usual or DIMENSION:
        try:
            size = _factor(unit, system_unit)
        except ValueError:
            continue
        return parse_quantity(text, system_unit) / size
    raise ValueError(f"'{unit}' is not a unit")


def parse_array(data: Any, system_unit: str, ndim: int, last: int | None = None) -> np.ndarray:
    """{'mm': [[0, 10, -120]]} -> float array of the stated number of axes (and length of the last), read-only."""
    if isinstance(data, np.ndarray):
        return data
    if not isinstance(data, dict) or len(data) != 1:
        raise ValueError(f"expected numbers under their unit, such as {{{_customary(system_unit)}: [...]}}")
    ((unit, numbers),) = data.items()
    try:
        array = np.array(numbers, dtype=float) * _factor(str(unit), system_unit)
    except (TypeError, ValueError) as error:
        if "is not a unit" in str(error):
            raise
        raise ValueError(f"expected numbers under '{unit}'{_strange(numbers)}") from error
    if not np.isfinite(array).all():
        raise ValueError(f"expected finite numbers under '{unit}', got {array[~np.isfinite(array)][0]:g}")
    if array.ndim != ndim or array.size == 0:
        wanted = ("a number", "a list of numbers, [1, 2]", "a list of rows, [[1, 2], [3, 4]]")[min(ndim, 2)]
        got = "nothing" if array.size == 0 else ("a number", "a list of numbers", "a list of rows")[min(array.ndim, 2)]
        raise ValueError(f"expected {wanted}, under '{unit}', got {got}")
    if last is not None and array.shape[-1] != last:
        raise ValueError(f"expected {last} numbers per row under '{unit}', got {array.shape[-1]}")
    array.setflags(write=False)
    return array


def _strange(numbers: Any) -> str:
    """Reason why a list is no array of numbers: a part that is none, or rows of different lengths."""
    flat, rows = [numbers], set()
    while any(isinstance(part, list | tuple) for part in flat):
        rows = {len(part) if isinstance(part, list | tuple) else 0 for part in flat}
        flat = [item for part in flat for item in (part if isinstance(part, list | tuple) else [part])]
    strange = next((part for part in flat if isinstance(part, bool) or not isinstance(part, int | float)), None)
    if strange is not None:
        return f", got {strange!r:.40}"
    return f", as many in each row, got rows of {' and '.join(map(str, sorted(rows)))}" if len(rows) > 1 else ""


def scalar_schema(description: str) -> dict[str, Any]:
    """JSON schema of a number with a unit."""
    return {"type": "string", "pattern": _QUANTITY, "description": description}


def array_schema(ndim: int, last: int | None, description: str) -> dict[str, Any]:
    """JSON schema of numbers under their unit."""
    bounds = {"minItems": last, "maxItems": last} if last else {"minItems": 1}
    numbers: dict = {"type": "array", "items": {"type": "number"}, **bounds}
    for _ in range(ndim - 1):
        numbers = {"type": "array", "items": numbers, "minItems": 1}
    return {
        "type": "object",
        "minProperties": 1,
        "maxProperties": 1,
        "additionalProperties": numbers,
        "description": description,
    }


def _scalar(system_unit: str):
    schema = scalar_schema(f"{DIMENSION[system_unit]} with its unit, e.g. '1 {_customary(system_unit)}'")
    read = BeforeValidator(lambda value: parse_quantity(value, system_unit))
    return Annotated[float, read, WithJsonSchema(schema), SystemUnit(system_unit)]


@dataclass(frozen=True)
class SystemUnit:
    """Marks the annotation of a field of a number, or of an array of them."""

    name: str


def unit_of(field: FieldInfo) -> str:
    """The unit that a number of a spec is computed in, '1' where it has none."""
    marks = [*field.metadata, *(mark for part in get_args(field.annotation) for mark in get_args(part)[1:])]
    return next((mark.name for mark in marks if isinstance(mark, SystemUnit)), "1")


def written(value: float, system_unit: str) -> str:
    """A number as a person would write it in a spec: 0.7854 rad as '45 deg'."""
    unit = _customary(system_unit)
    return f"{value / _factor(unit, system_unit):.12g} {unit}"


def _vector(system_unit: str, ndim: int, last: int | None = None):
    schema = array_schema(ndim, last, f"numbers under their unit, e.g. {{{_customary(system_unit)}: ...}}")
    return Annotated[
        Any,
        BeforeValidator(lambda value: parse_array(value, system_unit, ndim, last)),
        WithJsonSchema(schema),
        SystemUnit(system_unit),
    ]


Length = _scalar("mm")
Force = _scalar("N")
Stress = _scalar("MPa")
Angle = _scalar("rad")
Mass = _scalar("t")
Density = _scalar("t/mm^3")
Acceleration = _scalar("mm/s^2")
Time = _scalar("s")
Frequency = _scalar("Hz")
LengthVector = _vector("mm", 1)  # (k,) mm
LengthMatrix = _vector("mm", 2)  # (m, k) mm
LengthRange = _vector("mm", 1, 2)  # (2,) mm
LengthRanges = _vector("mm", 2, 2)  # (m, 2) mm
AngleMatrix = _vector("rad", 2, 3)  # (m, 3) rad
AngleRanges = _vector("rad", 2, 2)  # (m, 2) rad
Point = _vector("mm", 1, 3)  # (3,) mm
Points = _vector("mm", 2, 3)  # (m, 3) mm
StressVector = _vector("MPa", 1)  # (k,) MPa
StressRange = _vector("MPa", 1, 2)  # (2,) MPa
VolumeRange = _vector("mm^3", 1, 2)  # (2,) mm^3
AccelerationVector = _vector("mm/s^2", 1, 3)  # (3,) mm/s^2
Forces = _vector("N", 1)  # (k,) N
ForceVector = _vector("N", 1, 3)  # (3,) N


def _percent(given: Any) -> Any:
    """'1 %' as 0.01; all else as it is."""
    return float(given[:-1]) / 100 if isinstance(given, str) and given.endswith("%") else given


Percent = Annotated[
    float,
    Field(gt=0, lt=1),
    BeforeValidator(_percent),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1},
                {"type": "string", "pattern": r"^\s*\d+(\.\d+)?\s*%$"},
            ]
        }
    ),
]
