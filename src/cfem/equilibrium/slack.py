"""Which unilateral actuators are slack: cables that are let out farther than their path is long, or would push."""

from dataclasses import replace

import numpy as np

from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.newton import NewtonResult
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.solution import State


def no_push(problem: Problem, actuation: Actuation) -> Actuation:
    """A unilateral actuator that is asked to push by a given force goes slack."""
    offset, n_a = actuation.offset.copy(), problem.robot.rows.n_a
    given = problem.robot.unilateral & ~actuation.C[:, :n_a].any(axis=0)
    offset[:n_a][given] = np.maximum(offset[:n_a][given], 0.0)
    return replace(actuation, offset=offset)


def taut_rows(problem: Problem, actuation: Actuation, near: State | None) -> np.ndarray:
    """(m,) the rows to hold at first: not those of cables that are longer than their path in the state nearby."""
    taut = np.ones(len(actuation.C), dtype=bool)
    x = problem.rest if near is None else near.x
    for index, actuator in _unilateral_rows(problem, actuation):
        row = problem.robot.actuators[actuator]
        spare = actuation.C[index, actuator] * (row.value(x) - row.rest)[0] - actuation.target[index]
        taut[index] = spare <= 1e-3 * problem.robot.body.mesh.size
    return taut


def change_of_slack(problem: Problem, actuation: Actuation, taut: np.ndarray, result: NewtonResult) -> int | None:
    """The prescribed row to let go (it pushes) or to take up (its path has become too long), None where all is well."""
    pushing = most_pushing(problem, actuation, taut, result)
    lack = np.zeros(len(taut))
    for index, _ in _unilateral_rows(problem, actuation):
        if not taut[index]:
            lack[index] = actuation.target[index] - actuation.C[index] @ result.at.delta
    if pushing is None and len(taut) and lack.max() > 1e-9 * problem.robot.body.mesh.size:
        return int(lack.argmax())
    return pushing


def most_pushing(problem: Problem, actuation: Actuation, taut: np.ndarray, result: NewtonResult) -> int | None:
    """The prescribed row of the cable that pushes most, None where none does."""
    tension = np.zeros(len(taut))
    for index, actuator in _unilateral_rows(problem, actuation):
        if taut[index]:
            tension[index] = result.lam[actuator]
    pushes = len(taut) and tension.min() < -1e-9 * max(np.abs(result.lam).max(), problem.force_floor)
    return int(tension.argmin()) if pushes else None


def only(actuation: Actuation, taut: np.ndarray) -> Actuation:
    """With these of its rows (m,)."""
    return replace(actuation, C=actuation.C[taut], target=actuation.target[taut])


def _unilateral_rows(problem: Problem, actuation: Actuation) -> list[tuple[int, int]]:
    """(row of C, actuator) of the rows that prescribe one unilateral actuator each."""
    rows = [(index, np.flatnonzero(row)) for index, row in enumerate(actuation.C)]
    unilateral = problem.robot.unilateral
    return [(index, row[0]) for index, row in rows if len(row) == 1 and row[0] < len(unilateral) and unilateral[row[0]]]
