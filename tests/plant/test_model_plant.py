import numpy as np
import pytest
from scipy.optimize import brentq
from support.arc_robot import REST_E, ArcRobot, tip

from cfem.plant.model_plant import ModelPlant


def test_displacement_and_force_agree():
    plant = ModelPlant(ArcRobot(), REST_E)
    first = plant.step(np.array([6.0, 4.0]))
    second = plant.step(first.lambda_a, "force")
    np.testing.assert_allclose(first.x_e, REST_E + tip(np.array([6.0, 4.0])), atol=1e-9)
    np.testing.assert_allclose(second.x_e, first.x_e, atol=1e-6)
    assert (first.t, second.t) == (1, 2)


def test_a_state_out_of_reach_is_a_measurement_with_its_reason():
    measured = ModelPlant(ArcRobot(limit=5.0), REST_E).step(np.array([6.0, 0.0]))
    assert measured.status != "converged"
    assert np.isnan(measured.x_e).all()


@pytest.mark.parametrize("kind", ["displacement", "force"])
def test_rest_is_rest(kind):
    measured = ModelPlant(ArcRobot(), REST_E).step(np.zeros(2), kind)
    np.testing.assert_allclose(measured.x_e, REST_E, atol=1e-6)


BOTH = np.array([True, True])


def test_a_cable_that_would_push_is_slack_where_it_carries_nothing():
    """Where it stands is found by a search on the closed form of its force."""
    command = np.array([9.0, 2.0])
    held = ModelPlant(ArcRobot(), REST_E).step(command)
    assert held.lambda_a[1] < -0.1
    right = brentq(lambda at: ArcRobot().at_displacement(np.array([9.0, at])).lam[1], 2.0, 20.0, xtol=1e-12)
    let = ModelPlant(ArcRobot(), REST_E, unilateral=BOTH).step(command)
    np.testing.assert_allclose(let.delta_a, [9.0, right], rtol=1e-8)
    np.testing.assert_allclose(let.x_e, REST_E + tip(np.array([9.0, right])), rtol=1e-8)
    assert abs(let.lambda_a[1]) < 1e-8 * let.lambda_a[0]
    beside = ModelPlant(ArcRobot(), REST_E, unilateral=np.array([True, False])).step(command)
    np.testing.assert_array_equal(beside.x_e, held.x_e)


def test_cables_that_pull_stand_where_they_are_told_and_one_that_was_slack_is_taken_up():
    plant = ModelPlant(ArcRobot(), REST_E, unilateral=BOTH)
    assert plant.step(np.array([9.0, 2.0])).delta_a[1] > 2.0
    let_out = plant.step(np.array([-3.0, -2.0]))
    np.testing.assert_allclose(let_out.delta_a, 0.0, atol=1e-8)
    np.testing.assert_allclose(let_out.x_e, REST_E, atol=1e-8)
    for command in ([6.0, 5.5], [9.0, 9.0], [0.0, 0.0]):
        there, bare = plant.step(np.array(command)), ModelPlant(ArcRobot(), REST_E).step(np.array(command))
        np.testing.assert_array_equal(there.x_e, bare.x_e)


def test_a_push_takes_the_force_of_a_cable_that_would_pull():
    command, push = np.array([6.0, 5.5]), np.array([-3.0, 0.0, 0.0])
    held = ModelPlant(ArcRobot(), REST_E, push).step(command)
    let = ModelPlant(ArcRobot(), REST_E, push, BOTH).step(command)
    assert held.lambda_a.min() < -0.1 and let.lambda_a.min() > -1e-6
    slack = int(held.lambda_a.argmin())
    assert let.delta_a[slack] > command[slack] and let.delta_a[1 - slack] == command[1 - slack]
