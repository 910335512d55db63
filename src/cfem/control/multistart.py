"""Goals that a search has missed are searched for again from other places, since it only goes downhill.

Friction: where a patch sticks it holds the robot, and on either side of that another answer may lie: places around the
one that was found. Elsewhere an arm that curls comes near to a goal twice: places all over the reach."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import product

import numpy as np

from cfem.condensed.model import Model
from cfem.control.inverse import Aim, Limits
from cfem.control.loop import Iterate, Place, Reach, ReachStatus, Settings, reach
from cfem.control.optimality import arrived
from cfem.core.errors import NumericalError

ASIDE = 0.02  # of each course: how far places around are
FEW = 3  # actuators of which all combinations are tried, more of them one at a time
RESTARTS = 8  # places all over the reach
BETTER = 1e-6  # of the cost: less is rounding, for which no robot takes another posture
BEYOND = 1e-9  # of a force's work along a stroke: how far a bound may be exceeded, by rounding


def around(first: Reach, limits: Limits) -> list[np.ndarray]:
    """Displacements (n_a,) aside of those that were found."""
    course = np.minimum(np.ptp(limits.delta_a, axis=1), np.abs(limits.delta_a).max(axis=1))
    return [np.clip(first.delta_a + ASIDE * course * one, *limits.delta_a.T) for one in _directions(len(course))]


def all_over(limits: Limits, count: int) -> np.ndarray:
    """(count, n_a) displacements spread over the course (Halton's sequence), none where it has no end."""
    from scipy.stats import qmc

    low, high = limits.delta_a.T
    if not np.isfinite(limits.delta_a).all():
        return np.zeros((0, len(low)))
    return low + (high - low) * qmc.Halton(len(low), scramble=False).random(count + 1)[1:]


def multistart(
    model: Model,
    aim: Aim,
    limits: Limits,
    first: Reach,
    settings: Settings,
    place: Place,
    starts: Iterable[np.ndarray],
) -> Reach:
    """The best of `first` and of searches from `starts` (n_a,), which end with the first that does not miss the
    goal."""
    best, cost = first, aim.cost(first.delta_e, first.delta_a)
    beyond = max(_beyond(first, limits, settings), BEYOND * float(np.abs(settings.scale * first.lambda_a).sum()))
    for start in starts:
        if arrived(best.iterate.condensed, aim, limits):
            break
        try:
            found = reach(model, aim, limits, Iterate.at(model.at_displacement(start)), settings, place)
        except NumericalError:
            continue
        best = replace(
            best,
            iterations=best.iterations + found.iterations,
            queries=best.queries + found.queries + 1,
            seconds=best.seconds + found.seconds,
        )
        if found.status is ReachStatus.QP_FAILED or aim.cost(found.delta_e, found.delta_a) >= (1 - BETTER) * cost:
            continue
        if _beyond(found, limits, settings) > beyond:
            continue
        spent = {name: getattr(best, name) for name in ("iterations", "queries", "seconds")}
        best, cost = replace(found, **spent), aim.cost(found.delta_e, found.delta_a)
    return best


def _beyond(found: Reach, limits: Limits, settings: Settings) -> float:
    return limits.outside(found.delta_e, found.lambda_a, settings.scale)


def _directions(n: int) -> list[np.ndarray]:
    if n > FEW:
        return [*np.eye(n), *-np.eye(n)]
    return [np.array(one, float) for one in product((-1, 0, 1), repeat=n) if any(one)]
