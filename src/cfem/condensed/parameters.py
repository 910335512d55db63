"""Design and material parameters p: what a family of robots differs in, and the coordinates in which it is smooth."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import WithJsonSchema

from cfem.core.errors import InputError, NumericalError, SpecError
from cfem.core.units import parse_quantity

Coordinate = Literal["linear", "log", "log(1-2p)"]


@dataclass(frozen=True)
class Parameter:
    """A number that varies from robot to robot.

    key: where the scene has it ('material.poisson')
    unit: of its numbers ('1', 'MPa', 'mm')
    low, high: its range
    reference: the scene's own value
    coordinate: the function of it in which the robot's response is smooth (log(1-2p) for Poisson's ratio: the bulk
    modulus is about its exponential)
    exact: Young's modulus of a robot of one material, without layers, that carries no load. Its effect is W ~ 1/E,
    lambda ~ E, with delta_free unchanged: never sampled, never learned"""

    name: str
    key: str
    unit: str
    low: float
    high: float
    reference: float
    coordinate: Coordinate = "linear"
    exact: bool = False

    @property
    def moves_body(self) -> bool:
        """True where the body itself differs: its geometry, or its free form."""
        return self.key.startswith(("geometry", "shape"))

    @property
    def is_stiffness(self) -> bool:
        """True of a Young's modulus, or a factor on all moduli of a material."""
        return self.key.endswith(("young", "stiffness"))

    @property
    def suffix(self) -> str:
        """The unit as it stands behind a number, ' mm'; empty where there is none."""
        return "" if self.unit == "1" else f" {self.unit}"

    def override(self, value: float) -> str:
        """The value as `--set` of a scene takes it: 'geometry.length=90 mm'."""
        return f"{self.key}={value:.10g}{self.suffix}"


def named(parameters: Sequence[Parameter], p: np.ndarray) -> dict[str, float]:
    """Values (n_p,) by the name of their parameter."""
    return dict(zip([parameter.name for parameter in parameters], p.tolist(), strict=True))


def units_of(parameters: Sequence[Parameter]) -> dict[str, str]:
    """Units by the name of their parameter, of those that have one."""
    return {parameter.name: parameter.unit for parameter in parameters if parameter.unit != "1"}


def coordinates(parameters: Sequence[Parameter], p: np.ndarray) -> np.ndarray:
    """Coordinates (..., n_p) of values (..., n_p) of `parameters`."""
    return _each(parameters, _FORWARD, p)


def values(parameters: Sequence[Parameter], q: np.ndarray) -> np.ndarray:
    """The inverse of `coordinates`."""
    return _each(parameters, _BACK, q)


def slopes(parameters: Sequence[Parameter], p: np.ndarray) -> np.ndarray:
    """Derivatives (..., n_p) d coordinate / d p."""
    return _each(parameters, _SLOPE, p)


def _each(parameters: Sequence[Parameter], functions: Mapping[str, Callable], x: np.ndarray) -> np.ndarray:
    """Values (..., n_p) of the function of each parameter's coordinate, of its own column of x."""
    x = np.asarray(x, float)
    columns = [functions[parameter.coordinate](x[..., i]) for i, parameter in enumerate(parameters)]
    return np.stack(columns, axis=-1) if columns else x[..., :0]


def shares(parameters: Sequence[Parameter], p: np.ndarray) -> np.ndarray:
    """Places (..., n_p) in [0, 1] of the coordinates of values (..., n_p) between those of the ends of the range."""
    low, high = range_coordinates(parameters)
    return (coordinates(parameters, p) - low) / (high - low)


def from_shares(parameters: Sequence[Parameter], z: np.ndarray) -> np.ndarray:
    """The inverse of `shares`."""
    low, high = range_coordinates(parameters)
    return values(parameters, low + np.asarray(z, float)[..., : len(parameters)] * (high - low))


def range_coordinates(parameters: Sequence[Parameter]) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (n_p,) of the lower and of the higher end of each range."""
    low, high = np.array([[parameter.low, parameter.high] for parameter in parameters]).reshape(-1, 2).T
    return coordinates(parameters, low), coordinates(parameters, high)


def demand_in_range(parameters: Sequence[Parameter], p: np.ndarray) -> None:
    """Raises InputError where values (..., n_p) are not finite, and NumericalError where one is outside its range by
    more than the width, in its coordinate, or where no material has it; an exact one only has to be positive."""
    if not np.isfinite(p).all():
        raise InputError(f"a parameter is a finite number; got {p.tolist()}")
    exact = np.array([parameter.exact for parameter in parameters], dtype=bool)
    with np.errstate(invalid="ignore", divide="ignore"):
        places = shares(parameters, p)
    known = np.where(exact, p > 0.0, (places >= -1.0) & (places <= 2.0))
    possible = np.array([parameter.coordinate != "log(1-2p)" for parameter in parameters], dtype=bool)
    possible = possible | ((p > -1) & (p < 0.5))
    known &= possible
    if not known.all():
        index = int((~known).reshape(-1, len(parameters)).any(axis=0).argmax())
        parameter, value = parameters[index], p[~known[..., index]][..., index].flat[0]
        if not possible[..., index].all():
            what = f"{parameter.name} = {value:g} is a Poisson's ratio of no material, which is between -1 and 0.5"
            raise NumericalError(what, do=f"the model was trained on {parameter.low:g} to {parameter.high:g}")
        what = f"{parameter.name} = {value:g}{parameter.suffix} is far outside what the model was trained on"
        do = "ask inside, or sample a wider range and train again"
        raise NumericalError(f"{what} ({parameter.low:g} to {parameter.high:g})", do=do)


def to_json(parameters: Sequence[Parameter]) -> list[dict[str, Any]]:
    return [asdict(parameter) for parameter in parameters]


def from_json(data: Sequence[dict[str, Any]]) -> tuple[Parameter, ...]:
    return tuple(Parameter(**entry) for entry in data)


def sampled(parameters: Sequence[Parameter]) -> tuple[Parameter, ...]:
    """Parameters that a dataset has columns for."""
    return tuple(parameter for parameter in parameters if not parameter.exact)


def references(parameters: Sequence[Parameter]) -> np.ndarray:
    """The scene's own values (n_p,)."""
    return np.array([parameter.reference for parameter in parameters], dtype=float)


def completed(parameters: Sequence[Parameter], p: np.ndarray) -> np.ndarray:
    """Values (..., n_p) of all parameters from those (..., n_q) of the sampled ones; exact ones at their reference."""
    p = np.asarray(p, float)
    full = np.tile(references(parameters), (*p.shape[:-1], 1))
    full[..., [not parameter.exact for parameter in parameters]] = p
    return full


_FORWARD = {"linear": lambda p: p, "log": np.log, "log(1-2p)": lambda p: np.log1p(-2 * p)}
_BACK = {"linear": lambda q: q, "log": np.exp, "log(1-2p)": lambda q: -np.expm1(q) / 2}
_SLOPE = {"linear": np.ones_like, "log": lambda p: 1 / p, "log(1-2p)": lambda p: -2 / (1 - 2 * p)}


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
