"""Cables are led through the channels that a body has."""

import numpy as np
import pytest
from init.bodies import box_shape, chambered, holed, tube

from cfem.init.cables.channels import cables_in_channels
from cfem.init.hold import read_hold, run_from


def found(shape, held="left"):
    return cables_in_channels(shape, run_from(read_hold(held, shape), shape))


def test_a_cable_runs_through_a_channel():
    inside = found(holed())
    (cable,) = inside.cables
    assert not inside.through_air and inside.radius > 2
    np.testing.assert_allclose(cable.points[:, 1:], np.tile([6.0, 9.0], (len(cable.points), 1)), atol=0.3)
    assert cable.pull[0] == 0 and cable.points[-1, 0] > 50 and cable.offset == pytest.approx(3, abs=0.5)


@pytest.mark.slow
def test_a_cable_runs_through_the_holes_of_walls_in_a_row():
    inside = found(holed(gaps=((8, 20), (28, 40), (46, 54))))
    (cable,) = inside.cables
    assert inside.through_air and len(cable.points) == 4
    np.testing.assert_allclose(cable.points[:, 1:], np.tile([6.0, 9.0], (4, 1)), atol=0.3)
    np.testing.assert_allclose(cable.points[:, 0], [4, 24, 43, 57], atol=2)


@pytest.mark.parametrize("shape", [box_shape(), chambered()], ids=["solid", "chambers"])
def test_chambers_are_no_channels(shape):
    assert found(shape) is None


def test_a_wide_bore_is_no_channel():
    assert found(tube(), "bottom") is None
