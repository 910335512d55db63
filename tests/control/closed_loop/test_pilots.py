"""What a controller's pilot may command, from where it stands."""

from types import SimpleNamespace

import numpy as np
import pytest
from support import linear_robot
from support.linear_robot import LinearRobot

from cfem.control.closed_loop.pilots import gains_of, pilot_of, seeds_of, standing_at
from cfem.control.closed_loop.spec import ControllerSpec, ForceCommandSpec
from cfem.control.closed_loop.tick import Pilot
from cfem.control.search.goal_search import Iterate, SearchSettings, by_force, search_goal
from cfem.control.search.inverse import Aim, Limits
from cfem.control.task.run_spec import FE_BASED
from cfem.core.errors import SpecError
from cfem.plant.gains import Gains

MM = np.array([1.0, -1.0])  # of both actuators
TRAINED = np.array([[-30.0, 25.0], [-10.0, 25.0]])  # mm, beyond the scene's reach on three sides of four


def pilot(controller: str, bounded: bool = True, **command) -> Pilot:
    """The pilot of a loop that commands forces: of finite elements, or of a model trained on TRAINED. bounded: whether
    the actuators state their forces, of up to 500 N."""
    model = LinearRobot()
    model.domain = SimpleNamespace(delta_a=TRAINED.T)
    forces = np.array([[-500.0, 500.0]] * 2)
    robot = SimpleNamespace(reach=linear_robot.REACH, forces=forces if bounded else None)
    search = Pilot(
        model,
        "displacement",
        "equilibrium",
        Limits(forces, robot.reach),
        np.ones(2),
        np.full(2, 1e-9),
        SearchSettings(3, 1e-10),
        restarts=5,
    )
    loop = SimpleNamespace(command=ForceCommandSpec(kind="force", **command))
    spec = ControllerSpec(mode="open", model=controller, iterations=10)
    return pilot_of(search, spec, loop, model, robot)


def searched(pilot: Pilot, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force (2,) N and place (2,) mm of the actuators where a search ends whose goal they reach at delta_a (2,) mm."""
    model = pilot.model
    aim = Aim(model.at_displacement(delta_a).delta_e, pilot.weights, pilot.ridge)
    begin = Iterate.at(model.at_displacement(np.zeros(2)))
    found = search_goal(model, aim, pilot.limits, begin, pilot.settings, by_force)
    return found.lambda_a, found.delta_a


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_finite_elements_are_driven_anywhere_that_the_bound_of_the_force_allows(side):
    wanted = side * 60.0 * MM
    np.testing.assert_allclose(searched(pilot(FE_BASED), wanted)[1], wanted, atol=1e-5)


@pytest.mark.parametrize("wanted", [(-28.0, 0.0), (24.0, 24.0), (0.0, -19.0)])
def test_a_model_is_driven_where_it_was_trained_and_where_the_scene_says(wanted):
    np.testing.assert_allclose(searched(pilot("spectral"), np.array(wanted))[1], wanted, atol=1e-5)


@pytest.mark.parametrize("wanted", [(-40.0, -30.0), (40.0, 40.0)])
def test_a_model_is_not_driven_to_where_neither_reaches(wanted):
    low, high = np.array([[-30.0, -20.0], [25.0, 25.0]])
    _, ends = searched(pilot("spectral"), np.array(wanted))
    assert (ends >= low - 1e-9).all() and (ends <= high + 1e-9).all()
    assert np.isclose(ends, low).any() or np.isclose(ends, high).any()


@pytest.mark.parametrize("wanted", [(-28.0, 0.0), (24.0, 24.0)])
def test_a_robot_that_states_no_forces_is_driven_within_its_scene(wanted):
    _, ends = searched(pilot("spectral", bounded=False), np.array(wanted))
    assert np.abs(ends).max() == pytest.approx(20.0)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_no_force_is_larger_than_the_largest_command(side):
    force, _ = searched(pilot(FE_BASED, largest="5 N"), side * 15.0 * MM)
    assert np.abs(force).max() == pytest.approx(5.0) and np.sign(force).tolist() == [side, -side]


def test_a_tick_changes_the_command_by_a_step_and_searches_once_with_the_controller_s_iterations():
    slow, free = pilot("spectral", step="0.5 N"), pilot("spectral")
    assert slow.rate == 0.5 and free.rate == np.inf
    assert (slow.settings.iterations, slow.restarts, slow.command) == (10, 0, "force")


def controller(mode: str, **more) -> ControllerSpec:
    return ControllerSpec.model_validate({"mode": mode, **more})


@pytest.mark.parametrize(
    ("spec", "gains"),
    [
        (controller("open"), None),
        (controller("closed", mpc={}), None),
        (controller("closed"), Gains(phase_margin=np.radians(60))),
        (controller("closed", gains={"phase_margin": "45 deg"}), Gains(phase_margin=np.radians(45))),
        (controller("closed", gains={"phase_margin": "45 deg", "bound": "3 mm"}), Gains(0, None, 3.0, np.radians(45))),
        (controller("closed", gains={"proportional": 0.1, "integral": 0.2}), Gains(0.1, 0.2)),
        (controller("closed", gains={"integral": 0.2, "bound": "3 mm"}), Gains(0.0, 0.2, 3.0)),
    ],
)
def test_gains_are_those_of_the_spec_and_have_no_bound_unless_it_states_one(spec, gains):
    found = gains_of(spec)
    assert (found is None) == (gains is None)
    if gains:
        stated = (found.proportional, found.bound, found.integral_at(2))
        assert stated == pytest.approx((gains.proportional, gains.bound, gains.integral_at(2)))


@pytest.mark.parametrize(
    ("spec", "seeds"),
    [
        (controller("open"), [4]),
        (controller("open", observer="measured"), [4, 5, 6]),
        (controller("closed"), [4, 5, 6]),
        (controller("policy", policy="saved.onnx"), [4, 5, 6]),
    ],
)
def test_what_hears_no_noise_runs_with_one_seed(spec, seeds):
    assert seeds_of(spec, SimpleNamespace(seeds=[4, 5, 6])) == seeds


def test_a_loop_that_moves_begins_where_the_robot_stands_at_its_first_goal():
    search, wanted = pilot(FE_BASED), np.array([7.0, -4.0])
    goal = linear_robot.REST_E + search.model.at_displacement(wanted).delta_e
    np.testing.assert_allclose(standing_at(goal, search, linear_robot.REST_E).delta_a, wanted, atol=1e-6)


def test_a_first_goal_that_nothing_leads_to_is_an_error():
    search = pilot(FE_BASED)
    with pytest.raises(SpecError, match="no way to the first goal"):
        standing_at(np.full(2, np.nan), search, linear_robot.REST_E)
