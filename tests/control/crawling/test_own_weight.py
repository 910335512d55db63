"""Weight of legs on their centre of mass."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cfem.constraint.centre_of_mass import CentreOfMass
from cfem.control.crawling.own_weight import own_weight
from cfem.core.errors import InputError

CENTRE = CentreOfMass(np.arange(2), np.array([0.5, 0.5]), np.array([1.0, 2.0, 3.0]), 4e-6)  # t: 4 g
ROBOT = SimpleNamespace(masses={"body": 4e-6}, effectors=[CENTRE])
GRAVITY = 9810.0  # mm/s^2
TURN, SHIFT = Rotation.from_rotvec([0.0, np.pi / 2, 0.0]).as_matrix(), np.array([10.0, 0.0, 0.0])


def gait(gravity=GRAVITY):
    return SimpleNamespace(gravity=gravity, ground=SimpleNamespace(normal=[0.0, 0.0, 2.0]))


def test_each_leg_carries_its_mass_times_gravity_against_the_grounds_normal():
    loads, weights = own_weight(gait(), ROBOT, [(np.eye(3), np.zeros(3)), (TURN, SHIFT)])
    np.testing.assert_allclose(loads[0], [0, 0, -0.03924], atol=1e-12)
    np.testing.assert_allclose(TURN @ loads[1], loads[0], atol=1e-12)
    assert [leg.size for leg in weights] == pytest.approx([0.03924, 0.03924])
    np.testing.assert_allclose(weights[1].rest, TURN @ CENTRE.rest + SHIFT)


def test_without_gravity_nothing_weighs():
    loads, weights = own_weight(gait(None), ROBOT, [(np.eye(3), np.zeros(3))])
    np.testing.assert_array_equal(loads[0], np.zeros(3))
    assert weights == []


def test_weight_needs_the_centre_of_mass_for_the_last_effector():
    with pytest.raises(InputError, match="not the last effector"):
        own_weight(gait(), SimpleNamespace(masses={"body": 4e-6}, effectors=[CENTRE, "tip"]), [])


def test_a_robot_without_a_centre_of_mass_carries_nothing_where_nothing_weighs():
    loads, weights = own_weight(gait(None), SimpleNamespace(masses={}, effectors=["tip"]), [None, None])
    assert [len(load) for load in loads] == [0, 0] and weights == []
    with pytest.raises(InputError, match="not the last effector"):
        own_weight(gait(None), SimpleNamespace(masses={"a": 1.0, "b": 1.0}, effectors=["tip", CENTRE]), [])
