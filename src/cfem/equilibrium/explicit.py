"""What the parameters of a robot change while its state stays where it is: differences of robots on either side.

The state is the displacement of the nodes from rest, the multipliers, and Z = A^-1 B, B = H^T of all rows, with which

    Phi = B^T Z + Z^T B - Z^T A Z

is W and stationary in Z. Where a robot on either side has the very body of the one at hand, nothing of the body is
computed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cfem.equilibrium.parameter_slopes import Sides
from cfem.equilibrium.problem import Evaluation, Problem
from cfem.equilibrium.robot import watched_displacements
from cfem.equilibrium.solution import Linear

Number = Callable[[Problem, Evaluation], float]


@dataclass(frozen=True)
class Explicit:
    """By each of n_q parameters: phi (n, n, n_q), delta (n, n_q) of all rows, residual (n_dof, n_q), rest_e (n_e, n_q)
    where the effectors rest, numbers (k, n_q) of the whole body."""

    phi: np.ndarray
    delta: np.ndarray
    residual: np.ndarray
    rest_e: np.ndarray
    numbers: np.ndarray


def explicit(linear: Linear, sides: Sequence[Sides], numbers: Sequence[Number] = ()) -> Explicit:
    """By central differences."""
    motions = linear.problem.kinematics.spread(linear.at.x, linear.Z)
    columns = []
    for side in sides:
        behind, ahead = (_parts(linear, one, motions, numbers) for one in (side.behind, side.ahead))
        columns.append([(b - a) / side.width for a, b in zip(behind, ahead, strict=True)])
    return Explicit(*(np.stack(column, axis=-1) for column in zip(*columns, strict=True)))


def row_curvatures(problem: Problem, x: np.ndarray, motions: np.ndarray) -> list[np.ndarray | None]:
    """Of each active row M^T hess delta_j M (k, k), M the motions (n, 3, k); None where it has no curvature."""
    forms: list[np.ndarray | None] = []
    for row in problem.robot.active:
        form = None
        if row.cliques:
            form = np.zeros((motions.shape[2], motions.shape[2]))
            for clique, blocks in zip(row.cliques, row.curvature(x), strict=True):
                mine = motions[clique].reshape(len(clique), -1, motions.shape[2])
                form += np.einsum("gik,gil->kl", mine, blocks @ mine)
        forms += [form] * len(row.rest)
    return forms


def _parts(linear: Linear, side: Problem, motions: np.ndarray, numbers: Sequence[Number]) -> tuple[np.ndarray, ...]:
    """Of another robot whose nodes are as far from their rest as in the state at hand; where it has the same body, less
    what that gives."""
    problem, at, lam, Z = linear.problem, linear.at, linear.lam, linear.Z
    if _same_body(problem, side):
        x, rows = at.x, side.robot.active
        H = side.gradients(rows, x)
        delta = np.concatenate([row.value(x) - row.rest for row in rows])
        curved = zip(lam, row_curvatures(side, x, motions), strict=True)
        A = -sum((one * form for one, form in curved if form is not None), np.zeros((Z.shape[1], Z.shape[1])))
        residual, found = -H @ lam, np.zeros(len(numbers))
    else:
        x = at.x if side.rest is problem.rest else at.x + (side.rest - problem.rest)
        there = side.evaluate(x, np.empty(0), at.load)
        H, delta, residual = there.H, there.delta, there.residual(lam)
        A = side.form(there, lam, Z)
        found = np.array([one(side, there) for one in numbers])
    BZ = np.hstack([side.gradients(side.robot.watched, x), H]).T @ Z
    delta = np.concatenate([watched_displacements(side.robot, x), delta])
    return BZ + BZ.T - A, delta, residual, side.robot.rest_e, found


def _same_body(problem: Problem, side: Problem) -> bool:
    mine, other = problem.robot, side.robot
    return other.body is mine.body and other.loads is mine.loads and not mine.rigid and mine.body.beam is None
