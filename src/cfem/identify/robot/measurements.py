"""Measurements on the robot: a table with units, or the states of a dataset.

A table has a row a state and columns named after the rows of W: `cable.displacement`, `cable.force` of an actuator,
`tip.x` the position of an effector, `tip.x.displacement` from where it rests. In .csv and .parquet the unit stands
behind the name, `tip.x [mm]`; in .yaml every number has its own. It must be a unit of what the column holds: a length
for `tip.x`, a volume for the displacement of a chamber. An empty cell was not measured."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cfem.condensed import Rows
from cfem.core.actuator_units import CABLE
from cfem.core.artefact.content import artefact_file
from cfem.core.errors import InputError
from cfem.dataset.tables import Table, Units, read_table
from cfem.identify.columns import DUAL, Driven, actuator_columns


@dataclass(frozen=True)
class Measurements:
    """Measured numbers of m states, nan where not measured.

    kind:    what drove the actuators
    u:       (m, n_a) by how much, taken for exact
    x_e:     (m, n_e) mm positions of the effectors
    delta_e: (m, n_e) mm displacements of the effectors
    dual:    (m, n_a) the actuators' forces where displacements drove them, else their displacements"""

    kind: Driven
    u: np.ndarray
    x_e: np.ndarray
    delta_e: np.ndarray
    dual: np.ndarray

    def __len__(self) -> int:
        return len(self.u)

    @property
    def all(self) -> np.ndarray:
        """Measured numbers (m, 2 n_e + n_a): positions, displacements, duals."""
        return np.hstack([self.x_e, self.delta_e, self.dual])

    def of(self, sources: Iterable[str]) -> "Measurements":
        """The measurements of only the 'effectors', only the 'actuators', or both."""
        hidden = [] if "effectors" in sources else ["x_e", "delta_e"]
        hidden += [] if "actuators" in sources else ["dual"]
        return replace(self, **{name: np.full_like(getattr(self, name), np.nan) for name in hidden})

    def at(self, states: Sequence[int]) -> "Measurements":
        """The measurements of some states, by their numbers."""
        index = list(states)
        return Measurements(self.kind, self.u[index], self.x_e[index], self.delta_e[index], self.dual[index])


def read_measurements(
    path: Path,
    rows: Rows,
    kind: Driven,
    split: str = "train",
    chosen: Sequence[int] | None = None,
    actuator_units: Sequence[tuple[str, str]] | None = None,
) -> Measurements:
    """Measurements from a table, or from a split of a dataset's folder. InputError naming the file, the row and the
    column of what cannot be read.

    chosen:         numbers of rows, all unless given
    actuator_units: of each actuator's displacement and force, mm and N unless given"""
    if path.is_dir():
        path = artefact_file(path, f"{split}.parquet")
        measurements, numbers = _of_dataset(path, rows, kind, chosen)
    else:
        units = _units(rows, actuator_units or [CABLE] * rows.n_a)
        measurements = _of_table(read_table(path, units), rows, kind, path)
        numbers = list(range(len(measurements)))
    if chosen is None:
        return measurements
    missing = [number for number in chosen if number not in numbers]
    if missing:
        what = f"has no row {missing[0]}: its {len(numbers)} rows are {numbers[0]} to {numbers[-1]}"
        failed = ", less those that failed" if len(numbers) <= numbers[-1] else ""
        raise InputError(what + failed, where=str(path))
    return measurements.at([numbers.index(number) for number in chosen])


def _units(rows: Rows, actuator_units: Sequence[tuple[str, str]]) -> Units:
    """Units of every column that a table may have."""
    units = {}
    for name, (length, _) in zip(rows.effectors, rows.effector_units, strict=True):
        units |= {name: length, f"{name}.displacement": length}
    return units | actuator_columns(rows.actuators, actuator_units)


def _of_dataset(path: Path, rows: Rows, kind: Driven, chosen: Sequence[int] | None) -> tuple[Measurements, list[int]]:
    """The measurements, and the numbers of their rows in the plan: those that failed have none of a measurement.
    InputError where those that are chosen are of several robots."""
    from cfem.dataset.reader import read_dataset

    data = read_dataset(path)
    if data.rows != rows:
        what = f"was measured on another robot: it {data.rows.difference(rows, 'the model')}"
        raise InputError(what, where=str(path), do="use measurements and model of one robot")
    p = data.p if chosen is None else data.p[np.isin(data.id, chosen)]
    varied = [
        parameter.name
        for parameter, low, high in zip(
            data.parameters, p.min(axis=0, initial=np.inf), p.max(axis=0, initial=-np.inf), strict=True
        )
        if high > low
    ]
    if varied:
        what = f"its states are of robots that differ in {', '.join(varied)}"
        raise InputError(what, where=str(path), do="choose states of one robot by `rows`, or sample one robot")
    u, dual = (data.delta_a, data.lambda_a) if kind == "displacement" else (data.lambda_a, data.delta_a)
    return Measurements(kind, u, np.full_like(data.delta_e, np.nan), data.delta_e, dual), data.id.tolist()


def _of_table(table: Table, rows: Rows, kind: Driven, path: Path) -> Measurements:
    """The measurements of a table. InputError where it has no state, or lacks what drove an actuator."""
    if not len(table):
        raise InputError("holds no measurements", where=str(path), do="add one row per measured state")
    driving = [f"{name}.{kind}" for name in rows.actuators]
    u = table.stack(driving)
    for state, actuator in np.argwhere(np.isnan(u.T))[:1, ::-1]:
        what = f"has no '{driving[actuator]}', by which the robot was driven"
        raise InputError(what, where=table.places[state], do="measure it, or say `driven:` otherwise")
    return Measurements(
        kind,
        u,
        table.stack(rows.effectors),
        table.stack([f"{name}.displacement" for name in rows.effectors]),
        table.stack([f"{name}.{DUAL[kind]}" for name in rows.actuators]),
    )
