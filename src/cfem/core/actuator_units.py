"""Quantities of actuators: a cable's in mm and N, a chamber's in mm^3 and MPa.

A spec does not know which actuators the robot has, so a quantity keeps the unit that it was written in, and the stage,
which knows the robot, calls `demand_units`: 10 MPa must never become a limit of 10 N."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator, PlainValidator, WithJsonSchema

from cfem.core.errors import SpecError
from cfem.core.spec import Spec
from cfem.core.units import DIMENSION, SystemUnit, array_schema, parse_array, parse_quantity, scalar_schema

CABLE, CHAMBER = ("mm", "N"), ("mm^3", "MPa")


class ActuatorNumber(float):
    """A number in the system unit `unit`, which is what it was written as a quantity of."""

    unit: str

    def __new__(cls, value: float, unit: str) -> "ActuatorNumber":
        number = super().__new__(cls, value)
        number.unit = unit
        return number

    def __getnewargs__(self) -> tuple[float, str]:
        return float(self), self.unit


def _first(read: Any, value: Any, units: tuple[str, str]) -> Any:
    """Value of `read(value, unit)` and its unit, for the first unit that fits. ValueError where none does."""
    try:
        return read(value, units[0]), units[0]
    except ValueError as error:
        try:
            return read(value, units[1]), units[1]
        except ValueError:
            hint = f", or {units[1]}" if "is not a unit" in str(error) else f" (of a chamber: in {units[1]})"
            raise ValueError(f"{error}{hint}") from None


def _scalar(units: tuple[str, str]) -> Any:
    return Annotated[
        float,
        PlainValidator(lambda value: ActuatorNumber(*_first(parse_quantity, value, units))),
        WithJsonSchema(scalar_schema(f"with its unit, e.g. '1 {units[0]}' or, for a chamber, '1 {units[1]}'")),
        SystemUnit(units[0]),
    ]


def _vector(units: tuple[str, str]) -> Any:
    def read(value: Any) -> tuple[ActuatorNumber, ...]:
        numbers, unit = _first(lambda data, unit: parse_array(data, unit, 1), value, units)
        return tuple(ActuatorNumber(number, unit) for number in numbers.tolist())

    text = f"a number an actuator, e.g. {{{units[0]}: ...}} or, of chambers, {{{units[1]}: ...}}"
    return Annotated[Any, BeforeValidator(read), WithJsonSchema(array_schema(1, None, text))]


_DISPLACEMENT, _FORCE = ((CABLE[side], CHAMBER[side]) for side in (0, 1))
Displacement = _scalar(_DISPLACEMENT)  # a cable's shortening, a chamber's growth
Effort = _scalar(_FORCE)  # a cable's tension, a chamber's pressure
Displacements = _vector(_DISPLACEMENT)  # one an actuator
Efforts = _vector(_FORCE)


def demand_units(spec: Spec, units: Sequence[tuple[str, str]], where: str = "") -> None:
    """Raises SpecError naming the first quantity of the spec, or of a part of it, that is not in the unit of every
    actuator. units: of the displacement and of the force of each."""
    for key, number in _numbers(spec, where):
        side = 0 if number.unit in _DISPLACEMENT else 1
        expected = next((pair[side] for pair in units if pair[side] != number.unit), None)
        if expected is not None:
            what = "displacement" if side == 0 else "force"
            raise SpecError(
                f"is a {DIMENSION[number.unit]} ({number.unit}), but the {what} of this robot's actuators is a "
                f"{DIMENSION[expected]} ({expected})",
                where=key,
                do=f"give it in {expected}" if len({pair[side] for pair in units}) == 1 else "leave it out",
            )


def _numbers(node: Any, where: str) -> Iterator[tuple[str, ActuatorNumber]]:
    """Quantities of a spec or a part of it, with their keys."""
    if isinstance(node, ActuatorNumber):
        yield where, node
        return
    parts: Iterable[tuple[Any, Any]] = ()
    if isinstance(node, Spec):
        parts = ((name, getattr(node, name)) for name in type(node).model_fields)
    elif isinstance(node, dict):
        parts = node.items()
    elif isinstance(node, list | tuple):
        parts = enumerate(node)
    for name, part in parts:
        yield from _numbers(part, f"{where}.{name}" if where else str(name))
