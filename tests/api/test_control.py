import numpy as np
import pytest

import cfem


@pytest.fixture(scope="module")
def goal(model):
    """Where the effector stands with the cable at 4 mm."""
    return model.rest_e + model.at_displacement([4.0]).delta_e


def test_a_step_keeps_its_size_and_goes_towards_the_goal(model, goal):
    now = model.at_displacement([0.0])
    assert cfem.inverse_step(model, now, goal, step=1.0).delta_a == pytest.approx([1.0])
    assert cfem.inverse_step(model, now, goal).delta_a > 2.0


def test_a_step_by_finite_elements_takes_rest_and_reach_from_the_robot(bar, model, goal):
    robot = cfem.load_robot(bar / "pipelines" / "bar" / "scene.yaml")
    now = cfem.solve(robot, displacement=[3.5])
    by_fe = cfem.inverse_step(robot, now.condensed, goal).delta_a
    np.testing.assert_allclose(by_fe, cfem.inverse_step(model, model.at_displacement([3.5]), goal).delta_a, rtol=1e-3)


def test_the_actuation_of_a_reachable_goal_is_found(model, goal):
    found = cfem.find_actuation(model, goal)
    assert found.delta_a == pytest.approx([4.0], abs=1e-4) and found.distance < 1e-3
    assert found.status.value == "converged"
    assert 0 < found.model_error == model.error(model.at_displacement(found.delta_a)).tip < 1e-3


def test_a_goal_out_of_reach_ends_at_the_reach(model):
    found = cfem.find_actuation(model, model.rest_e + [-100.0, 0.0, 100.0])
    assert found.delta_a == pytest.approx([8.0]) and found.distance > 10
    assert repr(found) == f"<out of reach: cable 8, {found.distance:.3g} mm from the goal; converged>"


def test_a_bound_on_the_force_holds(model, goal):
    at_most = 0.5 * model.at_displacement([4.0]).lambda_a[0]
    assert cfem.find_actuation(model, goal, largest_force=at_most).lambda_a == pytest.approx([at_most], rel=1e-5)


@pytest.mark.parametrize("command", ["displacement", "force"])
def test_a_controller_leads_the_plant_to_the_goal(model, goal, command):
    controller, plant = cfem.make_controller(model, command=command), cfem.ModelPlant(model, model.rest_e)
    for _ in range(6):
        measured = plant.step(controller.tick(goal).u, command)
    assert measured.x_e == pytest.approx(goal, abs=1e-3)


def test_a_sample_that_does_not_say_what_it_followed_is_refused(model, goal):
    with pytest.raises(cfem.CfemError, match="measured: expected a Measurement, which says what command it followed"):
        cfem.make_controller(model).tick(goal, np.array(goal))


def test_gains_remove_the_error_that_a_push_leaves(model, goal):
    errors = {}
    for gains in ((0.0, 0.0), (0.0, 0.3), None):
        controller = cfem.make_controller(model, gains=gains, iterations=3)
        plant = cfem.ModelPlant(model, model.rest_e, push=np.array([0.0, 0.0, -0.05]))
        measured = None
        for _ in range(40):
            measured = plant.step(controller.tick(goal, measured).u)
        errors[gains] = np.linalg.norm((measured.x_e - goal)[[0, 2]])
    assert errors[0.0, 0.3] < 0.5 * errors[0.0, 0.0] and errors[None] < 0.5 * errors[0.0, 0.0]


def test_without_gains_a_late_and_rare_sample_corrects_once(model, goal):
    """Every third command is seen, five commands later."""
    controller = cfem.make_controller(model, iterations=3, weights=[0.0, 0.0, 1.0])
    plant = cfem.ModelPlant(model, model.rest_e + [0.0, 0.0, 1.0])
    samples, off = [], []
    for tick in range(1, 80):
        known = [one for one in samples if one.t % 3 == 0 and one.t < tick - 5]
        samples.append(plant.step(controller.tick(goal, known[-1] if known else None).u))
        off.append(abs(samples[-1].x_e - goal)[2])
    assert off[0] == pytest.approx(1.0, abs=0.1) and max(off[60:]) < 0.01
    assert controller.feedback.late == 1


def test_a_sample_of_a_command_that_was_never_given_is_refused(model, goal):
    controller = cfem.make_controller(model, gains=(0.0, 0.3))
    plant = cfem.ModelPlant(model, model.rest_e)
    plant.step([0.0])
    measured = plant.step([0.0])
    controller.tick(goal)
    with pytest.raises(cfem.InputError, match="of tick 2, and 1 commands were given"):
        controller.tick(goal, measured)


@pytest.mark.parametrize("wrong", [[0.0], [0.0, 0.0, np.inf]])
def test_a_goal_of_another_robot_is_refused(model, wrong):
    with pytest.raises(cfem.SpecError, match="goal: expected 3 finite numbers"):
        cfem.find_actuation(model, wrong)
    with pytest.raises(cfem.SpecError, match="goal: expected 3 finite numbers"):
        cfem.inverse_step(model, model.at_displacement([0.0]), wrong)
    with pytest.raises(cfem.SpecError, match="goal: expected 3 finite numbers"):
        cfem.make_controller(model).tick(wrong)


def test_the_words_of_a_search_agree_with_its_goal(model, goal):
    reached = cfem.find_actuation(model, goal)
    assert reached.verdict().value == "reached" and repr(reached).startswith("<reached: cable 4, ")
    away = cfem.find_actuation(model, model.rest_e + [-100.0, 0.0, 100.0])
    assert away.verdict().value == "out of reach"
    assert cfem.find_actuation(model, goal, regularisation=1e3).verdict().value == "not converged"


def test_ticks_say_tracking_while_nothing_is_wrong(model, goal):
    controller = cfem.make_controller(model)
    said = [controller.tick(goal).status for _ in range(8)]
    assert said[0] == "tracking" and said[-1] == "converged"


@pytest.mark.parametrize(
    ("of", "words"),
    [
        (lambda goal: 1e-3 * goal, "would be near the robot if it were in metres: goals are in mm"),
        (lambda goal: 1e3 * goal, "times the robot's length: goals are in mm"),
    ],
)
def test_a_goal_in_another_unit_is_refused_and_the_command_stays(model, goal, of, words):
    controller = cfem.make_controller(model)
    before = controller.tick(goal).u
    with pytest.raises(cfem.InputError, match=words):
        controller.tick(of(goal))
    assert controller.belief.u is before
    with pytest.raises(cfem.InputError, match=words):
        cfem.find_actuation(model, of(goal))
    with pytest.raises(cfem.InputError, match=words):
        cfem.inverse_step(model, model.at_displacement([0.0]), of(goal))


@pytest.mark.parametrize("weights", [[0, 0, 0], [1, -1, 0]])
def test_weights_under_which_nothing_counts_are_refused(model, goal, weights):
    with pytest.raises(cfem.SpecError, match="one is positive"):
        cfem.make_controller(model, weights=weights)
    with pytest.raises(cfem.SpecError, match="one is positive"):
        cfem.find_actuation(model, goal, weights=weights)
