"""What was measured on the robot: a table with units, or the states of a dataset.

A table has a row a state and columns named after the rows of W: `cable.displacement`, `cable.force` of an actuator,
`tip.x` the position of an effector, `tip.x.displacement` from where it rests. In .csv and .parquet the unit stands
behind the name, `tip.x [mm]`; in .yaml every number has its own. It must be a unit of what the column holds: a length
for `tip.x`, a volume for the displacement of a chamber. An empty cell was not measured."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from cfem.condensed import Rows
from cfem.core.actuator_units import CABLE
from cfem.core.errors import InputError
from cfem.core.stage import artefact_file
from cfem.dataset.tables import Table, Units, read_table


@dataclass(frozen=True)
class Measurements:
    """m states. kind: what drove the actuators; u (m, n_a): by how much, taken for exact; measured, nan where not: x_e
    and delta_e (m, n_e) mm positions and displacements of the effectors, dual (m, n_a) the actuators' forces where
    displacements drove them, else their displacements."""

    kind: Literal["displacement", "force"]
    u: np.ndarray
    x_e: np.ndarray
    delta_e: np.ndarray
    dual: np.ndarray

    def __len__(self) -> int:
        return len(self.u)

    def of(self, sources: Iterable[str]) -> "Measurements":
        """With only the effectors, the actuators, or both."""
        e, a = ("effectors" in sources, "actuators" in sources)
        hide = np.full_like
        return Measurements(
            self.kind,
            self.u,
            self.x_e if e else hide(self.x_e, np.nan),
            self.delta_e if e else hide(self.delta_e, np.nan),
            self.dual if a else hide(self.dual, np.nan),
        )


def read_measurements(
    path: Path,
    rows: Rows,
    kind: str,
    split: str = "train",
    chosen: Sequence[int] | None = None,
    actuator_units: Sequence[tuple[str, str]] | None = None,
) -> Measurements:
    """actuator_units: of each actuator's displacement and force, mm and N unless given. InputError naming the file, the
    row and the column of what cannot be read."""
    if path.is_dir():
        path = artefact_file(path, f"{split}.parquet")
        found, numbers = _of_dataset(path, rows, kind)
    else:
        units = _units(rows, actuator_units or [CABLE] * rows.n_a)
        found = _of_table(read_table(path, units), rows, kind, path)
        numbers = list(range(len(found)))
    if chosen is not None:
        missing = [one for one in chosen if one not in numbers]
        if missing:
            what = f"has no row {missing[0]}: its {len(numbers)} rows are {numbers[0]} to {numbers[-1]}"
            raise InputError(
                what + (", less those that failed" if len(numbers) <= numbers[-1] else ""), where=str(path)
            )
        index = [numbers.index(one) for one in chosen]
        found = Measurements(kind, *(getattr(found, name)[index] for name in ("u", "x_e", "delta_e", "dual")))
    return found


def _units(rows: Rows, actuator_units: Sequence[tuple[str, str]]) -> Units:
    """Every column that a table may have."""
    units = {}
    for name, (length, _) in zip(rows.effectors, rows.effector_units, strict=True):
        units |= {name: length, f"{name}.displacement": length}
    for name, (displacement, force) in zip(rows.actuators, actuator_units, strict=True):
        units |= {f"{name}.displacement": displacement, f"{name}.force": force}
    return units


def _of_dataset(path: Path, rows: Rows, kind: str) -> tuple[Measurements, list[int]]:
    """And the numbers of its rows in their plan: those that failed have none of a measurement."""
    from cfem.dataset.reader import read_dataset

    data = read_dataset(path)
    if data.rows != rows:
        what = f"was measured on another robot: it {data.rows.difference(rows, 'the model')}"
        raise InputError(what, where=str(path), do="use measurements and model of one robot")
    u, dual = (data.delta_a, data.lambda_a) if kind == "displacement" else (data.lambda_a, data.delta_a)
    return Measurements(kind, u, np.full_like(data.delta_e, np.nan), data.delta_e, dual), data.id.tolist()


def _of_table(table: Table, rows: Rows, kind: str, path: Path) -> Measurements:
    count, columns = len(table), table.columns
    if not count:
        raise InputError("holds no measurements", where=str(path), do="add one row per measured state")
    other = "force" if kind == "displacement" else "displacement"
    names = {
        "u": [f"{name}.{kind}" for name in rows.actuators],
        "x_e": list(rows.effectors),
        "delta_e": [f"{name}.displacement" for name in rows.effectors],
        "dual": [f"{name}.{other}" for name in rows.actuators],
    }
    for name in names["u"]:
        missing = np.flatnonzero(np.isnan(columns.get(name, np.full(count, np.nan))))
        if len(missing):
            what = f"has no '{name}', by which the robot was driven"
            raise InputError(what, where=table.places[missing[0]], do="measure it, or say `driven:` otherwise")
    nothing = np.full(count, np.nan)
    groups = {key: np.stack([columns.get(name, nothing) for name in group], axis=1) for key, group in names.items()}
    return Measurements(kind, **groups)
