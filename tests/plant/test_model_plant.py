import numpy as np
import pytest
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
