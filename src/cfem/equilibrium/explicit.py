"""What the parameters of a robot change while its state stays where it is: differences of robots on either side.

The state is carried along: where a node's place at rest moves by dX, the node moves by F dX, F the deformation around
it, so that the change hardly strains the body. (At the same displacements it would strain it by far more than the
design does, and the small difference be lost to truncation.) What is held stays at its place at rest. Any such way
serves: what the state does beside is what equilibrium answers. The multipliers stay, and Z = A^-1 B, B = H^T of all
rows, with which

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
    columns, around = [], _deformations(linear.problem, linear.at)
    for side in sides:
        behind, ahead = (_parts(linear, one, motions, around, numbers) for one in (side.behind, side.ahead))
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


def _deformations(problem: Problem, at: Evaluation) -> np.ndarray:
    """(n, 3, 3): mean of F over the cells of each node; 1 where there are none, or frames move the nodes."""
    D, count = np.zeros((*at.x.shape, 3)), np.zeros(len(at.x))
    if problem.robot.rigid or problem.body.beam is not None:
        return D + np.eye(3)
    for part, there in zip(problem.body.solids, at.response.solids, strict=True):
        mean = there.D.reshape(*part.weights.shape, 3, 3).mean(axis=1)
        np.add.at(D, part.cells, mean[:, None])
        np.add.at(count, part.cells, 1.0)
    return D / np.maximum(count, 1.0)[:, None, None] + np.eye(3)


def _carried(problem: Problem, at: Evaluation, shift: np.ndarray, around: np.ndarray) -> np.ndarray:
    """(n, 3) mm: the state's nodes where their rest moves by `shift` (n, 3)."""
    moved = np.einsum("nij,nj->ni", around, shift)
    moved[problem.robot.fixed] = shift[problem.robot.fixed]
    return at.x + moved


def _parts(
    linear: Linear, side: Problem, motions: np.ndarray, around: np.ndarray, numbers: Sequence[Number]
) -> tuple[np.ndarray, ...]:
    """Of another robot in the state that is carried along; where it has the same body, less what that gives."""
    problem, at, lam, Z = linear.problem, linear.at, linear.lam, linear.Z
    if _same_body(problem, side):
        x, rows = at.x, side.robot.active
        H = side.gradients(rows, x)
        delta = np.concatenate([row.value(x) - row.rest for row in rows])
        curved = zip(lam, row_curvatures(side, x, motions), strict=True)
        A = -sum((one * form for one, form in curved if form is not None), np.zeros((Z.shape[1], Z.shape[1])))
        residual, found = -H @ lam, np.zeros(len(numbers))
    else:
        x = at.x if side.rest is problem.rest else _carried(problem, at, side.rest - problem.rest, around)
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
