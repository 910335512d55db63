"""Searches that put an object down at a place of its table, and let it go.

The robots let go by going back to rest (`cfem.plant.grip_plant.GripPlant.let_go`). Where the object comes to stand
depends on where it was held before: the search holds it above the place, lets go, and moves that hold by what it
missed."""

from dataclasses import replace

import numpy as np

from cfem.control.inverse import Aim, Limits
from cfem.control.loop import Iterate, Reach, Settings, reach
from cfem.core.errors import NumericalError

ROUNDS = 4
NEAR = 1e-3  # mm from the place: nearer is not asked for


def put_down(model, aim: Aim, limits: Limits, at: Iterate, settings: Settings) -> Reach:
    """The best of a few tries, with the actuators at rest in the end; `via`: where the robots hold the object before.
    NumericalError where there is none. model: a `Gripping` with a table."""
    flat = aim.weights.copy()
    flat[model.upwards] = 0.0
    shift, best, opened = np.zeros(len(flat)), None, None
    cost = {"iterations": 0, "queries": 0, "seconds": 0.0}
    for _ in range(ROUNDS):
        above = reach(model, replace(aim, goal=aim.goal + shift, weights=flat), limits, at, settings)
        cost = {key: value + getattr(above, key) for key, value in cost.items()}
        try:
            now, stands = model.let_go(above.delta_a)
        except NumericalError:
            if best is None:
                raise
            break
        distance = aim.distance(now.delta_e)
        if best is not None and distance >= best.distance:
            break
        state = now.delta_a, now.lambda_a, now.delta_e, distance
        rest = above.softened, above.kkt, 0.0, Iterate.at(now), (above.delta_a,)
        best, opened = Reach(*state, above.status, 0, 0, *rest), stands
        if distance <= NEAR:
            break
        shift = shift + np.where(flat > 0, aim.goal - now.delta_e, 0.0)
        at = above.iterate
    model.before = opened
    return replace(best, **cost)
