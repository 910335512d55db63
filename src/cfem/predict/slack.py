"""A learned robot that touches obstacles and whose cables only pull: one that would have to push goes slack.

`touch_step` holds every actuator, and its lambda_a says where a cable would push. Here such a cable carries nothing, as
in finite elements (`cfem.equilibrium.slack`): lambda_a = 0, and delta_a is beyond its target, where Broyden's method
finds it (*A class of methods for solving nonlinear simultaneous equations*, 1965) from the robot's free stiffness."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from cfem.contact.obstacle import Obstacle
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.problem import Law
from cfem.predict.touchable import Touchable
from cfem.predict.touching import Touched, TouchedStatus, touch_step

NONE = 1e-9  # of the reach: a cable that pushes by what so much of its way changes does not
ITERATIONS = 20


def touch_step_slack(
    touchable: Touchable,
    delta_a: np.ndarray,
    obstacles: Sequence[Obstacle] | ObstacleSet,
    unilateral: np.ndarray,
    law: Law = "coulomb",
    mu: float = 0.0,
    before: Touched | None = None,
) -> Touched:
    """`touch_step` where actuators that are `unilateral` (n_a,) bool go slack. delta_a (n_a,) mm: their targets."""
    target = np.asarray(delta_a, float)
    slack = np.zeros(len(target), dtype=bool) if before is None else unilateral & (before.lambda_a == 0.0)
    at = target if before is None else np.where(slack, np.maximum(before.delta_a, target), target)

    free = touchable.model.at_displacement(target)
    K = np.linalg.inv(free.W[free.rows.a, free.rows.a])
    none = NONE * np.diag(K) * np.abs(touchable.model.reach).max(axis=1)

    def touch(there: np.ndarray) -> Touched:
        return touch_step(touchable, there, obstacles, law, mu, before)

    found = None
    for _ in range(2 * len(target) + 1):
        found = _let_go(touch, K, at, slack, none)
        if not found.converged:
            return found
        pushes = unilateral & ~slack & (found.lambda_a < -none)
        pulled = slack & (found.delta_a < target)
        if not (pushes | pulled).any():
            return found
        slack = (slack | pushes) & ~pulled
        at = np.where(slack, found.delta_a, target)
    return replace(found, status=TouchedStatus.ITERATIONS)


def _let_go(
    touch: Callable[[np.ndarray], Touched], K: np.ndarray, at: np.ndarray, slack: np.ndarray, none: np.ndarray
) -> Touched:
    """The state in which slack actuators (n_a,) bool carry nothing, or less than `none` (n_a,) N, from delta_a `at`
    (n_a,) mm; K (n_a, n_a) N/mm, near the derivative of forces."""
    found, K = touch(at), K[np.ix_(slack, slack)]
    for _ in range(ITERATIONS):
        lam = found.lambda_a[slack]
        if not found.converged or (np.abs(lam) <= none[slack]).all():
            return replace(found, lambda_a=np.where(slack, 0.0, found.lambda_a))
        step, at = -np.linalg.solve(K, lam), at.copy()
        at[slack] += step
        found = touch(at)
        K = K + np.outer(found.lambda_a[slack] - lam - K @ step, step) / (step @ step)
    return replace(found, status=TouchedStatus.ITERATIONS)
