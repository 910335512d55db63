"""Capacity of a grasp, before anything is carried out."""

from copy import copy
from dataclasses import replace

import numpy as np

from cfem.condensed import Rows
from cfem.control.holding.gripping import MOST, Gripping
from cfem.core.errors import SpecError
from cfem.equilibrium.quasi_static import CONVERGED
from cfem.plant.grip_plant import GripPlant

SHARES = (0.25, 0.5, 1.0, 2.0, 3.0)  # of a squeeze that are tried
HALVINGS = 3  # between the last that fails and the first that holds


def margin_of(grip: GripPlant) -> float | None:
    """Margin of the learned grip that takes the object: how many times its load it would hold, at most MOST; None
    without load. SpecError where it cannot hold the object: the reason, before anything is carried out."""
    load = float(np.linalg.norm(grip.load_of_object))
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
    """Least share of `grasp` (n_a,) mm at which robots carry the object's load in the air, with `margin` to slip; None
    up to the largest of SHARES. grip: at rest, the object on its table."""

    def holds(share: float) -> bool:
        air = squeezed_off_table(grip, share * grasp)
        return air is not None and air.slip_margin() >= margin

    high = next((share for share in SHARES if holds(share)), None)
    if high is None:
        return None
    low = max((share for share in SHARES if share < high), default=0.0)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def squeezed_off_table(grip: GripPlant, grasp: np.ndarray) -> GripPlant | None:
    """Robots that have squeezed the object on its table by `grasp` (n_a,) mm, and carry it without the table; None
    where they cannot. grip: at rest."""
    stands = copy(grip)
    return stands.off_table() if stands.towards(grasp) == CONVERGED else None


def share_that_lifts(grip: GripPlant, grasp: np.ndarray, margin: float | None) -> float:
    """Least share of `grasp` at which robots lift the object (`least_squeeze`). SpecError where there is none."""
    if not grasp.any():
        raise SpecError("nothing squeezes the object on its table", where="search.preload", do="give one, as 1.5 mm")
    share = least_squeeze(grip, grasp, margin or 1.0)
    if share is None:
        what = f"the robots cannot lift the object: no preload up to {SHARES[-1]:.0f} times this one carries its load"
        do = "raise object.friction, or take a lighter object"
        raise SpecError(what, where="search.preload", do=do)
    return share


def from_table(
    stands: GripPlant,
    of_object: Rows,
    names: tuple[str, ...],
    mu: float,
    margin: float | None,
    grasp: np.ndarray,
    preload: float,
) -> Gripping:
    """Plans of robots that find the object on a table. stands: these robots at rest; grasp: (n_a,) mm, how they squeeze
    it there, `preload` mm each; the other arguments: see `Gripping`."""
    share, wrong = share_that_lifts(stands, grasp, margin), "the robots cannot squeeze the object on its table"
    home = max(share, 1.0) * grasp
    air = squeezed_off_table(stands, home)
    status = stands.squeeze() if air is not None else "they do not hold it"
    if status != CONVERGED:
        raise SpecError(f"{wrong}: {status}", where="search.preload")
    above = Gripping(air, of_object, names, mu, margin, home, margin_of(air))
    return replace(above, grip=stands, home=grasp, air=above, needs=share * preload)
