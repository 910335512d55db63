from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar
from support.trunks import trunk

from cfem.core.errors import InputError
from cfem.plant.fem_plant import FemPlant


@pytest.fixture(scope="module")
def plant():
    return FemPlant(bar(cables=1))


def test_a_step_to_where_the_robot_stands_costs_nothing(plant):
    condensed = plant.at_displacement(np.array([1.0]))
    solves = plant.solves
    measured = plant.step(np.array([1.0]))
    assert plant.solves == solves
    np.testing.assert_allclose(measured.delta_a, condensed.delta_a, atol=1e-9)
    np.testing.assert_allclose(measured.lambda_a, condensed.lambda_a, rtol=1e-6)


def test_force_undoes_displacement(plant):
    by_displacement = plant.step(np.array([1.5]))
    plant.step(np.array([0.5]))
    by_force = plant.step(by_displacement.lambda_a, "force")
    np.testing.assert_allclose(by_force.x_e, by_displacement.x_e, atol=1e-6)


def test_a_cable_that_would_push_goes_slack(plant):
    measured = plant.step(np.array([-0.5]))
    assert measured.lambda_a == 0.0
    np.testing.assert_allclose(measured.delta_a, 0.0, atol=1e-8)


def test_held_nodes_stay_held_however_many_states_were_solved_before():
    robot = bar()
    plant = FemPlant(robot)
    rest = robot.body.mesh.X[robot.fixed]
    for turn in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        plant.pull(0.45 + 0.25 * np.array([np.cos(turn), np.sin(turn)]))
        plant.step(plant.state.delta_a + np.array([0.1, -0.05]))
        np.testing.assert_array_equal(plant.x[robot.fixed], rest)


def test_a_pull_keeps_each_cable_within_its_reach():
    """Three cables of which one has less reach: forces in proportion to the shares would pull it beyond."""
    plant = FemPlant(replace(trunk(3, divisions=4), reach=np.array([[0.0, 4.0], [0.0, 10.0], [0.0, 10.0]])))
    shares = 0.45 + 0.3 * np.cos(np.arange(6)[:, None] * np.pi / 3 - np.arange(3) * np.pi / 2)
    used = np.array([plant.pull(share).delta_a for share in shares]) / [4.0, 10.0, 10.0]
    assert (used <= 1.0).all() and used.max() > 0.98
    free = np.abs(used.max(axis=1) - 0.99) > 0.01
    assert free.any() and not free.all()  # the curve is cut only where it leaves the reach


def test_a_pull_holds_cables_that_others_make_pay_out_at_their_lower_reach():
    """Two cables on opposite sides: control may command neither below its reach, and so may no goal ask for it."""
    robot = bar()
    plant = FemPlant(robot)
    for share in ([0.8, 0.1], [0.9, 0.0], [0.1, 0.5]):
        measured = plant.pull(np.array(share))
        assert (measured.delta_a >= robot.reach[:, 0] - 1e-6).all() and (measured.lambda_a >= 0.0).all()
        assert measured.delta_a.max() > 4.0  # the robot is still pulled as far by the other
        np.testing.assert_allclose(FemPlant(robot).step(measured.delta_a).x_e, measured.x_e, atol=1e-5)
    loose = FemPlant(replace(robot, reach=np.array([[-5.0, 8.0], [-5.0, 8.0]])))
    assert loose.pull(np.array([0.8, 0.1])).delta_a[1] < -1.0  # a reach that leaves room to pay out is used


def test_a_command_of_another_size_is_refused(plant):
    with pytest.raises(InputError, match="a command is 1 number, one for each actuator; got"):
        plant.step([1.0, 2.0])


def test_a_displacement_that_is_no_number_is_reported(plant):
    measured = plant.step(np.array([np.nan]))
    assert measured.status != "converged" and np.isnan(measured.x_e).all()


def test_a_curve_and_the_commands_along_it_take_about_one_factorisation_each():
    plant = FemPlant(bar())
    shares = [0.45 + 0.25 * np.array([np.cos(turn), np.sin(turn)]) for turn in np.arange(12) * np.pi / 6]
    goals = [plant.pull(share).delta_a for share in shares]
    first = plant.factorizations
    for delta_a in goals:
        plant.step(delta_a + 1e-6)
    assert plant.solves == 24 and first <= 40
    assert plant.factorizations - first == 12


def test_states_that_crowd_together_are_remembered_once():
    """Reach 8 mm: states nearer than 0.08 mm to each other teach nothing new."""
    plant = FemPlant(bar(element="hex8", divisions=(6, 1, 1), cables=1))
    for nearby in (1.0, 1.02, 1.05, 0.98):
        plant.step(np.array([nearby]))
    assert len(plant._known) == 1
    plant.step(np.array([1.1]))
    assert len(plant._known) == 2
