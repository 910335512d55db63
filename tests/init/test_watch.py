"""The watched point: the middle of the free end, in the body or carried by what is near."""

import numpy as np
import pytest
from init.bodies import box_shape, tapered, tube

from cfem.constraint.effector import CarriedEffector, PointEffector, make_effector
from cfem.init.hold import guess_hold, run_from
from cfem.init.watch import carrier_radius, guess_watched, is_inside


@pytest.mark.parametrize(
    "shape, expected", [(box_shape(), [60, 5, 5]), (tapered(), [0, 0, 60]), (tube(), [6, 6, 60])], ids="abc"
)
def test_the_middle_of_the_free_end(shape, expected):
    place, why = guess_watched(shape, run_from(guess_hold(shape)[0], shape))
    np.testing.assert_allclose(place, expected, atol=0.2)
    assert place[expected.index(60)] == 60.0  # on the face itself
    assert ("outside" in why) == (not is_inside(shape.mesh, place))


def test_outside_the_body_enough_of_it_is_near():
    mesh = tube().mesh
    for place in (np.array([6.0, 6, 60]), np.array([6.0, 6, 90])):
        assert not is_inside(mesh, place)
        effector = make_effector(mesh, place, 1.0, carrier_radius(mesh, place), "tip")
        assert isinstance(effector, CarriedEffector)
    assert isinstance(make_effector(mesh, np.array([1.0, 6, 30]), 1.0, 1.0, "wall"), PointEffector)
