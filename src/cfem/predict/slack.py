"""Learned robots whose cables only pull: one that would have to push goes slack.

A contact step holds every actuator, and its lambda_a says where a cable would push. Here such a cable carries nothing,
as in finite elements (`cfem.equilibrium.complementarity`): lambda_a = 0, and delta_a is beyond its target, where
Broyden's method finds it (*A class of methods for solving nonlinear simultaneous equations*, 1965) from the stiffness
of the free robots."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from cfem.predict.protocol import Predictor

NONE = 1e-9  # of the reach: a cable that pushes by what so much of its way changes does not
ITERATIONS = 20


def with_slack(
    step: Callable[[np.ndarray], Any],
    models: Sequence[Predictor],
    unilateral: np.ndarray,
    target: np.ndarray,
    before: tuple[np.ndarray, np.ndarray] | None,
) -> tuple[Any, np.ndarray, bool]:
    """The state in which those of the actuators that are `unilateral` (n_a,) bool pull or are slack, and which are,
    (n_a,) bool; False where none was found. step: to a state whose actuators, robot after robot, are held at (n_a,) mm
    and pull with `pull` (n_a,) N; target (n_a,) mm: of theirs; before: delta_a and lambda_a of the last state, 0 N of a
    cable that is slack."""
    slack, at = np.zeros(len(target), dtype=bool), target
    if before is not None:
        slack = unilateral & (before[1] == 0.0)
        at = np.where(slack, np.maximum(before[0], target), target)
    found = step(at)
    if not found.converged or not (slack | unilateral & (found.pull < 0)).any():
        return found, slack, True

    cuts = np.cumsum([one.rows.n_a for one in models])[:-1]
    free = [one.at_displacement(mine) for one, mine in zip(models, np.split(target, cuts), strict=True)]
    K = block_diag(*(np.linalg.inv(one.W[one.rows.a, one.rows.a]) for one in free))
    none = NONE * np.diag(K) * np.concatenate([np.abs(one.reach).max(axis=1) for one in models])
    for _ in range(2 * len(target) + 1):
        found, at, settled = _let_go(step, K, found, at, slack, none)
        if not settled or not found.converged:
            return found, slack, settled
        pushes = unilateral & ~slack & (found.pull < -none)
        taken_up = slack & (at < target)
        if not (pushes | taken_up).any():
            return found, slack, True
        slack = (slack | pushes) & ~taken_up
        if taken_up.any():
            at = np.where(slack, at, target)
            found = step(at)
    return found, slack, False


def _let_go(
    step: Callable[[np.ndarray], Any], K: np.ndarray, found: Any, at: np.ndarray, slack: np.ndarray, none: np.ndarray
) -> tuple[Any, np.ndarray, bool]:
    """The state in which slack actuators (n_a,) bool carry less than `none` (n_a,) N, where it is, and whether it is
    one, from `found` at delta_a `at` (n_a,) mm; K (n_a, n_a) N/mm, near the derivative of forces."""
    B, lam = np.linalg.inv(K[np.ix_(slack, slack)]), found.pull[slack]
    for _ in range(ITERATIONS):
        if not found.converged or (np.abs(lam) <= none[slack]).all():
            return found, at, True
        way, at = -B @ lam, at.copy()
        at[slack] += way
        found, last = step(at), lam
        lam = found.pull[slack]
        across, size = B @ (lam - last), way @ B @ (lam - last)
        if size == 0.0:
            break
        B = B + np.outer(way - across, way @ B) / size
    return found, at, False
