import numpy as np
import pytest
from support.arc_robot import LENGTH, REACH, ArcRobot

from cfem.condensed import Condensed, Rows
from cfem.condensed.strokes import ridge_of
from cfem.control.search.inverse import Aim, Limits, inverse_step

RIDGE = ridge_of(1e-9, REACH, LENGTH)
PULLING = Limits.of(REACH, np.array([True, True]))


def aim_at(goal, weights=(1.0, 1.0, 1.0)):
    return Aim(np.asarray(goal, float), np.asarray(weights), RIDGE)


def test_a_goal_on_the_linearisation_is_met_and_the_program_agrees():
    now = ArcRobot().at_displacement(np.array([5.0, 4.0]))
    lam = now.lambda_a + np.array([0.3, 0.1])
    goal = now.W_ea @ lam + now.delta_free[now.rows.e]
    step = inverse_step(now, aim_at(goal), PULLING)
    np.testing.assert_allclose(step.lambda_a, lam, atol=1e-5)
    np.testing.assert_allclose(step.delta_a, now.W_aa @ lam + now.delta_free[now.rows.a], atol=1e-5)
    assert step.qp.kkt.missed < 1e-12


def test_cables_do_not_push_and_stay_within_reach():
    now = ArcRobot().at_displacement(np.array([1.0, 1.0]))
    backwards = inverse_step(now, aim_at([0.0, -50.0, 0.0]), PULLING)
    np.testing.assert_allclose(backwards.lambda_a, 0.0, atol=1e-9)
    far = inverse_step(now, aim_at([0.0, 500.0, 500.0]), PULLING)
    assert far.delta_a.max() == pytest.approx(20.0)


def test_rows_of_weight_zero_do_not_matter():
    now = ArcRobot().at_displacement(np.array([6.0, 6.0]))
    goal = now.delta_e + np.array([3.0, 0.0, 0.0])
    step = inverse_step(now, aim_at(goal, (0.0, 1.0, 0.0)), PULLING)
    np.testing.assert_allclose(step.delta_a, [6.0, 6.0], atol=1e-4)


def test_a_course_that_no_allowed_force_keeps_is_widened_by_the_least():
    now = ArcRobot().at_displacement(np.array([2.0, 2.0]))
    behind = Limits(PULLING.lambda_a, np.array([[-9.0, -5.0], [-9.0, -5.0]]))
    step = inverse_step(now, aim_at([0.0, 40.0, 20.0]), behind)
    assert step.softened
    assert (step.lambda_a >= -1e-9).all()
    # Pulling nothing is the nearest to a pushed course.
    np.testing.assert_allclose(step.delta_a, now.delta_free[now.rows.a], atol=1e-4)


def test_backends_agree():
    now = ArcRobot().at_displacement(np.array([5.0, 1.0]))
    steps = [
        inverse_step(now, aim_at([8.0, 30.0, 20.0]), PULLING, backend=backend) for backend in ("active_set", "osqp")
    ]
    np.testing.assert_allclose(steps[0].delta_a, steps[1].delta_a, atol=1e-6)


def test_where_the_effectors_do_not_matter_the_actuators_go_to_their_preload():
    now = ArcRobot().at_displacement(np.array([6.0, 6.0]))
    free = Limits(np.tile([-np.inf, np.inf], (2, 1)), np.tile([-np.inf, np.inf], (2, 1)))
    step = inverse_step(now, Aim(np.zeros(3), np.zeros(3), np.full(2, 0.1), preload=1.5), free)
    np.testing.assert_allclose(step.delta_a, 1.5, rtol=1e-9)


def test_damping_holds_the_actuators_and_where_they_stand_is_still_the_answer():
    now = ArcRobot().at_displacement(np.array([6.0, 4.0]))
    free = Limits(np.tile([-np.inf, np.inf], (2, 1)), np.tile([-np.inf, np.inf], (2, 1)))
    pulled = Aim(np.zeros(3), np.zeros(3), np.full(2, 0.1), preload=1.0, damping=np.array([0.2, 0.3]))
    step = inverse_step(now, pulled, free)
    np.testing.assert_allclose(step.delta_a, [(1 + 4 * 6.0) / 5, (1 + 9 * 4.0) / 10], rtol=1e-9)
    there = inverse_step(now, Aim(now.delta_e, np.ones(3), np.zeros(2), damping=np.ones(2)), free)
    np.testing.assert_allclose(there.delta_a, [6.0, 4.0], atol=1e-9)


def linearised(W_ea, W_aa):
    """A robot at rest that its compliance describes entirely."""
    n_e, n_a = W_ea.shape
    n = n_e + n_a
    W = np.zeros((n, n))
    W[:n_e, :n_e], W[:n_e, n_e:], W[n_e:, :n_e], W[n_e:, n_e:] = np.eye(n_e), W_ea, W_ea.T, W_aa
    rows = Rows(tuple(f"e{i}" for i in range(n_e)), tuple(f"a{i}" for i in range(n_a)))
    return Condensed(rows, W, np.zeros(n), np.zeros(n_a))


@pytest.mark.parametrize("bound", [10.0, 1e3, 1e6])
def test_a_generous_bound_of_the_forces_does_not_loosen_the_answer(bound):
    now = linearised(np.full((1, 2), 0.2), np.full((2, 2), 0.5) + 1e-9 * np.eye(2))
    limits = Limits(np.array([[0.0, bound]] * 2), np.array([[-100.0, 100.0]] * 2))
    step = inverse_step(now, Aim(np.ones(1), np.ones(1), ridge_of(1e-14, limits.delta_a, 100.0)), limits)
    assert abs(now.W_ea @ step.lambda_a - 1.0)[0] < 1e-9
    assert step.qp.kkt.missed < 1e-12


@pytest.mark.parametrize("bound", [10.0, 1e3, 1e6, np.inf])
def test_chambers_that_outnumber_the_effectors_meet_the_goal_whatever_their_bounds(bound):
    rng = np.random.default_rng(4)
    root = rng.normal(size=(4, 6))
    now = linearised(rng.normal(size=(3, 4)) @ root, root.T @ root)
    goal = now.W_ea @ rng.uniform(1.0, 5.0, 6)
    limits = Limits(np.array([[0.0, bound]] * 6), np.array([[-1e4, 1e4]] * 6))
    step = inverse_step(now, Aim(goal, np.ones(3), np.zeros(6)), limits)
    assert np.abs(now.W_ea @ step.lambda_a - goal).max() < 1e-11


def test_a_bound_of_an_effector_row_is_kept_and_is_where_the_goal_is_beyond_it():
    now = ArcRobot().at_displacement(np.array([5.0, 4.0]))
    goal = now.delta_e + [0.0, 3.0, 0.0]
    bounds = np.array([[-np.inf, np.inf], [-np.inf, now.delta_e[1] + 1.0], [-np.inf, np.inf]])
    limits = Limits(PULLING.lambda_a, PULLING.delta_a, bounds)
    step = inverse_step(now, aim_at(goal, (0.0, 1.0, 0.0)), limits)
    reached = (now.W_ea @ step.lambda_a + now.delta_free[now.rows.e])[1]
    assert not step.softened and reached == pytest.approx(now.delta_e[1] + 1.0)
    assert limits.outside(goal, step.lambda_a) == pytest.approx(2.0)
    impossible = np.array([[-np.inf, np.inf], [now.delta_e[1] + 500.0, np.inf], [-np.inf, np.inf]])
    assert inverse_step(now, aim_at(goal), Limits(PULLING.lambda_a, PULLING.delta_a, impossible)).softened


def test_forces_have_no_part_in_the_distance():
    aim = Aim(np.zeros(3), np.ones(3), RIDGE, places=np.array([True, True, False]))
    assert aim.distance(np.array([3.0, 4.0, 9.0])) == pytest.approx(5.0)
    assert aim.cost(np.array([0.0, 0.0, 2.0]), np.zeros(2)) == pytest.approx(2.0)


def test_the_cost_is_half_the_squares_of_what_is_missed_and_of_what_lies_beside_the_preload():
    aim = Aim(np.zeros(3), np.array([1.0, 2.0, 0.0]), np.array([0.1, 1.0]), preload=np.array([1.0, 3.0]))
    assert aim.cost(np.array([3.0, 1.0, 9.0]), np.array([5.0, 2.0])) == pytest.approx((9 + 4 + 0.16 + 1) / 2)


def test_the_course_of_an_actuator_ends_at_zero_where_it_has_no_end():
    ends = np.array([[-3.0, np.inf], [-np.inf, 4.0], [-np.inf, np.inf], [1.0, 6.0]])
    limits = Limits(np.full((4, 2), [-np.inf, np.inf]), ends)
    np.testing.assert_array_equal(limits.course, [3.0, 4.0, 0.0, 5.0])
