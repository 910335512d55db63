from dataclasses import replace

import numpy as np
import pytest

import cfem


@pytest.fixture(scope="module")
def robot(bar):
    return cfem.load_robot(bar / "pipelines" / "bar" / "scene.yaml")


def test_a_robot_meshed_in_memory_is_the_robot_of_the_mesh_folder(bar, robot):
    stored = cfem.load_robot(bar / "pipelines" / "bar" / "scene.yaml", bar / "data" / "bar" / "mesh")
    np.testing.assert_array_equal(stored.X, robot.X)


def test_overrides_change_the_scene(bar, robot):
    finer = cfem.load_robot(bar / "pipelines" / "bar" / "scene.yaml", overrides=["mesh.size=2.5 mm"])
    assert len(finer.X) > 4 * len(robot.X)


def test_displacement_and_force_are_two_ways_to_one_equilibrium(robot):
    pulled = cfem.solve(robot, displacement=[3.0])
    again = cfem.solve(robot, force=pulled.lambda_a, start=pulled)
    np.testing.assert_allclose(again.delta_a, [3.0], rtol=1e-7)
    np.testing.assert_allclose(again.delta_e, pulled.delta_e, atol=1e-6)
    assert pulled.lambda_a[0] > 0 and pulled.residual < 1e-8


def test_without_actuation_it_rests(robot):
    assert np.abs(cfem.solve(robot).delta_e).max() < 1e-9


@pytest.mark.parametrize(
    "asked, says",
    [
        ({"displacement": [1.0, 2.0]}, "displacement: expected 1 finite numbers"),
        ({"force": [np.nan]}, "force: expected 1 finite numbers"),
        ({"force": "much"}, "force: expected 1 numbers"),
        ({"force": [1.0], "displacement": [1.0]}, "give one of the two"),
    ],
)
def test_what_is_no_actuation_is_refused(robot, asked, says):
    with pytest.raises(cfem.SpecError, match=says):
        cfem.solve(robot, **asked)


def test_a_robot_that_nothing_holds_is_an_error_and_no_answer(robot):
    with pytest.raises(cfem.NumericalError, match=r"bar: no equilibrium: .*singular"):
        cfem.solve(replace(robot, fixed=robot.fixed[:1]), displacement=[3.0])
