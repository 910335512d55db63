"""Searches of robots that lift an object off the table on which it stands, and that put it down and let it go.

While a table bears the object, actuators hardly move it, and the slopes of that state say nothing of the way into the
air. A search for a goal elsewhere therefore begins in the air: the same robots without a table find it there. Where the
walk from the table leads to with those actuators, the search that knows the table goes on.

The robots let go by going back to rest (`cfem.plant.grip_walk.GripWalk.let_go`), first along the way on which the
object goes straight down as long as they hold it (`opening`). Where the object comes to stand depends on where it was
held before: the search holds it above the place, lets go, and moves that hold by what it missed, always at the height
of the first. Broyden's method (Math. Comp. 19, 1965) learns from the misses how the place
follows the hold, since the object tilts in the air and slides as it goes down."""

from dataclasses import replace

import numpy as np

from cfem.control.search.goal_search import Iterate, Place, SearchResult, SearchSettings, SearchStatus, search_goal
from cfem.control.search.inverse import Aim, Limits
from cfem.core.errors import NumericalError

STAYS = 1e-3  # of the largest course: where an object on its table is this near to its goal, it stays
ROUNDS = 8  # holds that are tried
NEAR = 1e-3  # mm from the place: nearer is not asked for
ALIKE = 0.1  # of its weight, that the height of a hold is that of the first: it may rise where the margin wants it


def lifted(model, aim: Aim, limits: Limits, iterate: Iterate, settings: SearchSettings, place: Place) -> SearchResult:
    """Search for a goal of an object that may stand on its table, from where it may begin. model: a `Gripping` with
    `air`."""
    now = iterate.condensed
    if now.borne > 0:
        if aim.missed(now.delta_e) <= STAYS * float(np.abs(limits.delta_a).max()):
            return SearchResult.stays(aim, limits, iterate, SearchStatus.CONVERGED, kkt=0.0)
        try:
            above = search_goal(model.air, aim, limits, Iterate.at(model.air.at_displacement(model.air.home)), settings)
            iterate = Iterate.at(model.at_displacement(above.delta_a))
        except NumericalError:
            pass  # it cannot be carried there through the air: the search begins on the table
    return search_goal(model, aim, limits, iterate, settings, place)


def put_down(model, aim: Aim, limits: Limits, iterate: Iterate, settings: SearchSettings) -> SearchResult:
    """Search for the place to put an object down, the best of a few tries, with the actuators at rest in the end;
    `via`: where the robots hold the object before. NumericalError where there is none. model: a `Gripping` with a
    table."""
    n_o, up = model.of_object.n_e, model.upwards
    weights, goal = aim.weights.copy(), aim.goal.copy()
    free = np.zeros(n_o, dtype=bool)
    free[up] = True
    free[3:] = np.arange(3)[: n_o - 3] != up  # the table sets how the object is tilted
    weights[:n_o][free] = 0.0
    steered = np.flatnonzero(weights[:n_o] > 0)
    slope, before = np.eye(len(steered)), None
    best, opened, least, slopes = None, None, np.inf, None
    cost = {"iterations": 0, "queries": 0, "seconds": 0.0}
    for _ in range(ROUNDS):
        model.begin_search()
        above = search_goal(model, replace(aim, goal=goal, weights=weights), limits, iterate, settings)
        cost = {key: value + getattr(above, key) for key, value in cost.items()}
        try:
            slopes = above.iterate.condensed.effector_jacobian if slopes is None else slopes
            lower = opening(slopes, steered, above.delta_a, limits.delta_a, settings.scale)
            now, stands = model.let_go(above.delta_a, lower)
        except NumericalError:
            if best is None:
                raise
            goal[steered] = (before[0] + goal[steered]) / 2  # half the way back to the last hold that it let go
            continue
        missed = aim.missed(now.delta_e)
        if missed < least:
            least, state = missed, (now.delta_a, now.lambda_a, now.delta_e, aim.distance(now.delta_e))
            rest = above.softened, above.kkt, 0.0, Iterate.at(now), aim, limits, (above.delta_a, lower)
            ended = above.status if missed <= NEAR else SearchStatus.TRIED  # the slopes of that state tell nothing
            best, opened = SearchResult(*state, ended, 0, 0, *rest), stands
        if missed <= NEAR:
            break
        held, stood = above.delta_e[steered], now.delta_e[steered]
        if before is not None:
            moved = held - before[0]
            slope += np.outer(stood - before[1] - slope @ moved, moved) / max(float(moved @ moved), 1e-300)
        before = held, stood
        goal[steered] = held + np.linalg.solve(slope, aim.goal[steered] - stood)
        if not weights[up]:
            weights[up], goal[up] = ALIKE * aim.weights[up], above.delta_e[up]
        iterate = above.iterate
    model.before = opened
    return replace(best, **cost)


def opening(
    slopes: np.ndarray, steered: np.ndarray, begin: np.ndarray, course: np.ndarray, scale: np.ndarray | float = 1.0
) -> np.ndarray:
    """Displacements (n_a,) mm in which a way of the actuators towards rest ends that leaves the rows `steered` of the
    object as they are, by the slopes (n_e, n_a) of its rows: where the first actuator is back at rest. begin (n_a,) mm,
    course (n_a, 2) mm and scale (n_a,), full strokes, of the actuators."""
    start, J = begin / scale, slopes[steered] * scale
    goes = start - np.linalg.pinv(J) @ (J @ start)
    shares = [s / g for s, g in zip(start, goes, strict=True) if s * g > 0]
    return np.clip((start - min([1.0, *shares]) * goes) * scale, *course.T)
