"""Goals that a search has missed are searched for again from other places, since it only goes downhill.

Friction: where a patch sticks it holds the robot, and on either side of that another answer may lie: places around the
one that was found. Elsewhere an arm that curls comes near to a goal twice: places all over the reach. An answer beside
what a learned model knows is no answer: another is sought, and taken where it reaches the goal."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from cfem.condensed.model import KnowsDomain, KnowsStates, Model
from cfem.control.search.goal_search import Iterate, Place, SearchResult, SearchSettings, SearchStatus, search_goal
from cfem.control.search.inverse import Aim, Limits
from cfem.control.search.optimality import arrived
from cfem.core.errors import NumericalError

ASIDE = 0.02  # of each course: how far places around are
FEW = 3  # actuators of which all combinations are tried, more of them one at a time
RESTARTS = 8  # places all over the reach
BETTER = 1e-6  # of the cost: less is rounding, for which no robot takes another posture
BEYOND = 1e-9  # of a force's work along a stroke: how far a bound may be exceeded, by rounding


def around(first: SearchResult, limits: Limits) -> list[np.ndarray]:
    """Displacements (n_a,) beside those of a search."""
    course = np.minimum(np.ptp(limits.delta_a, axis=1), np.abs(limits.delta_a).max(axis=1))
    aside = [ASIDE * course * direction for direction in _directions(len(course))]
    return [np.clip(first.delta_a + step, *limits.delta_a.T) for step in aside]


def all_over(model: Model, limits: Limits, count: int) -> Iterator[np.ndarray]:
    """Starts: `count` displacements (n_a,) spread over what the model was trained on, or else over the course (Halton's
    sequence); none where that has no end. Nothing is computed before the first is asked for."""
    if isinstance(model, KnowsStates):
        yield from np.clip(model.trained[:count], *limits.delta_a.T)
    elif np.isfinite(limits.delta_a).all():
        from scipy.stats import qmc

        low, high = limits.delta_a.T
        yield from low + (high - low) * qmc.Halton(len(low), scramble=False).random(count + 1)[1:]


def multistart(
    model: Model,
    aim: Aim,
    limits: Limits,
    first: SearchResult,
    settings: SearchSettings,
    place: Place,
    starts: Iterable[np.ndarray],
) -> SearchResult:
    """Best of `first` and of searches from `starts` (n_a,), which end with the first that does not miss the goal, at a
    state that the model knows."""
    known = _known(model, first)
    if known and arrived(first.iterate.condensed, aim, limits):
        return first
    best, cost = first, aim.cost(first.delta_e, first.delta_a)
    beyond = max(_beyond(first, limits, settings), BEYOND * float(np.abs(settings.scale * first.lambda_a).sum()))
    for start in starts:
        try:
            result = search_goal(model, aim, limits, Iterate.at(model.at_displacement(start)), settings, place)
        except NumericalError:
            continue
        best = replace(
            best,
            iterations=best.iterations + result.iterations,
            queries=best.queries + result.queries + 1,
            seconds=best.seconds + result.seconds,
        )
        if result.status is SearchStatus.QP_FAILED or not _known(model, result):
            continue
        reaches = arrived(result.iterate.condensed, aim, limits)
        nearer = aim.cost(result.delta_e, result.delta_a) < (1 - BETTER) * cost
        if not (nearer or (reaches and not known)) or _beyond(result, limits, settings) > beyond:
            continue
        spent = {name: getattr(best, name) for name in ("iterations", "queries", "seconds")}
        best, cost, known = replace(result, **spent), aim.cost(result.delta_e, result.delta_a), True
        if reaches:
            break
    return best


def _known(model: Model, result: SearchResult) -> bool:
    """True where the search ended at a state like those that the model was trained on, or it cannot tell."""
    return not isinstance(model, KnowsDomain) or bool(model.inside(result.iterate.condensed))


def _beyond(result: SearchResult, limits: Limits, settings: SearchSettings) -> float:
    return limits.outside(result.delta_e, result.lambda_a, settings.scale)


def _directions(n: int) -> list[np.ndarray]:
    """Directions (n,) of steps aside: all combinations of few actuators, else one actuator at a time."""
    if n > FEW:
        return [*np.eye(n), *-np.eye(n)]
    return [np.array(signs, float) for signs in product((-1, 0, 1), repeat=n) if any(signs)]
