"""What is to be found, as numbers z of size one: a parameter lies at z = 0 where the scene has it, and at z = 1 one
standard deviation of what is known of it away, or a quarter of its range where nothing is known."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.cases.spec import Unknown, is_of_rig
from cfem.condensed.parameters import Parameter, coordinates, slopes, values
from cfem.core.errors import SpecError
from cfem.core.units import parse_quantity
from cfem.sample.parameters import scene_parameters
from cfem.sample.spec import ParameterSpec

_RIG_UNITS = {"turn": "rad", "shift": "mm"}


@dataclass(frozen=True)
class Sought:
    """One number. name; keys: of the scene or the rig; session: that it is of, None for all; parameter: unit, range,
    reference and coordinate; scale: of z in that coordinate; known: whether the measurements add to prior knowledge."""

    name: str
    keys: tuple[str, ...]
    session: str | None
    parameter: Parameter
    scale: float
    known: bool

    @property
    def of_scene(self) -> bool:
        """Whether another value needs another equilibrium for its robot, not only for its forces."""
        return not is_of_rig(self.keys[0])

    @property
    def bounds(self) -> tuple[float, float]:
        """Of z."""
        one = [self.parameter]
        middle = coordinates(one, np.array([self.parameter.reference]))[0]
        ends = [coordinates(one, np.array([end]))[0] for end in (self.parameter.low, self.parameter.high)]
        return (min(ends) - middle) / self.scale, (max(ends) - middle) / self.scale

    def value(self, z: float) -> float:
        one = [self.parameter]
        middle = coordinates(one, np.array([self.parameter.reference]))
        return float(values(one, middle + z * self.scale)[0])


def sought(
    asked: Mapping[str, Unknown], scene: Path, sessions: Sequence[str], actuators: Mapping[str, str]
) -> list[Sought]:
    """actuators: unit of the force of each. SpecError naming the parameter whose key, range or knowledge is wrong."""
    found = []
    for name, one in asked.items():
        where = f"parameters.{name}"
        kinds = {is_of_rig(key) for key in one.keys}
        if len(kinds) > 1:
            raise SpecError("key: names numbers of the scene and of the rig", where=where, do="make two parameters")
        parameter = _of_rig(name, one, actuators, where) if kinds.pop() else _of_scene(name, one, scene)
        scale = _scale(one, parameter, where)
        for session in sessions if one.by else [None]:
            label = name if session is None else f"{name} ({session})"
            found.append(Sought(label, tuple(one.keys), session, parameter, scale, one.sd is not None))
    return found


def _of_scene(name: str, one: Unknown, scene: Path) -> Parameter:
    """That of the first of its keys; all must be numbers of the scene."""
    made = [scene_parameters({name: ParameterSpec(key=key, range=one.range)}, scene)[0] for key in one.keys]
    first = made[0]
    coordinate = "log" if first.unit == "t/mm^3" else first.coordinate
    return Parameter(name, first.key, first.unit, first.low, first.high, first.reference, coordinate)


def _of_rig(name: str, one: Unknown, actuators: Mapping[str, str], where: str) -> Parameter:
    units, references = set(), set()
    for key in one.keys:
        unit, reference = _rig_number(key, actuators, where)
        units.add(unit)
        references.add(reference)
    if len(units) > 1:
        raise SpecError("key: numbers of different units", where=where, do="make two parameters")
    unit, reference = units.pop(), references.pop()
    low, high = (_quantity(text, unit, f"{where}.range") for text in one.ends)
    if not low < high:
        raise SpecError(
            "range: expected two different values, the smaller first", where=where, do="such as range: [1, 2]"
        )
    reference = (low + high) / 2 if reference is None else reference
    if not low <= reference <= high:
        raise SpecError(
            f"range: must hold {reference:g}, which the rig has if nothing is wrong", where=where, do="widen the range"
        )
    return Parameter(name, one.keys[0], unit, low, high, reference)


def _rig_number(key: str, actuators: Mapping[str, str], where: str) -> tuple[str, float | None]:
    """Unit and nominal value, None where the rig has no such limit."""
    parts = key.split(".")
    if parts[0] == "drive" and len(parts) == 3 and parts[1] in actuators and parts[2] in ("scale", "offset", "limit"):
        unit = actuators[parts[1]]
        return {"scale": ("1", 1.0), "offset": (unit, 0.0), "limit": (unit, None)}[parts[2]]
    if parts[0] == "frame" and len(parts) == 3 and parts[1] in _RIG_UNITS and parts[2] in ("x", "y", "z"):
        return _RIG_UNITS[parts[1]], 0.0
    do = f"use drive.NAME.scale, offset or limit of {', '.join(actuators)}, frame.turn.x or frame.shift.x"
    raise SpecError(f"key: the rig has no '{key}'", where=where, do=do)


def _quantity(text: Any, unit: str, where: str) -> float:
    try:
        return float(text) if unit == "1" else parse_quantity(text, unit)
    except ValueError as error:
        raise SpecError(str(error), where=where) from None


def _scale(one: Unknown, parameter: Parameter, where: str) -> float:
    """In the parameter's coordinate."""
    at = np.array([parameter.reference])
    if one.sd is None:
        low, high = (coordinates([parameter], np.array([end]))[0] for end in (parameter.low, parameter.high))
        return float(abs(high - low)) / 4
    text = one.sd.strip()
    if text.endswith("%"):
        sd = _quantity(text[:-1], "1", f"{where}.sd") / 100 * abs(parameter.reference)
    else:
        sd = _quantity(text, parameter.unit, f"{where}.sd")
    if not sd > 0:
        raise SpecError("sd: must be above 0, and a percentage needs a value that is not 0", where=where)
    return float(sd * abs(slopes([parameter], at)[0]))
