"""The rule by which samples correct: once each, against the reference of their command, with gains for their delay."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import linear_robot
from support.fast_cases import fast_are
from support.linear_robot import LinearRobot

from cfem.condensed.far import FAR
from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.feedback import WINDOW, Feedback
from cfem.control.closed_loop.run import Pace, run_closed_loop
from cfem.control.closed_loop.tick import Pilot
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.core.errors import InputError
from cfem.plant.gains import Gains, integral_for
from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant
from cfem.plant.model_plant import ModelPlant

GOALS = linear_robot.REST_E + np.array([[4.0, -3.0], [-6.0, 2.0]])
ROBOTS = {"exact": (1.0, None), "stiffer": (1.1, None), "loaded": (1.0, np.array([2.0, -3.0]))}
LENGTH = 120.0  # mm
HALF, DEFAULT = Gains(0.0, 0.5), Gains()
FOLDS = 2  # of ten, by which the error falls within the ticks of a goal


def feedback(gains=HALF, **more):
    return Feedback(gains, np.ones(2, bool), **more)


def run(interval, delay, robot, gains=DEFAULT, ticks=None):
    """(goals, ticks) mm errors."""
    stiffness, push = ROBOTS[robot]
    limits, ridge = Limits.of(linear_robot.REACH, np.zeros(2, bool)), ridge_of(1e-12, linear_robot.REACH, LENGTH)
    pilot = Pilot(LinearRobot(), "force", "equilibrium", limits, np.ones(2), ridge, SearchSettings(1, 1e-10))
    sensor = Imperfection(samples_a_tick=1 / interval, delay=delay)
    plant = ImperfectPlant(ModelPlant(LinearRobot(stiffness), linear_robot.REST_E, push), sensor, 0)
    ticks = ticks or (3 * FOLDS + 2) * (delay + interval)
    controller = Controller(pilot, linear_robot.REST_E, gains, far=np.full(2, FAR * LENGTH))
    pace = Pace(0.0, 1, ticks_a_goal=ticks)
    moments = run_closed_loop(GOALS, pilot, plant, linear_robot.REST_E, pace, controller=controller)
    return np.array([one.error for one in moments]).reshape(len(GOALS), ticks)


def settles(interval, delay):
    """The error is a tenth of the largest that a goal brings (3 + 1) (delay + interval) ticks after each goal, a
    hundredth after (6 + 1) (delay + interval): what nobody can know before, and ten times less in each 3 (delay +
    interval)."""
    for robot in ROBOTS:
        found = run(interval, delay, robot)
        first = max(found[:, 0].max(), 1e-6)
        for folds in range(1, FOLDS + 1):
            left = found[:, (3 * folds + 1) * (delay + interval) :].max() / first
            assert left <= 0.1**folds, (interval, delay, robot, folds, left)


@pytest.mark.parametrize(
    "interval, delay", fast_are([(1, 0), (3, 1), (10, 5), (1, 20)], product([1, 3, 10], [0, 1, 5, 20]))
)
def test_the_default_gains_settle_at_every_goal(interval, delay):
    settles(interval, delay)


@pytest.mark.slow
@pytest.mark.parametrize("interval", range(1, 21))
def test_the_default_gains_settle_on_the_whole_grid(interval):
    for delay in range(21):
        settles(interval, delay)


def test_a_fixed_gain_that_settles_in_time_does_not_five_ticks_late():
    assert run(1, 5, "stiffer", HALF, ticks=120)[1, -1] > 100 * run(1, 5, "stiffer", ticks=120)[1, -1]


def test_a_sample_corrects_once():
    correction = feedback()
    for x in (1.0, 2.0, 3.0):
        correction.commanded(np.array([x, 0.0]))
    assert correction.sample(2, np.array([1.5, 0.0])) and not correction.sample(2, np.array([1.5, 0.0]))
    np.testing.assert_allclose(correction.moved, [0.25, 0.0])
    assert not correction.sample(1, np.array([9.0, 9.0]))
    np.testing.assert_allclose(correction.total, [0.25, 0.0])


def test_the_reference_is_that_of_the_sample_s_command_without_its_correction():
    correction = feedback()
    correction.commanded(np.array([1.0, 1.0]))
    assert correction.sample(1, np.zeros(2))
    correction.commanded(np.array([1.5, 1.5]))  # where the corrected goal led: the reference stays 1
    correction.commanded(np.array([7.0, 7.0]))
    assert correction.sample(2, np.array([1.0, 1.0]))
    np.testing.assert_allclose(correction.moved, [0.5, 0.5])


@pytest.mark.parametrize("x_e", [[np.nan, 0.0], [np.inf, 0.0]])
def test_what_is_not_finite_changes_nothing(x_e):
    correction = feedback()
    correction.commanded(np.ones(2))
    assert not correction.sample(1, np.array(x_e)) and not correction.moved.any() and correction.sampled == 1


@pytest.mark.parametrize(("place", "heard"), [(29.0, True), (31.0, False), (-29.0, False)])
def test_a_sample_where_the_robot_cannot_be_changes_nothing(place, heard):
    """One outlier of 1e7 mm moved the goal so far that later goals had no answer."""
    said = feedback(rest_e=np.array([10.0, 0.0]), far=np.array([20.0, 20.0]))
    for tick in (1, 2):  # a jump corrects once it is confirmed
        said.commanded(np.ones(2))
        heard_last = said.sample(tick, np.array([place, 0.0]))
    assert heard_last == heard == said.moved.any()


@pytest.mark.parametrize(("unit", "heard"), [(1.0, True), (1e-3, False)])
def test_a_sample_in_metres_changes_nothing(unit, heard):
    said = feedback(rest_e=np.array([10.0, 100.0]), far=np.array([200.0, 200.0]))
    said.commanded(np.array([12.0, 95.0]))
    assert said.sample(1, unit * np.array([14.0, 90.0])) == heard == said.moved.any()


def near(missed, length=100.0):
    """Corrections of one row after samples that miss by these (mm), of a robot of that length."""
    said = Feedback(HALF, np.ones(1, bool), far=np.array([2.0 * length]))
    for tick, amount in enumerate(missed, 1):
        said.commanded(said.moved.copy())
        said.sample(tick, np.array([0.0]) + said.moved - amount)
        yield float(said.moved[0])


def test_one_sample_that_jumps_corrects_nothing():
    """One outlier of a third of the length sent the robot to the end of its stroke for a tick."""
    moved = list(near([0.2] * 10 + [40.0] + [0.2] * 5))
    np.testing.assert_allclose(moved[10:], 0.2, atol=1e-3)


def test_a_jump_that_the_next_sample_confirms_corrects():
    moved = list(near([0.2] * 10 + [40.0] * 9))
    assert moved[10] == pytest.approx(0.2, abs=1e-3) and moved[11] > 19.0
    assert moved[-1] == pytest.approx(40.0, abs=0.5)


def test_a_load_on_a_robot_that_has_just_started_corrects_with_the_second_sample():
    assert list(near([20.0, 20.0]))[1] == pytest.approx(10.0)


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_a_tenth_of_the_length_still_corrects(seed):
    """A sensor far worse than the gate expects: its spread widens, and the mean gets through."""
    noise = 10.0 * np.random.default_rng(seed).standard_normal(400)
    assert np.mean(list(near(15.0 + noise))[200:]) == pytest.approx(15.0, abs=4.0)


@settings(max_examples=30, deadline=None)
@given(share=st.sampled_from([0.02, 0.1, 0.3]), seed=st.integers(0, 10**6))
def test_garbage_among_good_samples_is_forgotten_at_once(share, seed):
    """After the last bad sample the correction is right within twenty good ones."""
    rng = np.random.default_rng(seed)
    bad = np.where(rng.random(80) < share, rng.uniform(-150, 150, 80), 3.0)
    assert list(near([*bad, *[3.0] * 20]))[-1] == pytest.approx(3.0, abs=0.01)


def test_rows_that_nobody_measures_do_not_correct():
    correction = Feedback(Gains(0.1, 0.5), np.array([True, False]))
    correction.commanded(np.ones(2))
    assert correction.sample(1, np.array([0.0, np.nan]))
    np.testing.assert_allclose(correction.moved, [0.6, 0.0])


def test_a_sample_older_than_the_history_changes_nothing():
    correction = feedback(history=4)
    for _ in range(6):
        correction.commanded(np.ones(2))
    assert not correction.sample(2, np.zeros(2)) and not correction.moved.any()
    assert correction.sample(3, np.zeros(2))


def test_a_sample_of_a_command_that_was_never_given_is_refused():
    correction = feedback()
    correction.commanded(np.ones(2))
    with pytest.raises(InputError, match="of tick 2, and 1 commands were given"):
        correction.sample(2, np.zeros(2))


def test_the_sum_is_bounded():
    correction = feedback(Gains(0.1, 0.5, bound=2.0))
    for tick in range(1, 21):
        correction.commanded(np.array([3.0, 4.0]) + correction.moved)
        correction.sample(tick, np.zeros(2))
    np.testing.assert_allclose(correction.total, [1.2, 1.6])
    np.testing.assert_allclose(correction.moved, [1.5, 2.0])


def in_turn(correction, ages, interval=1):
    """K_I after each sample; ages: of the samples, which are those of every interval-th command."""
    found = []
    for age in ages:
        tick = correction.sampled + interval
        while correction.given < tick + age - 1:
            correction.commanded(np.zeros(2))
        assert correction.sample(tick, np.zeros(2))
        found.append(correction.integral)
    return found


def test_the_gain_falls_with_the_first_sample_that_is_later_and_waits_before_it_rises():
    found = in_turn(feedback(DEFAULT), [1, 1, 6, 6, *range(5, 0, -1), *[1] * WINDOW])
    soon, late = integral_for(np.pi / 3, 0), integral_for(np.pi / 3, 5)
    assert found[:4] == [soon, soon, late, late] and found[-1] == soon
    assert found[2 : 2 + WINDOW] == [late] * WINDOW and found == sorted(found[:2]) + sorted(found[2:])


def test_a_rare_sample_is_not_late_as_long_as_it_shows_the_last_correction():
    found = in_turn(feedback(DEFAULT), [1] * 4, interval=7)
    assert found == [integral_for(np.pi / 3, 0)] * 4
    found = in_turn(feedback(DEFAULT), [6] * 4, interval=7)
    assert found == [integral_for(np.pi / 3, 5), *[integral_for(np.pi / 3, 0)] * 3]  # the first tells no interval
