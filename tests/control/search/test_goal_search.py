import numpy as np
import pytest
from scipy.optimize import minimize
from support.arc_robot import LENGTH, REACH, ArcRobot, tip
from support.linear_robot import W_AA, W_EA, LinearRobot

from cfem.condensed import Condensed, Rows
from cfem.condensed.strokes import ridge_of
from cfem.control.search.goal_search import UNMET, Iterate, SearchSettings, SearchStatus, _least_penalty, search_goal
from cfem.control.search.inverse import Aim, Limits

RIDGE = ridge_of(1e-10, REACH, LENGTH)
PULLING = Limits.of(REACH, np.array([True, True]))


def aim_at(goal):
    return Aim(np.asarray(goal, float), np.ones(3), RIDGE)


def rest(model):
    return Iterate.at(model.at_displacement(np.zeros(2)))


def nearest(model, goal):
    """The nearest reachable point by SLSQP from several starts."""
    best = None
    for start in ([2.0, 2.0], [10.0, 10.0], [18.0, 18.0]):
        found = minimize(
            lambda d: ((tip(d) - goal) ** 2).sum(),
            start,
            method="SLSQP",
            bounds=REACH,
            constraints={"type": "ineq", "fun": lambda d: model.at_displacement(d).lambda_a},
            options={"maxiter": 500, "ftol": 1e-14},
        )
        if best is None or found.fun < best.fun:
            best = found
    return best.x


@pytest.mark.parametrize("where", [[3.0, 2.5], [12.0, 11.0], [19.0, 18.0], [0.5, 0.5]])
def test_reachable_goals_are_reached_from_rest(where):
    model = ArcRobot()
    found = search_goal(model, aim_at(tip(np.array(where))), PULLING, rest(model))
    assert found.status is SearchStatus.CONVERGED
    assert found.distance < 1e-5
    assert found.iterations <= 9


@pytest.mark.parametrize(
    "goal", [[0, 150.0, 60.0], [0, 60.0, -40.0], [40.0, 100.0, 20.0], [0, 170.0, 140.0], [0.0, -30.0, 10.0]]
)
def test_unreachable_goals_end_at_the_nearest_reachable_point(goal):
    model = ArcRobot()
    found = search_goal(model, aim_at(goal), PULLING, rest(model), SearchSettings(iterations=40))
    expected = nearest(model, np.array(goal))
    assert found.status is SearchStatus.CONVERGED
    assert np.linalg.norm(tip(found.delta_a) - goal) <= np.linalg.norm(tip(expected) - goal) + 1e-4
    np.testing.assert_allclose(found.delta_a, expected, atol=5e-3)
    assert (found.lambda_a > -1e-4).all()


def test_learned_curvature_saves_iterations_along_an_unreachable_arc():
    angles = np.linspace(0.2, 1.4, 30)
    goals = [np.array([0.0, 150 * np.sin(a) - 10, 120 - 150 * np.cos(a)]) for a in angles]
    counts = {}
    for keep in (True, False):
        model = ArcRobot()
        at, counts[keep] = rest(model), 0
        for goal in goals:
            found = search_goal(model, aim_at(goal), PULLING, at, SearchSettings(iterations=60))
            assert found.status is SearchStatus.CONVERGED
            counts[keep] += found.queries
            at = found.iterate if keep else Iterate.at(found.iterate.condensed)
    assert counts[True] < 0.8 * counts[False]
    assert counts[True] < 6 * len(goals)


def test_the_step_bound_holds_in_every_iteration():
    model = ArcRobot()
    visited = []
    original = model.at_displacement
    model.at_displacement = lambda d: (visited.append(np.array(d)), original(d))[1]
    at = rest(model)
    search_goal(model, aim_at(tip(np.array([15.0, 15.0]))), PULLING, at, SearchSettings(step=2.0))
    assert np.abs(np.diff(visited, axis=0)).max() <= 2.0 + 1e-9


def test_states_that_the_model_refuses_are_approached_and_not_entered():
    model = ArcRobot(limit=8.0)
    at = rest(model)
    found = search_goal(model, aim_at(tip(np.array([15.0, 15.0]))), PULLING, at, SearchSettings(iterations=60))
    assert np.abs(found.delta_a).max() <= 8.0
    assert found.status is SearchStatus.NO_DESCENT
    assert found.queries == model.queries - 1  # those that it refused as well


def test_one_iteration_is_one_inverse_step():
    model = ArcRobot()
    found = search_goal(model, aim_at(tip(np.array([3.0, 3.0]))), PULLING, rest(model), SearchSettings(iterations=1))
    assert (found.iterations, found.queries) == (1, 1)
    assert found.status is SearchStatus.ITERATIONS


def test_powell_update_meets_the_secant_condition_and_stays_symmetric():
    model = ArcRobot()
    at = rest(model)
    for delta in ([2.0, 1.0], [3.0, 3.0], [5.0, 4.0]):
        before, to = at.condensed, model.at_displacement(np.array(delta))
        at = at.moved(to)
        s = to.delta_a - before.delta_a
        np.testing.assert_allclose(at.hessian @ s, to.effector_jacobian - before.effector_jacobian, atol=1e-9)
        np.testing.assert_allclose(at.hessian, at.hessian.swapaxes(1, 2), atol=1e-12)


class Slipping:
    """One spring of 1 N/mm: its place, and what a grip has left, which falls where the place is beyond 2 mm."""

    rows = Rows(("place", "grip"), ("pull",))

    def at_displacement(self, delta_a):
        a = float(np.asarray(delta_a)[0])
        J = np.array([[1.0], [-0.1]])
        W = np.block([[J @ J.T, J], [J.T, np.eye(1)]])
        delta = np.array([a, 1 - 0.1 * a - 5 * (a > 2), a])
        return Condensed(self.rows, W, delta - W[:, 2] * a, np.array([a]))


def test_a_bound_that_no_step_has_met_yet_is_not_given_up_for_the_goal():
    """The linearisation does not see the slip, so that the bound has no price."""
    model = Slipping()
    limits = Limits(
        np.array([[-np.inf, np.inf]]), np.array([[-10.0, 10.0]]), np.array([[-np.inf, np.inf], [0, np.inf]])
    )
    aim = Aim(np.array([3.0, 0.0]), np.array([1.0, 0.0]), np.full(1, 1e-6))
    found = search_goal(
        model, aim, limits, Iterate.at(model.at_displacement(np.zeros(1))), SearchSettings(cautious=True)
    )
    assert 1.9 < found.delta_a[0] <= 2.0 and found.delta_e[1] > 0


def test_the_least_penalty_is_what_the_steepest_bounded_row_is_worth():
    """Of a linear robot: UNMET times what is missed, over the largest slope of a row that has a bound."""
    condensed, aim = LinearRobot().at_displacement(np.zeros(2)), Aim(np.array([3.0, 4.0]), np.ones(2), np.zeros(2))
    slope = np.abs(W_EA @ np.linalg.inv(W_AA))
    for bounds, rows in (([[-1, np.inf], [-np.inf, np.inf]], [0]), ([[-1, 1], [-np.inf, 9]], [0, 1])):
        limits = Limits(np.zeros((2, 2)), np.zeros((2, 2)), np.array(bounds, float))
        assert _least_penalty(condensed, aim, limits) == pytest.approx(UNMET * 5.0 / slope[rows].max())
    free = np.array([[-np.inf, np.inf]] * 2)
    assert _least_penalty(condensed, aim, Limits(np.zeros((2, 2)), np.zeros((2, 2)), free)) == 0.0
    assert _least_penalty(condensed, aim, Limits(np.zeros((2, 2)), np.zeros((2, 2)))) == 0.0
