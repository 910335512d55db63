"""Commands over time from a table, and where a motion under them begins."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from cfem.core.errors import InputError, NumericalError
from cfem.dataset.tables import read_table
from cfem.motion.model import MotionModel
from cfem.motion.payload import Payload
from cfem.motion.step import CondensedMotion, at_rest

Kind = Literal["displacement", "force"]
_ITERATIONS = 30


@dataclass(frozen=True)
class CommandTable:
    """Commands over time."""

    kind: Kind
    t: np.ndarray  # (k,) s, ascending
    values: np.ndarray  # (k, n_a) mm or N (mm^3 or MPa of chambers)

    def at(self, t: float) -> np.ndarray:
        """Command (n_a,) at a time, linearly between the rows; the first before them and the last after."""
        return np.array([np.interp(t, self.t, column) for column in self.values.T])


def read_commands(path: Path, model: MotionModel) -> CommandTable:
    """Commands from a table of a file. InputError naming the file and what is wrong in it."""
    actuators, units = model.rows.actuators, {"time": "s"}
    for name, (displacement, force) in zip(actuators, model.static.actuator_units, strict=True):
        units |= {f"{name}.displacement": displacement, f"{name}.force": force}
    read = read_table(path, units)
    columns = read.columns
    kinds = [kind for kind in ("displacement", "force") if any(f"{name}.{kind}" in columns for name in actuators)]
    if len(kinds) != 1:
        what = "has both displacements and forces" if kinds else "has no commands"
        example = f"{actuators[0]}.displacement [{units[f'{actuators[0]}.displacement']}]"
        raise InputError(what, where=str(path), do=f"give each actuator one column, such as `{example}`")
    wanted = ["time", *(f"{name}.{kinds[0]}" for name in actuators)]
    missing = next((name for name in wanted if name not in columns), None)
    if missing is not None:
        raise InputError(f"has no column '{missing}'", where=str(path), do="add it")
    table = np.stack([columns[name] for name in wanted], axis=1)
    if not len(table):
        raise InputError("has no rows", where=str(path), do="give every command a number at every time")
    gaps = np.flatnonzero(~np.isfinite(table).all(axis=1))
    if len(gaps):
        raise InputError("a gap", where=read.places[gaps[0]], do="give every command a number at every time")
    back = np.flatnonzero(~(np.diff(table[:, 0]) > 0))
    if len(back):
        where = read.places[back[0] + 1]
        raise InputError("its time is not after that of the row before", where=where, do="sort the rows")
    return CommandTable("displacement" if kinds[0] == "displacement" else "force", table[:, 0], table[:, 1:])


def starting(model: MotionModel, commands: CommandTable, payload: Payload | None = None) -> CondensedMotion:
    """Standing still under the first command, at its time. NumericalError where no state of rest is found."""
    begin, first, n_a = float(commands.t[0]), commands.values[0], model.n_a
    if commands.kind == "displacement":
        return replace(at_rest(model, first, payload), t=begin)
    states = model.static.domain.states
    near = states[np.argmin(np.linalg.norm((states[:, n_a : 2 * n_a] - first) / _width(states[:, n_a:]), axis=1)), :n_a]
    delta = near.copy()
    for _ in range(_ITERATIONS):
        rest = at_rest(model, delta, payload)
        missing = first - rest.lam
        change = np.linalg.solve(model.at(delta).stiff, missing)
        delta = delta + change
        if not np.isfinite(delta).all():
            break
        if np.abs(change).max() <= 1e-10 * model.static.length:
            return replace(at_rest(model, delta, payload), t=begin)
    raise NumericalError("no state of rest is found under the first forces", do="begin with others, such as none")


def _width(forces: np.ndarray) -> float:
    return float(np.ptp(forces)) or 1.0
