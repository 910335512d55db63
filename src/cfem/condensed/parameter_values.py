"""Values of parameters as the user writes them, each in its unit."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import WithJsonSchema

from cfem.condensed.parameters import Parameter
from cfem.core.errors import SpecError
from cfem.core.units import parse_quantity

# "3000 kPa", or a number where the parameter has no unit
Value = Annotated[Any, WithJsonSchema({"type": ["string", "number"]})]


def number_in(unit: str, given: Any, where: str) -> float:
    """Number in this unit, '1' for none. SpecError where it has another unit, or is no number."""
    try:
        return float(given) if unit == "1" else parse_quantity(given, unit)
    except (TypeError, ValueError) as error:
        raise SpecError(str(error), where=where) from None


def value_of(parameter: Parameter, given: Any, where: str) -> float:
    """Value in the parameter's unit. SpecError where it has another unit, or is out of the parameter's range."""
    value = number_in(parameter.unit, given, where)
    if not parameter.low <= value <= parameter.high:
        what = f"{value:g} is out of the range [{parameter.low:g}, {parameter.high:g}] {parameter.unit}"
        raise SpecError(what, where=where, do="stay within what the model knows")
    return value


def vector(parameters: Sequence[Parameter], given: Mapping[str, Any], where: str) -> np.ndarray:
    """Values (n_p,) of the parameters: those given, the others at the reference. SpecError where a name is unknown."""
    demand_known(parameters, given, where)
    return np.array(
        [
            value_of(parameter, given[parameter.name], f"{where}.{parameter.name}")
            if parameter.name in given
            else parameter.reference
            for parameter in parameters
        ]
    )


def demand_known(parameters: Sequence[Parameter], names: Any, where: str) -> None:
    known = [parameter.name for parameter in parameters]
    unknown = [name for name in names if name not in known]
    if unknown:
        raise SpecError(f"unknown parameter {unknown[0]!r}", where=where, do=f"known are {', '.join(known) or 'none'}")
