"""What the parameters of a robot change while its state stays where it is: differences of robots on either side.

The state is carried along: where a node's place at rest moves by dX, the node moves by F dX, F the deformation around
it, so that the change hardly strains the body. (At the same displacements it would strain it by far more than the
design does, and the small difference be lost to truncation.) What is held stays at its place at rest. Any such way
serves: what the state does beside is what equilibrium answers. The multipliers stay, and Z = A^-1 B, B = H^T of all
rows, with which

    Phi = B^T Z + Z^T B - Z^T A Z

is W and stationary in Z. Of numbers that depend on few combinations of W, the forms 2 b . z - z^T A z + m z^T M z of
as few columns are enough, b = B v at constant v. Where a robot on either side has the very body of the one at hand,
nothing of the body is computed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cfem.equilibrium.derivatives.parameter_slopes import Sides
from cfem.equilibrium.system.evaluation import Evaluation
from cfem.equilibrium.system.problem import Problem, curvature_form
from cfem.equilibrium.system.robot import watched_displacements
from cfem.equilibrium.system.solution import Linearisation
from cfem.mechanics.mass import kinetic_form

Side = tuple[Problem, Evaluation]


class Changing(Protocol):
    """A number of the whole deformed body that knows how it changes from robot to robot."""

    def changes(self, problem: Problem, evaluation: Evaluation) -> Callable[[Side, Side], float]:
        """Difference of the number, to first order, between two robots near to that of `problem`, in states near
        `evaluation`."""
        ...


@dataclass(frozen=True)
class Columns:
    """c forms 2 (B v) . z - z^T A z + m z^T M z.

    v: (n, c) of all rows e, a, c
    z: (n_dof, c)
    m: (c,) 1/s^2"""

    v: np.ndarray
    z: np.ndarray
    m: np.ndarray


@dataclass(frozen=True)
class Explicit:
    """Derivatives by each of n_q parameters, the state held.

    phi: (n, n, n_q)
    forms: (c, n_q) of columns
    delta: (n, n_q) of all rows
    residual: (n_dof, n_q)
    rest_e: (n_e, n_q), where the effectors rest
    numbers: (k, n_q) of the whole body"""

    phi: np.ndarray
    forms: np.ndarray
    delta: np.ndarray
    residual: np.ndarray
    rest_e: np.ndarray
    numbers: np.ndarray


def explicit(
    linear: Linearisation,
    sides: Sequence[Sides],
    numbers: Sequence[Changing] = (),
    forms: Columns | None = None,
    with_phi: bool = True,
) -> Explicit:
    """Derivatives at the fixed state, by central differences. forms: columns whose forms are wanted; with_phi: whether
    phi is, which else is 0 x 0."""
    state, n = (linear.problem, linear.at), linear.Z.shape[1]
    forms = Columns(np.zeros((n, 0)), linear.Z[:, :0], np.zeros(0)) if forms is None else forms
    q = np.hstack([linear.Z, forms.z]) if with_phi else forms.z
    motions = linear.problem.kinematics.spread(linear.at.x, q)
    columns, around = [], _deformations(*state)
    changes = [number.changes(*state) for number in numbers]
    for side in sides:
        (*behind, at_b), (*ahead, at_a) = (
            _parts(linear, robot, q, motions, around, forms) for robot in (side.behind, side.ahead)
        )
        mine = [(b - a) / side.width for a, b in zip(behind, ahead, strict=True)]
        slopes = np.zeros(len(numbers))
        if at_b is not None:
            both = (side.behind, at_b), (side.ahead, at_a)
            slopes = np.array([change_of(*both) / side.width for change_of in changes])
        columns.append([*mine, slopes])
    return Explicit(*(np.stack(column, axis=-1) for column in zip(*columns, strict=True)))


def row_curvatures(problem: Problem, x: np.ndarray, motions: np.ndarray) -> list[np.ndarray | None]:
    """Curvature M^T hess delta_j M (k, k) of each active row, M the motions (n, 3, k); None where it has none."""
    forms: list[np.ndarray | None] = []
    for row in problem.robot.active:
        forms += [curvature_form(row, x, motions) if row.cliques else None] * len(row.rest)
    return forms


def _deformations(problem: Problem, evaluation: Evaluation) -> np.ndarray:
    """(n, 3, 3): mean of F over the cells of each node; 1 where there are none, or frames move the nodes."""
    D, count = np.zeros((*evaluation.x.shape, 3)), np.zeros(len(evaluation.x))
    if problem.robot.rigid or problem.body.rod is not None:
        return D + np.eye(3)
    for part, points in zip(problem.body.solids, evaluation.response.solids, strict=True):
        mean = points.D.reshape(*part.weights.shape, 3, 3).mean(axis=1)
        np.add.at(D, part.cells, mean[:, None])
        np.add.at(count, part.cells, 1.0)
    return D / np.maximum(count, 1.0)[:, None, None] + np.eye(3)


def _carried(problem: Problem, evaluation: Evaluation, shift: np.ndarray, around: np.ndarray) -> np.ndarray:
    """(n, 3) mm: the state's nodes where their rest moves by `shift` (n, 3)."""
    moved = np.einsum("nij,nj->ni", around, shift)
    moved[problem.robot.fixed] = shift[problem.robot.fixed]
    return evaluation.x + moved


def _parts(
    linear: Linearisation, side: Problem, q: np.ndarray, motions: np.ndarray, around: np.ndarray, columns: Columns
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, Evaluation | None]:
    """Phi, forms, delta, residual and rest of another robot in the state that is carried along; where it has the same
    body, less what that gives."""
    problem, evaluation, lam = linear.problem, linear.at, linear.lam
    k, carried = q.shape[1], None
    if _same_body(problem, side):
        x, rows = evaluation.x, side.robot.active
        H = side.gradients(rows, x)
        delta = np.concatenate([row.value(x) - row.rest for row in rows])
        curved = zip(lam, row_curvatures(side, x, motions), strict=True)
        A = -sum((multiplier * form for multiplier, form in curved if form is not None), np.zeros((k, k)))
        residual = -H @ lam
    else:
        x = (
            evaluation.x
            if side.rest is problem.rest
            else _carried(problem, evaluation, side.rest - problem.rest, around)
        )
        carried = side.evaluate(x, np.empty(0), evaluation.load)
        H, delta, residual = carried.H, carried.delta, carried.residual(lam)
        A = side.form(carried, lam, q) if k else np.zeros((0, 0))
    Bq = np.hstack([side.gradients(side.robot.watched, x), H]).T @ q
    n, c = k - len(columns.m), len(columns.m)
    phi = Bq[:n, :n] + Bq[:n, :n].T - A[:n, :n]
    forms = 2 * (columns.v * Bq[:, n:]).sum(axis=0) - np.diag(A)[n:]
    heavy = np.flatnonzero(columns.m)
    if len(heavy) and not (_same_body(problem, side) and side.robot.density is problem.robot.density):
        mine = motions[:, :, k - c :][:, :, heavy]
        forms[heavy] += columns.m[heavy] * kinetic_form(side.robot.body, side.robot.density, mine)
    delta = np.concatenate([watched_displacements(side.robot, x), delta])
    return phi, forms, delta, residual, side.robot.rest_e, carried


def _same_body(problem: Problem, side: Problem) -> bool:
    mine, other_robot = problem.robot, side.robot
    return (
        other_robot.body is mine.body and other_robot.loads is mine.loads and not mine.rigid and mine.body.rod is None
    )
