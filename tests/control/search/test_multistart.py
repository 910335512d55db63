"""A search that friction has stopped goes on from places around."""

import numpy as np
import pytest

from cfem.condensed import Condensed, Rows
from cfem.control.search.goal_search import Iterate, SearchSettings, by_displacement, search_goal
from cfem.control.search.inverse import Aim, Limits
from cfem.control.search.multistart import FEW, _directions, all_over, around, multistart
from cfem.core.errors import NumericalError

ROWS = Rows(("e.x", "e.y"), ("left", "right"))
LIMITS = Limits(np.tile([-np.inf, np.inf], (2, 1)), np.tile([0.0, 10.0], (2, 1)))


class Held:
    """Its second row rises with the second actuator, but falls from 4 to 4.15 as if something held the robot there."""

    rows = ROWS

    def __init__(self, hole=None):
        self.asked, self.hole = 0, hole

    def at_displacement(self, u):
        self.asked += 1
        if self.hole is not None and u[1] < self.hole:
            raise NumericalError("no state")
        if u[1] > 4.15:
            value, slope = 1.0 + u[1] - 4.15, 1.0
        elif u[1] > 4.0:
            value, slope = 1.0 + 4.15 - u[1], -1.0
        else:
            value, slope = 1.15 + 2.0 * (u[1] - 4.0), 2.0
        J = np.array([[1.0, 0.0], [0.0, slope]])
        W = np.block([[J @ J.T, J], [J.T, np.eye(2)]])
        delta = np.array([u[0], value, *u])
        return Condensed(self.rows, W, delta - W[:, 2:] @ u, np.asarray(u, float))


def searched(model, goal, start):
    aim = Aim(np.asarray(goal, float), np.ones(2), np.full(2, 1e-6))
    settings = SearchSettings(tolerance=1e-9)
    first = search_goal(model, aim, LIMITS, Iterate.at(model.at_displacement(np.asarray(start, float))), settings)
    return first, multistart(model, aim, LIMITS, first, settings, by_displacement, around(first, LIMITS))


def test_what_is_held_is_passed():
    first, found = searched(Held(), [2.0, 0.95], [2.0, 4.3])
    assert first.delta_a[1] == pytest.approx(4.15, abs=0.01) and first.delta_e[1] > 0.99
    np.testing.assert_allclose(found.delta_a, [2.0, 3.9], atol=1e-6)
    assert found.iterations > first.iterations and found.queries > first.queries


def test_a_goal_that_was_met_costs_nothing_more():
    model = Held()
    first, found = searched(model, [2.0, 2.0], [2.0, 4.5])
    asked = model.asked
    assert found is first
    aim, starts = Aim(first.delta_e, np.ones(2), np.zeros(2)), around(first, LIMITS)
    assert multistart(model, aim, LIMITS, first, SearchSettings(), by_displacement, starts) is first
    assert model.asked == asked


def test_starts_are_not_computed_for_a_goal_that_was_met():
    first, _ = searched(Held(), [2.0, 2.0], [2.0, 4.5])

    def starts():
        raise AssertionError("asked for a start")
        yield

    assert multistart(Held(), first.aim, LIMITS, first, SearchSettings(), by_displacement, starts()) is first


def test_starts_all_over_lie_within_the_course_and_differ():
    starts = np.array(list(all_over(Held(), LIMITS, 8)))
    assert starts.shape == (8, 2) and len(np.unique(starts, axis=0)) == 8
    assert (starts > 0.0).all() and (starts < 10.0).all()
    assert not list(all_over(Held(), Limits(LIMITS.lambda_a, LIMITS.lambda_a), 8))


def test_the_first_answer_stays_where_none_is_better():
    first, found = searched(Held(hole=4.0), [2.0, 0.95], [2.0, 4.3])
    np.testing.assert_array_equal(found.delta_a, first.delta_a)


class Learned(Held):
    """Knows the states below 4, where it was trained."""

    trained = np.array([[1.0, 3.0], [2.0, 12.0]])

    def inside(self, condensed):
        return bool(condensed.delta_a[1] < 4.0)

    def distance(self, condensed):
        return max(0.0, condensed.delta_a[1] - 4.0)


def test_an_answer_beside_what_the_model_knows_gives_way_to_another_that_reaches_the_goal():
    """The goal is met at 4.15 + 0.08 and at 3.9653."""
    model, aim = Learned(), Aim(np.array([2.0, 1.08]), np.ones(2), np.full(2, 1e-6))
    settings = SearchSettings(tolerance=1e-9)
    first = search_goal(model, aim, LIMITS, Iterate.at(model.at_displacement(np.array([2.0, 4.3]))), settings)
    assert first.delta_a[1] == pytest.approx(4.23, abs=1e-4)
    best = multistart(model, aim, LIMITS, first, settings, by_displacement, all_over(model, LIMITS, 8))
    assert best.delta_a[1] == pytest.approx(3.965, abs=1e-4)


def test_where_nothing_that_the_model_knows_reaches_the_goal_the_answer_beside_it_stays():
    model, aim = Learned(), Aim(np.array([2.0, 3.0]), np.ones(2), np.full(2, 1e-6))
    settings = SearchSettings(tolerance=1e-9)
    first = search_goal(model, aim, LIMITS, Iterate.at(model.at_displacement(np.array([2.0, 4.3]))), settings)
    best = multistart(model, aim, LIMITS, first, settings, by_displacement, all_over(model, LIMITS, 8))
    np.testing.assert_array_equal(best.delta_a, first.delta_a)


def test_an_answer_that_the_model_knows_does_not_give_way_to_one_beside_it():
    """The search ended at 3.95. All that begins around it ends at 4.65, where the goal is met, and the model knows
    nothing."""
    model, settings = Learned(), SearchSettings(tolerance=1e-9)
    near, aim = (Aim(np.array([2.0, value]), np.ones(2), np.full(2, 1e-6)) for value in (1.05, 1.5))
    first = search_goal(model, near, LIMITS, Iterate.at(model.at_displacement(np.array([2.0, 3.0]))), settings)
    beside = search_goal(model, aim, LIMITS, Iterate.at(model.at_displacement(np.array([2.0, 4.2]))), settings)
    assert first.delta_a[1] == pytest.approx(3.95, abs=1e-4) and beside.delta_a[1] == pytest.approx(4.65, abs=1e-4)
    best = multistart(model, aim, LIMITS, first, settings, by_displacement, around(first, LIMITS))
    np.testing.assert_array_equal(best.delta_a, first.delta_a)


def test_starts_are_states_that_the_model_was_trained_on_within_the_course():
    np.testing.assert_array_equal(list(all_over(Learned(), LIMITS, 8)), [[1.0, 3.0], [2.0, 10.0]])


def test_steps_aside_are_all_of_few_actuators_and_of_each_of_many():
    for n in (1, 2, FEW):
        found = {tuple(one) for one in _directions(n)}
        assert len(found) == len(_directions(n)) == 3**n - 1 and {abs(sign) for one in found for sign in one} <= {0, 1}
    found = np.array(_directions(FEW + 1))
    assert found.shape == (2 * (FEW + 1), FEW + 1)
    assert {tuple(one) for one in found} == {(*-one,) for one in found} and (np.abs(found).sum(axis=1) == 1).all()
