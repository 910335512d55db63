"""`discrepancy` of a scene: what its finite elements lack at the effectors, as a calibration by load cases says."""

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, WithJsonSchema

from cfem.condensed import Rows
from cfem.condensed.discrepancy import Discrepancy, terms_of
from cfem.condensed.parameters import number_in
from cfem.core.errors import SpecError
from cfem.core.spec import Spec
from cfem.core.units import Point

_QUANTITY = {"type": "string", "description": "a force or a pressure with its unit, e.g. '2 N' or '30 kPa'"}


class DiscrepancyTerm(Spec):
    """A part of the discrepancy: in proportion to one relative force, or to the product of two."""

    forces: list[str] = Field(min_length=1, max_length=2)
    """Actuators whose relative forces are multiplied; one that stands twice is squared."""
    effectors: dict[str, Point]
    """Displacement of effectors where these relative forces are 1."""


class DiscrepancySpec(Spec):
    """What finite elements lack: displacements of effectors, smooth in the forces, and none without force."""

    largest: dict[str, Annotated[Any, AfterValidator(str), WithJsonSchema(_QUANTITY)]] = Field(min_length=1)
    """Largest force of each actuator in the calibration. Relative forces are multiples of it; beyond, the discrepancy
    stays what it is there."""
    terms: list[DiscrepancyTerm] = []
    """Parts of the discrepancy, which add up."""


def discrepancy_in(
    spec: DiscrepancySpec | None, robot_rows: Rows, units: Sequence[tuple[str, str]]
) -> Discrepancy | None:
    """The discrepancy of a robot, None where the scene has none. SpecError where an actuator or effector is unknown, or
    a largest force is missing, has another unit or is not above zero.

    units: (displacement, force) of each actuator"""
    if spec is None:
        return None
    actuators, rows = robot_rows.actuators, robot_rows.effectors
    _demand_known(spec.largest, actuators, "discrepancy.largest", "actuator")
    missing = [name for name in actuators if name not in spec.largest]
    if missing:
        raise SpecError(f"lacks actuator '{missing[0]}'", where="discrepancy.largest", do="give its largest force")
    largest = np.empty(len(actuators))
    for index, (name, (_, unit)) in enumerate(zip(actuators, units, strict=True)):
        where = f"discrepancy.largest.{name}"
        largest[index] = number_in(unit, spec.largest[name], where)
        if not largest[index] > 0:
            raise SpecError("must be above 0", where=where)
    terms, known = terms_of(len(actuators)), {row.rpartition(".")[0] for row in rows}
    weights = np.zeros((len(terms), len(rows)))
    for number, part in enumerate(spec.terms):
        where = f"discrepancy.terms.{number}"
        _demand_known(part.forces, actuators, f"{where}.forces", "actuator")
        _demand_known(part.effectors, known, f"{where}.effectors", "effector")
        term = terms.index(tuple(sorted(actuators.index(name) for name in part.forces)))
        for name, displacement in part.effectors.items():
            columns = [rows.index(f"{name}.{axis}") for axis in "xyz" if f"{name}.{axis}" in rows]
            if len(columns) < 3:
                raise SpecError(f"effector '{name}' has no rows x, y and z", where=f"{where}.effectors")
            weights[term, columns] += displacement
    used = np.flatnonzero(weights.any(axis=0))
    return Discrepancy(tuple(rows[i] for i in used), largest, weights[:, used]) if len(used) else None


def _demand_known(names: Any, known: Any, where: str, what: str) -> None:
    """SpecError where a name is none of those that the scene has."""
    strange = [name for name in names if name not in known]
    if strange:
        raise SpecError(f"the scene has no {what} '{strange[0]}'", where=where, do=f"use {', '.join(sorted(known))}")
