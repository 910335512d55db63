"""The loop against its closed form on a linear robot, and against a robot that bends."""

from dataclasses import replace

import numpy as np
import pytest
from control.loop_poles import poles
from support import arc_robot, linear_robot
from support.arc_robot import ArcRobot, tip
from support.linear_robot import LinearRobot

from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.run import Pace, run_closed_loop
from cfem.control.closed_loop.tick import Pilot
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.plant.gains import Gains, integral_for
from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant, Stiffer
from cfem.plant.model_plant import ModelPlant

GOAL = linear_robot.REST_E + [4.0, -3.0]
TUNED = integral_for(np.deg2rad(60), 1)


def pilot(robot=linear_robot, model=None, **changes):
    unilateral = np.full(2, robot is arc_robot)
    n_e = len(robot.REST_E)
    length = 120.0
    made = Pilot(
        model or (LinearRobot() if robot is linear_robot else ArcRobot()),
        "force",
        "equilibrium",
        Limits.of(robot.REACH, unilateral),
        np.ones(n_e),
        ridge_of(1e-12, robot.REACH, length),
        SearchSettings(iterations=1, tolerance=1e-10),
    )
    return replace(made, **changes)


def errors(moments):
    return np.array([one.error for one in moments])


def plant(model, robot=linear_robot, seed=0, **imperfection):
    return ImperfectPlant(ModelPlant(model, robot.REST_E), Imperfection(**imperfection), seed)


def run(pilot, plant, goals=(GOAL,), gains=None, rest_e=linear_robot.REST_E, ticks=40, **pace):
    pace = Pace(**({"radius": 0.5, "hold": 5, "ticks_a_goal": ticks} | pace))
    return run_closed_loop(np.array(goals), pilot, plant, np.asarray(rest_e), pace, gains)


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("stiffness", [0.6, 1.0, 1.5])
def test_the_error_follows_the_recursion_of_the_integrator(delay, stiffness):
    moments = run(pilot(), plant(LinearRobot(stiffness), delay=delay), gains=Gains(0.02, 0.2))
    m, move = 1 / stiffness, np.linalg.norm(GOAL - linear_robot.REST_E)
    x, total = [], 0.0
    for k in range(40):
        error = 1 - x[k - 1 - delay] if k > delay else 0.0
        total += 0.2 * error
        x.append(m * (1 + total + 0.02 * error))
    np.testing.assert_allclose(errors(moments), move * np.abs(1 - np.array(x)), atol=1e-6)


def test_a_model_of_the_forces_drives_as_one_of_the_displacements():
    class ByForce(LinearRobot):
        form = "force"

        def at_force(self, lambda_a):
            return super().at_displacement(self.W[2:, 2:] @ lambda_a)

        def at_displacement(self, delta_a):
            assert not delta_a.any(), "asked for its inverse beyond the start"
            return super().at_displacement(delta_a)

    one, other = (
        np.array([each.belief.u for each in run(pilot(model=model), plant(LinearRobot(1.2)), gains=Gains(0, 0.3))])
        for model in (ByForce(), LinearRobot())
    )
    np.testing.assert_allclose(one, other, atol=1e-9)


def test_open_loop_misses_by_the_wrong_stiffness_and_closed_does_not():
    softer, move = LinearRobot(0.8), np.linalg.norm(GOAL - linear_robot.REST_E)
    assert errors(run(pilot(), plant(softer)))[-1] == pytest.approx(move / 4, rel=1e-6)
    assert errors(run(pilot(), plant(softer), gains=Gains(0, 0.5)))[-1] < 1e-6


def test_the_paper_s_gains_converge_at_their_pole():
    found = errors(run(pilot(), plant(LinearRobot(1.25)), gains=Gains(0.01, 0.002), ticks=400))
    slowest = np.abs(poles(0.01, 0.002, 0, 0.8)).max()
    assert (found[399] / found[199]) ** (1 / 200) == pytest.approx(slowest, abs=1e-5)


def test_a_sample_counts_once_however_long_it_stays_the_latest():
    slow = run(pilot(), plant(LinearRobot(1.25), samples_a_tick=0.25), gains=Gains(0, 0.3), ticks=41)
    fast = run(pilot(), plant(LinearRobot(1.25)), gains=Gains(0, 0.3), ticks=11)
    np.testing.assert_allclose(errors(slow)[::4][1:], errors(fast)[1:], atol=1e-6)


def test_the_same_seed_is_the_same_run_and_another_is_not():
    def of(seed):
        noisy = plant(LinearRobot(1.1), seed=seed, noise=0.1, delay=1, quantum=0.01)
        return np.array([one.belief.u for one in run(pilot(), noisy, gains=Gains(0.01, 0.3))])

    assert np.array_equal(of(3), of(3)) and not np.array_equal(of(3), of(4))


def test_noise_moves_the_robot_as_the_autoregression_says():
    # x_k+1 = x_k - K (x_k-1 + n_k-1): variance K (1 + K) / ((1 - K) (2 + K)) of the noise's.
    moments = run(pilot(), plant(LinearRobot(), noise=0.1, delay=1), gains=Gains(0, TUNED), ticks=3000)
    x = np.array([one.actual.x_e - GOAL for one in moments[50:]])
    expected = 0.1 * np.sqrt(TUNED * (1 + TUNED) / ((1 - TUNED) * (2 + TUNED)))
    assert x.std(axis=0) == pytest.approx([expected, expected], rel=0.06)


def test_integral_does_not_wind_up_behind_a_bound():
    """One goal beyond a force bound for long, then one within: what is left is how wrong the model was at the bound."""
    held = Limits(np.array([[-3.0, 3.0]] * 2), linear_robot.REACH)
    far, near = linear_robot.REST_E + [30.0, 0.0], linear_robot.REST_E + [2.0, 1.0]
    bounded = pilot(limits=held)
    moments = run(bounded, plant(LinearRobot(1.1)), (far, near), Gains(0, 0.3), ticks=60)
    back = errors(moments)[60:]
    assert back[0] < 0.7 and back[10] < 0.03 and back[-1] < 1e-5


def test_a_push_that_ends_while_a_bound_holds_is_forgotten_at_the_loop_s_pole():
    held = pilot(limits=Limits(np.array([[-3.0, 3.0]] * 2), linear_robot.REACH))
    robot, push = ModelPlant(LinearRobot(), linear_robot.REST_E), np.array([-5.0, 0.0])
    away = ModelPlant(LinearRobot(), linear_robot.REST_E, push)
    moments = run(
        held,
        ImperfectPlant(away, Imperfection(), 0, robot, since=40),
        (linear_robot.REST_E + [3.5, 1.0],),
        Gains(0, 0.3),
        ticks=60,
    )
    assert np.abs(moments[38].belief.u).max() == pytest.approx(3.0)
    found, moved = errors(moments), np.linalg.norm(LinearRobot().W[:2, :2] @ push)
    np.testing.assert_allclose(found[50:], moved * 0.7 ** np.arange(11, 21), rtol=1e-5)


def test_the_correction_of_what_no_actuator_corrects_is_what_it_is():
    """A goal off the surface that the effector can reach: the correction is the model's error, and stays."""
    goal = arc_robot.REST_E + tip(np.array([8.0, 7.0])) + [0.0, 3.0, 12.0]
    moments = run(
        pilot(arc_robot), plant(Stiffer(ArcRobot(), 1.1), arc_robot), (goal,), Gains(0, 0.3), arc_robot.REST_E, 300
    )
    moved = np.array([one.aimed - one.goal for one in moments])
    state = moments[-1].belief.iterate.condensed
    np.testing.assert_allclose(moved[-1], arc_robot.REST_E + state.delta_e - moments[-1].actual.x_e, atol=1e-6)
    assert np.linalg.norm(moved[-1]) < 8


@pytest.mark.parametrize("command", ["displacement", "force"])
def test_commands_keep_their_rate_and_amplitude(command):
    box = np.array([[-2.5, 2.5]] * 2)
    limits = Limits(box, linear_robot.REACH) if command == "force" else Limits(np.full((2, 2), np.inf) * [-1, 1], box)
    moments = run(pilot(command=command, limits=limits, rate=0.3), plant(LinearRobot(0.7)), gains=Gains(0.01, 0.3))
    u = np.array([np.zeros(2), *(one.belief.u for one in moments)])
    assert np.abs(np.diff(u, axis=0)).max() <= 0.3 + 1e-12 and np.abs(u).max() <= 2.5


def test_goals_advance_when_they_were_held():
    goals = [linear_robot.REST_E + [x, 1.0] for x in (1.0, 2.0, 50.0)]
    moments = run(pilot(), plant(LinearRobot(1.1), delay=1), goals, Gains(0, TUNED), hold=4, radius=0.1, ticks=None)
    of = [[one for one in moments if one.index == index] for index in range(3)]
    for one, ticks in zip(of, (15, 4), strict=False):  # what was learned at the first serves the second
        assert len(one) <= ticks and (errors(one)[-4:] <= 0.1).all() and (errors(one)[:-4] > 0.1).all()
    assert len(of[2]) == 1000 and errors(of[2])[-1] > 1
    assert len(run(pilot(), plant(LinearRobot()), goals, None, ticks=None, budget=7)) == 7


def test_a_push_is_taken_back_by_the_closed_loop_alone():
    push = np.array([0.5, -0.5])
    pushed = {
        closed: ImperfectPlant(
            ModelPlant(LinearRobot(), linear_robot.REST_E),
            Imperfection(delay=1),
            0,
            ModelPlant(LinearRobot(), linear_robot.REST_E, push),
            since=20,
        )
        for closed in (True, False)
    }
    found = {
        closed: errors(run(pilot(), one, gains=Gains(0, TUNED) if closed else None)) for closed, one in pushed.items()
    }
    moved = np.linalg.norm(LinearRobot().W[:2, :2] @ push)
    assert found[False][18] < 1e-6 and found[True][18] < 1e-6
    assert found[False][-1] == pytest.approx(moved) and found[True][19] == pytest.approx(moved)
    assert found[True][-1] < 1e-3


def bent(seeds, delay=1):
    """Stiffness wrong by up to half, noise, one tick late, on a robot that bends: last errors over the noise."""
    last = []
    for seed in seeds:
        random = np.random.default_rng(seed)
        stiffness, share = random.uniform(0.5, 1.5), random.uniform(2, 8, 2)
        share = share.mean() + 0.2 * (share - share.mean())
        goal = arc_robot.REST_E + tip(share)
        real = plant(Stiffer(ArcRobot(), stiffness), arc_robot, seed, delay=delay, noise=0.01)
        moments = run(pilot(arc_robot), real, (goal,), Gains(0, TUNED), arc_robot.REST_E, ticks=50)
        last.append(errors(moments)[-10:].max())
    return np.array(last)


def test_stiffness_wrong_by_half_converges():
    assert bent(range(12)).max() < 0.1


@pytest.mark.slow
def test_stiffness_wrong_by_half_converges_for_a_thousand_seeds():
    found = bent(range(1000))
    print(f"largest error of the last ten ticks: median {np.median(found):.3f}, largest {found.max():.3f} mm")
    assert found.max() < 0.1


def test_beyond_the_bound_it_does_not():
    limits = Limits(np.full((2, 2), np.inf) * [-1, 1], np.full((2, 2), np.inf) * [-1, 1])
    late = plant(LinearRobot(0.5), delay=1)
    diverges = errors(run(pilot(limits=limits), late, gains=Gains(0, 0.55), ticks=100))
    assert diverges[-10:].max() > 10 * diverges[:10].max()


def test_iterations_within_a_tick_arrive_sooner():
    goal = arc_robot.REST_E + tip(np.array([12.0, 11.0]))

    def first_tick(iterations):
        now = pilot(arc_robot, settings=SearchSettings(iterations=iterations))
        return errors(run(now, plant(ArcRobot(), arc_robot), (goal,), None, arc_robot.REST_E, ticks=1))[0]

    assert first_tick(20) < 1e-3 < first_tick(1)
