"""Squeezes of springs whose normal forces are known by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.contact.obstacle import Box
from cfem.control.holding.squeeze import balanced
from cfem.equilibrium.contact.grasp import FreeObject

CENTRE, HALF = np.array([0.0, 35.0, -95.0]), np.array([35.0, 14.5, 15.0])
HALF_TURN = np.diag([-1.0, -1.0, 1.0])
POINTS = np.array([[0.0, 20.0, -98.0], [1.7, 20.0, -101.0], [-1.7, 20.0, -101.0]])
CLOSES, STIFF = 3.0, 5e-3  # mm of the patch along y for each mm of both cables, N/mm
PLACES = [(np.eye(3), np.zeros(3)), (HALF_TURN, np.array([30.0, 70, 0])), (HALF_TURN, np.array([-30.0, 70, 0]))]


def finger(turn, shift, stiff=STIFF):
    """Points that move together along y, with the mean of both cables, on one spring."""
    by_actuators = np.tile([[0.0, 0.0], [CLOSES / 2] * 2, [0.0, 0.0]], (3, 1))
    rest, compliance = SimpleNamespace(by_actuators=by_actuators), np.tile(np.eye(3) / stiff, (3, 3))
    return SimpleNamespace(points=POINTS @ turn.T + shift, turn=turn, respond=lambda *_: (rest, compliance))


def held(centre=CENTRE):
    return FreeObject(Box(HALF, t=centre), centre, np.array([0, 0, -0.015, 0, 0, 0]))


def forces(squeeze, stiff):
    return (CLOSES * squeeze[::2] - 0.5) * np.asarray(stiff)


@pytest.mark.parametrize("stiff", [(STIFF, STIFF, STIFF), (2 * STIFF, STIFF, STIFF)])
def test_one_robot_presses_as_hard_as_the_two_on_the_other_side(stiff):
    fingers = [finger(*place, k) for place, k in zip(PLACES, stiff, strict=True)]
    squeeze = balanced(fingers, held(), [2] * 3, 1.5)
    below, right, left = forces(squeeze, stiff)
    assert squeeze[::2].mean() == pytest.approx(1.5) and np.array_equal(squeeze[::2], squeeze[1::2])
    assert right == pytest.approx(left)
    assert below == pytest.approx(2 * right)


def test_two_robots_that_face_each_other_share_alike():
    opposite = (HALF_TURN, np.array([0.0, 70, 0]))
    squeeze = balanced([finger(*PLACES[0]), finger(*opposite)], held(), [2, 2], 0.7)
    np.testing.assert_allclose(squeeze, 0.7, rtol=1e-12)


def test_robots_on_one_side_cannot_balance_and_all_get_the_preload():
    squeeze = balanced([finger(*place) for place in PLACES[1:]], held(), [2, 2], 0.7)
    np.testing.assert_array_equal(squeeze, 0.7)


def test_no_preload_is_none():
    np.testing.assert_array_equal(balanced([finger(*place) for place in PLACES], held(), [2] * 3, 0.0), 0.0)
