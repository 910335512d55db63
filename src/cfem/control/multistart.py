"""Goals that a search has missed because of friction: where a patch sticks it holds the robot, and on either side of
that another answer may lie. The search is repeated from places around the one that was found."""

from dataclasses import replace
from itertools import product

import numpy as np

from cfem.condensed.model import Model
from cfem.control.inverse import Aim, Limits
from cfem.control.loop import Iterate, Place, Reach, ReachStatus, Settings, reach
from cfem.core.errors import NumericalError

MISSED = 1e-4  # of the largest course: weighted distance from a goal beyond which other places are tried
ASIDE = 0.02  # of each course: how far these are
FEW = 3  # actuators of which all combinations are tried, more of them one at a time


def multistart(model: Model, aim: Aim, limits: Limits, first: Reach, settings: Settings, place: Place) -> Reach:
    """The best of `first` and of searches from around it, which end with the first that does not miss the goal."""
    course = np.minimum(np.ptp(limits.delta_a, axis=1), np.abs(limits.delta_a).max(axis=1))
    best, cost = first, aim.cost(first.delta_e, first.delta_a)
    for direction in _directions(len(course)):
        if aim.missed(best.delta_e) <= MISSED * course.max():
            break
        start = np.clip(first.delta_a + ASIDE * course * direction, *limits.delta_a.T)
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
        if found.status is ReachStatus.QP_FAILED or aim.cost(found.delta_e, found.delta_a) >= cost:
            continue
        spent = {name: getattr(best, name) for name in ("iterations", "queries", "seconds")}
        best, cost = replace(found, **spent), aim.cost(found.delta_e, found.delta_a)
    return best


def _directions(n: int) -> list[np.ndarray]:
    if n > FEW:
        return [*np.eye(n), *-np.eye(n)]
    return [np.array(one, float) for one in product((-1, 0, 1), repeat=n) if any(one)]
