"""How patches of a body's surface yield to forces: rows of contact, and what the modes of a skin, or the pose of a
rigid patch, leave of them."""

from dataclasses import dataclass, replace

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.patches import Patches, SurfacePoints
from cfem.condensed.pose import Patch
from cfem.condensed.skin import Skin
from cfem.constraint.attachment import Attachment
from cfem.constraint.contact import ContactPoint
from cfem.core.console.progress import progress
from cfem.core.errors import NumericalError
from cfem.equilibrium.contact.held_patch import held
from cfem.equilibrium.derivatives.third_order import load_derivatives, skin_load_derivatives
from cfem.equilibrium.skinned import skinned
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import Equilibrium, Linearisation, State


def with_patches(robot: Robot, nodes: np.ndarray, patches: Patches | SurfacePoints, numbers: np.ndarray) -> Robot:
    """The robot with the patches, or other points, `numbers` for contact points; nodes (m,): of the surface in the
    mesh."""
    points, weights = [], patches.weights
    for number in numbers:
        mine = slice(*weights.indptr[number : number + 2])
        used = nodes[weights.indices[mine]]
        order = np.argsort(used)
        points.append(ContactPoint(Attachment(used[order], weights.data[mine][order], patches.rest[number])))
    names = tuple(f"patch-{number}.{axis}" for number in numbers for axis in "xyz")
    return replace(robot, contacts=tuple(points), rows=replace(robot.rows, contacts=names))


@dataclass(frozen=True)
class PatchResponse:
    """Response of patches of the surface to forces on them, actuators held.

    states: (J, n_a) mm
    own: (J, 3 N, 3 N) mm/N compliance of the patches
    tip: (J, n_e, 3 N) mm/N, motion of the effectors by the forces
    bent: (J, k, n_e + k, n_e + k) mm/N^2, change of the compliance of effectors and rows of the skin with loads on the
    latter
    dented: (J, N, 3, 3, 3 + n_e) mm/N^2, change of the compliance of each patch, and between it and the effectors, with
    a force on it"""

    states: np.ndarray
    own: np.ndarray
    tip: np.ndarray
    bent: np.ndarray
    dented: np.ndarray


def patch_response(robot: Robot, skin: Skin, patches: Patches, states: np.ndarray) -> PatchResponse:
    """Response of the patches at states (J, n_a) mm: one equilibrium and one block of right-hand sides each, no further
    factorisation for what is bent. NumericalError where there is no equilibrium."""
    touched = with_patches(robot, skin.nodes, patches, np.arange(len(patches)))
    shown, problem, rows = Problem(skinned(robot, skin)), Problem(touched), touched.rows
    compliance, tip = np.empty((len(states), rows.n_c, rows.n_c)), np.empty((len(states), rows.n_e, rows.n_c))
    start, bent, dented = None, [], []
    with progress(f"pushing {len(patches)} patches of the surface by FE, in bent states", len(states)) as advance:
        for j, delta in enumerate(states):
            moved = solved_at(shown, delta, base=start)
            start = moved.state
            bent.append(skin_load_derivatives(moved.linear))
            lam = np.concatenate([start.lam, np.zeros(rows.n_c)])
            pushed = solved_at(problem, delta, start=replace(start, lam=lam)).linear
            dented.append(_dented(pushed))
            W = pushed.W
            across = W[rows.c, rows.a]
            G = np.linalg.solve(W[rows.a, rows.a], across.T).T
            compliance[j] = W[rows.c, rows.c] - G @ across.T
            tip[j] = W[rows.e, rows.c] - W[rows.e, rows.a] @ G.T
            advance(1)
    return PatchResponse(states, compliance, tip, np.stack(bent), np.stack(dented))


def _dented(linear: Linearisation) -> np.ndarray:
    """Change (N, 3, 3, 3 + n_e) mm/N^2 of the compliance of each contact point, with itself and with the effectors, by
    a force on it, actuators held."""
    robot, rows, changes = linear.problem.robot, linear.problem.robot.rows, []
    for number, point in enumerate(robot.contacts):
        mine = rows.c.start + 3 * number + np.arange(3)
        seen = Rows(("x", "y", "z", *rows.effectors), rows.actuators)
        watched = replace(robot, effectors=(point, *robot.effectors), contacts=(), rows=seen)
        kept = np.concatenate([mine, np.arange(rows.n)[rows.e], np.arange(rows.n)[rows.a]])
        alone, W = Problem(watched, like=linear.problem), linear.W[np.ix_(kept, kept)]
        changes.append(load_derivatives(alone, linear.at, linear.lam[: rows.n_a], linear.Z[:, kept], W, loaded=3))
    return np.stack(changes)


def solved_at(
    problem: Problem, delta: np.ndarray, start: State | None = None, base: State | None = None
) -> Equilibrium:
    """Equilibrium at delta (n_a,) mm, with its linearisation, from `start` or else from `base`.
    NumericalError where there is none."""
    equilibrium = solve(problem, displacement(delta), start, base, slack=False, wanted=Wanted(keep=True))
    if not equilibrium.converged:
        raise NumericalError(f"patches of the surface: {equilibrium.status.value}")
    return equilibrium


def within_patch(robot: Robot, patch: Patch) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compliance of the contact points, at rest, to forces that are in balance within their patch: shapes (3 k, n) of
    displacement, n = 3 k - 6, the compliance (n, n) mm/N by their sizes, and those sizes by the actuators (n, n_a).

    W of the points is J C J^T + N D N^T, C of the rigid patch: with Q the forces in balance, J^T Q = 0, N is W Q and D
    the inverse of Q^T W Q; N is scaled to unit length here."""
    rest = solve(Problem(robot), held(displacement(np.zeros(robot.rows.n_a)), np.zeros(robot.rows.n_c)), slack=False)
    if not rest.converged:
        raise NumericalError(f"contact points at rest: {rest.status.value}")
    rows, compliance = rest.condensed.rows, rest.condensed.W
    moved = np.linalg.solve(compliance[rows.a, rows.a], compliance[rows.a, rows.c]).T
    W = compliance[rows.c, rows.c] - moved @ compliance[rows.a, rows.c]
    J = patch.jacobian(np.zeros(6))
    Q = np.linalg.svd(J.T)[2][6:].T
    N = W @ Q
    size = np.linalg.norm(N, axis=0)
    D = np.linalg.inv(Q.T @ N)
    N = N / size
    follows = np.linalg.solve(np.hstack([J, N]), moved)[6:]
    return N, size[:, None] * (D + D.T) / 2 * size, follows
