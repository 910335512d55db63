"""What a grasp can hold, of robots that hold as a rule says."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.control.holding.grasp import SHARES, least_squeeze, margin_of, share_that_lifts
from cfem.control.holding.gripping import MOST
from cfem.core.errors import SpecError
from cfem.equilibrium.quasi_static import CONVERGED

GRASP = np.array([1.5, 0.0])


class Grip:
    """Holds `bears` times its load, and off the table with a margin of 2 for each grasp."""

    def __init__(self, bears=np.inf, load=5e-3, least=0.0, squeezed=CONVERGED):
        self.bears, self.load_of_object, self.least, self.squeezed = bears, np.array([0, 0, -load]), least, squeezed
        self.load, self.at = 0.0, np.zeros(2)

    def squeeze(self):
        return self.squeezed

    def take(self, load):
        self.load = min(load, self.bears)
        return CONVERGED if load <= self.bears else "slips"

    def towards(self, u):
        self.at = u
        return CONVERGED

    def off_table(self):
        share = self.at[0] / GRASP[0]
        return SimpleNamespace(slip_margin=lambda: 2.0 * share) if share >= self.least else None


@pytest.mark.parametrize(("bears", "margin"), [(np.inf, MOST), (2.5, 2.5), (1.0, 1.0)])
def test_the_margin_of_a_grip_is_how_many_loads_it_bears(bears, margin):
    grip = Grip(bears)
    assert margin_of(grip) == margin and grip.load == 1.0  # the grip itself carries one


def test_without_load_there_is_no_margin():
    assert margin_of(Grip(load=0.0)) is None


def test_what_cannot_be_held_is_refused_with_the_reason():
    with pytest.raises(SpecError, match="the grip cannot hold the object: no equilibrium"):
        margin_of(Grip(squeezed="no equilibrium"))
    with pytest.raises(SpecError, match="slips under 40 % of the load of 5 mN"):
        margin_of(Grip(bears=0.4))


@pytest.mark.parametrize(("margin", "least"), [(0.3, 0.0), (1.0, 0.0), (1.3, 0.0), (0.1, 0.8), (6.0, 0.0)])
def test_the_least_squeeze_that_lifts_is_found_to_an_eighth_of_its_bracket(margin, least):
    """It lifts from a share of max(margin / 2, least) on."""
    grip, exact = Grip(least=least), max(margin / 2, least)
    found = least_squeeze(grip, GRASP, margin)
    high = next(share for share in SHARES if share >= exact)
    low = max((share for share in SHARES if share < high), default=0.0)
    assert exact <= found <= exact + (high - low) / 8
    assert not grip.at.any()  # tried on copies


def test_robots_that_lift_at_no_squeeze_are_told():
    assert least_squeeze(Grip(), GRASP, 6.1) is None
    with pytest.raises(SpecError, match="no preload up to 3 times this one"):
        share_that_lifts(Grip(), GRASP, 6.1)
    with pytest.raises(SpecError, match="nothing squeezes the object"):
        share_that_lifts(Grip(), 0 * GRASP, 1.0)
    assert share_that_lifts(Grip(), GRASP, None) == pytest.approx(0.5)
