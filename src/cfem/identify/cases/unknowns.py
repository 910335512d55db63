"""What is to be found, as numbers z of size one: a parameter lies at z = 0 where the scene has it, and at z = 1 one
standard deviation of what is known of it away, or a quarter of its range where nothing is known."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.condensed.parameters import Parameter, number_in, range_coordinates, slopes
from cfem.core.errors import SpecError
from cfem.identify.cases.spec import Unknown, is_of_rig
from cfem.identify.fit.free_parameter import FreeParameter, from_reference
from cfem.sample.parameters import scene_parameters
from cfem.sample.spec import ParameterSpec

_RIG_UNITS = {"turn": "rad", "shift": "mm"}


@dataclass(frozen=True)
class CaseUnknown(FreeParameter):
    """An unknown of robot or rig.

    keys:    of the scene or the rig
    session: that it is of, None for all
    known:   whether the measurements add to prior knowledge"""

    keys: tuple[str, ...]
    session: str | None
    known: bool

    @property
    def of_scene(self) -> bool:
        """True where another value needs another equilibrium for its robot, not only for its forces."""
        return not is_of_rig(self.keys[0])


def case_unknowns(
    named: Mapping[str, Unknown], scene: Path, sessions: Sequence[str], actuators: Mapping[str, str]
) -> list[CaseUnknown]:
    """The unknowns that a spec asks for, one for each session where it asks by session. SpecError naming the parameter
    whose key, range or knowledge is wrong.

    actuators: unit of the force of each"""
    unknowns = []
    for name, spec in named.items():
        where = f"parameters.{name}"
        of_rig = {is_of_rig(key) for key in spec.keys}
        if len(of_rig) > 1:
            raise SpecError("key: names numbers of the scene and of the rig", where=where, do="make two parameters")
        parameter = _of_rig(name, spec, actuators, where) if of_rig.pop() else _of_scene(name, spec, scene)
        scale = _scale(spec, parameter, where)
        for session in sessions if spec.by else [None]:
            free = from_reference(name if session is None else f"{name} ({session})", parameter, scale)
            unknowns.append(
                CaseUnknown(**vars(free), keys=tuple(spec.keys), session=session, known=spec.sd is not None)
            )
    return unknowns


def _of_scene(name: str, spec: Unknown, scene: Path) -> Parameter:
    """The parameter of the first of its keys; all must be numbers of the scene."""
    first, *_ = [scene_parameters({name: ParameterSpec(key=key, range=spec.range)}, scene)[0] for key in spec.keys]
    coordinate = "log" if first.unit == "t/mm^3" else first.coordinate
    return Parameter(name, first.key, first.unit, first.low, first.high, first.reference, coordinate)


def _of_rig(name: str, spec: Unknown, actuators: Mapping[str, str], where: str) -> Parameter:
    """The parameter of a number of the rig. SpecError where its keys or its range are wrong."""
    numbers = [_rig_number(key, actuators, where) for key in spec.keys]
    if len({unit for unit, _ in numbers}) > 1:
        raise SpecError("key: numbers of different units", where=where, do="make two parameters")
    unit, reference = numbers[0]
    low, high = (number_in(unit, text, f"{where}.range") for text in spec.ends)
    if not low < high:
        raise SpecError(
            "range: expected two different values, the smaller first", where=where, do="such as range: [1, 2]"
        )
    reference = (low + high) / 2 if reference is None else reference
    if not low <= reference <= high:
        raise SpecError(
            f"range: must hold {reference:g}, which the rig has if nothing is wrong", where=where, do="widen the range"
        )
    return Parameter(name, spec.keys[0], unit, low, high, reference)


def _rig_number(key: str, actuators: Mapping[str, str], where: str) -> tuple[str, float | None]:
    """Unit and nominal value of a number of the rig, None where the rig has no such limit."""
    parts = key.split(".")
    if parts[0] == "drive" and len(parts) == 3 and parts[1] in actuators and parts[2] in ("scale", "offset", "limit"):
        unit = actuators[parts[1]]
        return {"scale": ("1", 1.0), "offset": (unit, 0.0), "limit": (unit, None)}[parts[2]]
    if parts[0] == "frame" and len(parts) == 3 and parts[1] in _RIG_UNITS and parts[2] in ("x", "y", "z"):
        return _RIG_UNITS[parts[1]], 0.0
    do = f"use drive.NAME.scale, offset or limit of {', '.join(actuators)}, frame.turn.x or frame.shift.x"
    raise SpecError(f"key: the rig has no '{key}'", where=where, do=do)


def _scale(spec: Unknown, parameter: Parameter, where: str) -> float:
    """Scale of z in the parameter's coordinate: a quarter of the range, or the standard deviation that is known."""
    if spec.sd is None:
        low, high = range_coordinates([parameter])
        return float(abs(high[0] - low[0])) / 4
    text = spec.sd.strip()
    if text.endswith("%"):
        sd = number_in("1", text[:-1], f"{where}.sd") / 100 * abs(parameter.reference)
    else:
        sd = number_in(parameter.unit, text, f"{where}.sd")
    if not sd > 0:
        raise SpecError("sd: must be above 0, and a percentage needs a value that is not 0", where=where)
    return float(sd * abs(slopes([parameter], np.array([parameter.reference]))[0]))
