"""What loads do to the forces of the actuators, against finite elements and against differences."""

import numpy as np
import pytest

from cfem.plant.fem_plant import FemPlant, pushed
from cfem.predict.estimation.force_series import ForceSeries
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh


def test_a_push_at_locked_actuators_changes_their_forces_as_in_finite_elements(bar, model):
    robot = build_robot(*load_scene_and_mesh(bar / "pipelines" / "bar" / "scene.yaml"))
    push, delta_a = np.array([0.0, 0.004, -0.006]), np.array([3.0])
    forces = []
    for load in (np.zeros(3), push):
        plant = FemPlant(pushed(robot, load))
        plant.at_displacement(delta_a)
        forces.append(plant.state.lambda_a)
    series = ForceSeries.of(model, np.arange(3))
    found = series(delta_a, push)[0] - series(delta_a, np.zeros(3))[0]
    assert abs(forces[1] - forces[0]) > 1e-4
    assert found == pytest.approx(forces[1] - forces[0], rel=0.05)


def test_without_loads_they_are_the_model_s(model):
    at = np.array([2.5])
    assert ForceSeries.of(model, np.array([1, 4]))(at, np.zeros(2))[0] == pytest.approx(model.at_displacement(at).lam)


def test_derivatives_against_differences(model):
    series, x, h = ForceSeries.of(model, np.array([0, 2, 3, 5])), np.array([3.0, 0.01, -0.02, 0.005, 0.004]), 1e-5
    slope = series(x[:1], x[1:])[1]
    for n, unit in enumerate(np.eye(5)):
        ahead, behind = ((x + sign * h * unit) for sign in (1, -1))
        by_n = (series(ahead[:1], ahead[1:])[0] - series(behind[:1], behind[1:])[0]) / (2 * h)
        assert slope[:, n] == pytest.approx(by_n, rel=1e-6, abs=1e-8)


def test_work_of_loads_is_reciprocal(model):
    """d lambda / d w = - d (displacement of the loaded row) / d delta_a, by the skin's own series."""
    at, none = np.array([3.0]), np.zeros(0)
    slope = ForceSeries.of(model, np.array([4]))(at, np.zeros(1))[1][:, 1]
    assert slope == pytest.approx(-model.skin.gradient(at, none)[1], rel=1e-9)
