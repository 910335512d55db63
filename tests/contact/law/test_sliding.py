"""Friction along a step: how far points slide before its last part."""

import numpy as np
import pytest

from cfem.contact.law.newton import newton
from cfem.contact.law.problem import ContactProblem
from cfem.contact.law.sliding import slid, slid_on_object
from cfem.contact.law.solve import solve_contact

MU, C, PRESS = 0.5, 2.0, 3.0  # mm/N, N
W = C * np.eye(3)


def dragged(way, angle, parts):
    """Angle of friction on a point that slides at `angle` to x, after its support is dragged by `way` mm along x, in
    one step, walked in parts."""
    forces = PRESS * np.array([[1.0, -MU * np.cos(angle), -MU * np.sin(angle)]])
    free = np.array([-C * PRESS, way, 0.0]) - W @ (forces[0] * [0, 1, 1])
    slip = slid(W, free, np.zeros((1, 3)), forces, MU, parts)
    free[1:] -= slip[0]
    (answer,), _ = newton(W, free, MU)
    return np.arctan2(-answer[2], -answer[1])


@pytest.mark.parametrize("way", [3.0, 8.0])
def test_the_direction_of_sliding_follows_the_way_of_its_support_as_the_closed_form_says(way):
    # An elastic point is drawn after its support: tan(angle / 2) falls by exp(-way / (C MU PRESS)), below 90 degrees,
    # as the direction of a stress does at constant strain rate (Krieg and Krieg 1977).
    angle = 1.0
    exact = 2 * np.arctan(np.tan(angle / 2) * np.exp(-way / (C * MU * PRESS)))
    errors = {parts: abs(dragged(way, angle, parts) - exact) for parts in (1, 16, 64)}
    assert errors[1] > 0.1
    assert errors[16] < errors[1] / 10
    assert errors[64] == pytest.approx(errors[16] / 4, rel=0.15)


BELOW = np.diag([-1.0, 1.0, -1.0])  # from the frame of the point above a plate to that of the point below it
HEAVY = 2.0  # N, weight of the plate


def dragged_with_plate(way, angle, parts):
    """The same, of a point above a free plate that moves in three directions. Its weight is on the point below it,
    which therefore sticks, and goes with the plate."""
    above = PRESS * np.array([1.0, -MU * np.cos(angle), -MU * np.sin(angle)])
    forces = np.array([above, -above @ BELOW])
    forces[1, 0] += HEAVY
    W, G, load, back = (
        C * np.eye(6),
        np.vstack([np.eye(3), BELOW]),
        np.array([-HEAVY, 0, 0]),
        np.array([0.02, 0.3, -0.1]),
    )
    free = G @ back + [0, way, 0, 0, 0, 0] - W @ forces.ravel()
    slip = slid_on_object(ContactProblem(W, free, G, load, MU), np.zeros((2, 3)), forces, back, parts)
    assert not slip[1].any()
    free.reshape(-1, 3)[:, 1:] -= slip
    answer = solve_contact(ContactProblem(W, free, G, load, MU), "coulomb")
    return np.arctan2(-answer.lam[2], -answer.lam[1])


@pytest.mark.parametrize("way", [6.0, 16.0])
def test_friction_on_a_plate_that_gives_way_as_the_point_does_turns_as_the_closed_form_says(way):
    angle = 1.0
    exact = 2 * np.arctan(np.tan(angle / 2) * np.exp(-way / (2 * C * MU * PRESS)))
    errors = {parts: abs(dragged_with_plate(way, angle, parts) - exact) for parts in (1, 16, 64)}
    assert errors[1] > 0.1
    assert errors[16] < errors[1] / 10
    assert errors[64] == pytest.approx(errors[16] / 4, rel=0.15)


def test_what_sticks_along_the_step_has_not_slid():
    forces = np.array([[PRESS, 0.2, -0.3]])
    free = np.array([-C * PRESS, 0.5, 0.3])
    assert not slid(W, free, np.zeros((1, 3)), forces, MU, 16).any()


def test_a_point_slides_as_far_as_its_support_once_it_slides():
    forces = PRESS * np.array([[1.0, -MU, 0.0]])
    free = np.array([-C * PRESS, 8.0 + C * PRESS * MU, 0.0])
    np.testing.assert_allclose(slid(W, free, np.zeros((1, 3)), forces, MU, 16), [[7.5, 0.0]], atol=1e-12)


def test_a_point_that_comes_down_slides_from_where_it_touches():
    nothing, begin = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])
    along = slid(W, np.array([-1.0, 0.1, 0.0]), begin, nothing, 100.0, 64)  # it touches half of the way
    assert along[0] == pytest.approx([0.05, 0.0], abs=0.1 / 64)


def test_where_a_part_has_no_state_the_law_is_of_the_whole_step():
    forces = PRESS * np.array([[1.0, -MU, 0.0]])
    assert not slid(W, np.array([-C * PRESS, np.nan, 0.0]), np.zeros((1, 3)), forces, MU, 16).any()
