"""Searches that lift an object off the table on which it stands.

While a table bears the object, actuators hardly move it, and the slopes of that state say nothing of the way into the
air. A search for a goal elsewhere therefore begins in the air: the same robots without a table find it there. Where the
walk from the table leads to with those actuators, the search that knows the table goes on."""

import numpy as np

from cfem.control.search.goal_search import Iterate, Place, SearchResult, SearchSettings, SearchStatus, search_goal
from cfem.control.search.inverse import Aim, Limits
from cfem.core.errors import NumericalError

NEAR = 1e-3  # of the largest course: where an object on its table is this near to its goal, it stays


def lifted(model, aim: Aim, limits: Limits, iterate: Iterate, settings: SearchSettings, place: Place) -> SearchResult:
    """Search for a goal of an object that may stand on its table, from where it may begin. model: a `Gripping` with
    `air`."""
    now = iterate.condensed
    if now.borne > 0:
        if aim.missed(now.delta_e) <= NEAR * float(np.abs(limits.delta_a).max()):
            return SearchResult.stays(aim, limits, iterate, SearchStatus.CONVERGED, kkt=0.0)
        try:
            above = search_goal(model.air, aim, limits, Iterate.at(model.air.at_displacement(model.air.home)), settings)
            iterate = Iterate.at(model.at_displacement(above.delta_a))
        except NumericalError:  # no way from the table to there
            pass
    return search_goal(model, aim, limits, iterate, settings, place)
