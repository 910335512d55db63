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
    """State in which those of the actuators that are `unilateral` (n_a,) bool pull or are slack, and which are, (n_a,)
    bool; False where none was found. step: to a state whose actuators, robot after robot, are held at (n_a,) mm and
    pull with `pull` (n_a,) N; target (n_a,) mm: of theirs; before: delta_a and lambda_a of the last state, 0 N of a
    cable that is slack."""
    slack, delta = np.zeros(len(target), dtype=bool), target
    if before is not None and not before[1].all():
        slack = unilateral & (before[1] == 0.0)
        delta = np.where(slack, np.maximum(before[0], target), target)
    state = step(delta)
    if not state.converged or not (slack.any() or (unilateral & (state.pull < 0)).any()):
        return state, slack, True

    cuts = np.cumsum([model.rows.n_a for model in models])[:-1]
    free = [model.at_displacement(mine) for model, mine in zip(models, np.split(target, cuts), strict=True)]
    K = block_diag(*(np.linalg.inv(condensed.W[condensed.rows.a, condensed.rows.a]) for condensed in free))
    none = NONE * np.diag(K) * np.concatenate([np.abs(model.reach).max(axis=1) for model in models])
    for _ in range(2 * len(target) + 1):
        state, delta, settled = _let_go(step, K, state, delta, slack, none)
        if not settled or not state.converged:
            return state, slack, settled
        pushes = unilateral & ~slack & (state.pull < -none)
        taken_up = slack & (delta < target)
        if not (pushes | taken_up).any():
            return state, slack, True
        slack = (slack | pushes) & ~taken_up
        if taken_up.any():
            delta = np.where(slack, delta, target)
            state = step(delta)
    return state, slack, False


def _let_go(
    step: Callable[[np.ndarray], Any], K: np.ndarray, state: Any, delta: np.ndarray, slack: np.ndarray, none: np.ndarray
) -> tuple[Any, np.ndarray, bool]:
    """The state in which slack actuators (n_a,) bool carry less than `none` (n_a,) N, where it is, and whether it is
    one, from `found` at delta_a `at` (n_a,) mm; K (n_a, n_a) N/mm, near the derivative of forces."""
    B, lam = np.linalg.inv(K[np.ix_(slack, slack)]), state.pull[slack]
    for _ in range(ITERATIONS):
        if not state.converged or (np.abs(lam) <= none[slack]).all():
            return state, delta, True
        change, delta = -B @ lam, delta.copy()
        delta[slack] += change
        state, last = step(delta), lam
        lam = state.pull[slack]
        across, size = B @ (lam - last), change @ B @ (lam - last)
        if size == 0.0:
            break
        B = B + np.outer(change - across, change @ B) / size
    return state, delta, False
