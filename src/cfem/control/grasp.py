"""What a grasp can hold, before anything is carried out."""

from copy import copy
from dataclasses import replace

import numpy as np

from cfem.control.gripping import MOST, Gripping
from cfem.core.errors import SpecError
from cfem.equilibrium.quasi_static import CONVERGED
from cfem.plant.grip_plant import GripPlant

SHARES = (0.25, 0.5, 1.0, 2.0, 3.0)  # of a squeeze that are tried
HALVINGS = 3  # between the last that fails and the first that holds


def taken(grip: GripPlant, load: float) -> float | None:
    """The learned grip takes the object, of weight `load` N; how many times that it would hold, at most MOST, None
    without load. SpecError
    where it cannot hold the object: the reason, before anything is carried out."""
    status, cannot = grip.squeeze(), "the grip cannot hold the object"
    do = "squeeze harder (search.preload), raise object.friction, or take a lighter object"
    if status != CONVERGED:
        raise SpecError(f"{cannot}: {status}", where="search.preload", do=do)
    if grip.take(1.0) != CONVERGED:
        share = f"{100 * grip.load:.0f} % of the load of {1e3 * load:.3g} mN"
        raise SpecError(f"{cannot}: it slips under {share}", where="object.force", do=do)
    if not load:
        return None
    more = copy(grip)
    return MOST if more.take(MOST) == CONVERGED else more.load


def least_squeeze(grip: GripPlant, grasp: np.ndarray, margin: float) -> float | None:
    """The least share of `grasp` (n_a,) mm at which robots carry the object's load in the air, with `margin` to slip;
    None up to the largest of SHARES. grip: at rest, without load or table."""

    def holds(share: float) -> bool:
        stands = copy(grip)
        return stands.towards(share * grasp) == CONVERGED and stands.bears() and stands.slip_margin() >= margin

    high = next((share for share in SHARES if holds(share)), None)
    if high is None:
        return None
    low = max((share for share in SHARES if share < high), default=0.0)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def share_that_lifts(grip: GripPlant, grasp: np.ndarray, margin: float | None) -> float:
    """The least share of `grasp` at which robots lift the object (`least_squeeze`). SpecError where there is none."""
    if not grasp.any():
        raise SpecError("nothing squeezes the object on its table", where="search.preload", do="give one, as 1.5 mm")
    share = least_squeeze(grip, grasp, margin or 1.0)
    if share is None:
        what = f"the robots cannot lift the object: no preload up to {SHARES[-1]:.0f} times this one carries its load"
        do = "raise object.friction, or take a lighter object"
        raise SpecError(what, where="search.preload", do=do)
    return share


def from_table(air: Gripping, stands: GripPlant, grasp: np.ndarray, needs: float) -> Gripping:
    """Plans of robots that find the object on a table. stands: these robots with the table; needs: mm, the least
    preload that lifts."""
    status = stands.squeeze()
    if status != CONVERGED:
        raise SpecError(f"the robots cannot squeeze the object on its table: {status}", where="search.preload")
    return replace(air, grip=stands, home=grasp, air=air, needs=needs)
