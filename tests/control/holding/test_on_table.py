"""Holds from which an object comes to stand at its place, of robots that put it down as a rule says."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.linear_robot import LinearRobot

from cfem.control.holding import on_table
from cfem.control.holding.on_table import ALIKE, NEAR, ROUNDS, opening, put_down
from cfem.control.search.goal_search import Iterate, SearchResult, SearchSettings, SearchStatus
from cfem.control.search.inverse import Aim, Limits
from cfem.control.search.optimality import Verdict
from cfem.core.errors import NumericalError

START = Iterate.at(LinearRobot().at_displacement(np.zeros(2)))
STAND = np.array([[1.1, 0.2], [-0.3, 0.9]])  # where the object stands, as its hold is
SLID = np.array([0.4, -0.3])
GOAL = np.array([3.0, 2.0, 5.0, 0.1, 0.2, 0.3, 7.0])


def holds(monkeypatch, stands, oriented=True, up=2, misses=0.5):
    """A model whose robots hold an object exactly where they should, at a height of `misses` by which they miss it at
    first; stands: the place of the object (n,) as it is held. The searches (goal, weights, iterate) that are asked."""
    asked, n_o = [], 6 if oriented else 3
    model = SimpleNamespace(of_object=SimpleNamespace(n_e=n_o), upwards=up, begun=0, before=None)

    def begin_search():
        model.begun += 1

    def search(of, aim, limits, iterate, settings):
        assert of is model
        asked.append((aim.goal.copy(), aim.weights.copy(), iterate))
        held = np.where(aim.weights > 0, aim.goal, 0.0)
        held[up] = aim.goal[up] + misses
        now = Iterate.at(LinearRobot().at_displacement(np.full(2, float(len(asked)))))
        return SearchResult(
            np.full(2, float(len(asked))), np.zeros(2), held, 0.0, SearchStatus.CONVERGED, 3, 5, False, 1e-9, 0.25, now,
            aim, limits,
        )  # fmt: skip

    def let_go(delta_a, lower):
        np.testing.assert_allclose(lower, -delta_a)
        goal = asked[-1][0].copy()
        goal[up] += misses
        now = SimpleNamespace(
            delta_a=np.zeros(2), lambda_a=np.zeros(2), delta_e=stands(len(asked), goal), rows=START.condensed.rows
        )
        return now, f"stands {len(asked)}"

    model.begin_search, model.let_go = begin_search, let_go
    monkeypatch.setattr(on_table, "search_goal", search)
    monkeypatch.setattr(on_table, "opening", lambda slopes, steered, begin, *rest: -begin)
    return model, asked


def aim(oriented=True):
    """Rows of the object, and the margin of a grip."""
    rows = [0, 1, 2, 3, 4, 5, 6] if oriented else [0, 1, 2, 6]
    return Aim(GOAL[rows], np.array([1.0, 1.0, 1.0, 9.0, 8.0, 7.0, 2.0])[rows], np.ones(2))


def put(model, about):
    limits = Limits(np.tile([-1.0, 1.0], (2, 1)), np.tile([-1.0, 1.0], (2, 1)))
    return put_down(model, about, limits, START, SearchSettings())


def linear(number, held):
    """Stands where a linear law says; the table sets its height and tilt, and the grip has nothing left."""
    place = held.copy()
    place[:2] = STAND @ held[:2] + SLID
    return np.where(np.arange(len(held)) == len(held) - 1, GOAL[-1], place)


def test_a_linear_law_of_the_place_is_learned_in_four_misses(monkeypatch):
    """Broyden's method ends after 2 n steps (Gay, SIAM J. Numer. Anal. 16, 1979): here after four misses."""

    def settles(number, held):
        place = linear(number, held)
        place[2:6] = GOAL[2:6]
        return place

    model, asked = holds(monkeypatch, settles)
    about = aim()
    found = put(model, about)
    assert len(asked) == model.begun == 5
    missed = [np.linalg.norm(STAND @ goal[:2] + SLID - GOAL[:2]) for goal, *_ in asked]
    assert missed[-1] <= NEAR < missed[-2] and missed[0] == pytest.approx(
        np.linalg.norm(STAND @ GOAL[:2] + SLID - GOAL[:2])
    )
    np.testing.assert_allclose(
        asked[1][0][:2], GOAL[:2] - (STAND @ GOAL[:2] + SLID - GOAL[:2])
    )  # as if it did not slide
    assert (found.iterations, found.queries, found.seconds) == (15, 25, 1.25)
    np.testing.assert_allclose(found.via, [np.full(2, 5.0), np.full(2, -5.0)])
    assert found.aim is about and not found.delta_a.any() and model.before == "stands 5"
    np.testing.assert_array_equal(about.goal, GOAL)  # the caller's own


@pytest.mark.parametrize("up", [0, 2])
def test_height_and_tilt_are_the_table_s_and_later_holds_keep_the_first_s_height(monkeypatch, up):
    model, asked = holds(monkeypatch, linear if up == 2 else lambda n, held: held + 1.0, up=up)
    put(model, aim())
    first, later = asked[0][1], asked[1:]
    free = np.isin(np.arange(7), [up, *(3 + axis for axis in range(3) if axis != up)])
    np.testing.assert_array_equal(first, np.where(free, 0.0, aim().weights))
    for goal, weights, _ in later:
        assert weights[up] == ALIKE and goal[up] == pytest.approx(GOAL[up] + 0.5)
        np.testing.assert_array_equal(np.delete(weights, up), np.delete(first, up))
    np.testing.assert_allclose(later[0][2].condensed.delta_a, np.ones(2))  # goes on where the last search ended


def test_without_orientation_the_height_alone_is_free(monkeypatch):
    model, asked = holds(monkeypatch, linear, oriented=False)
    put(model, aim(oriented=False))
    np.testing.assert_array_equal(asked[0][1], [1.0, 1.0, 0.0, 2.0])


def test_the_best_hold_counts_where_none_is_near(monkeypatch):
    wrong = [5.0, 3.0, 0.5, 4.0, 6.0, 7.0, 8.0, 9.0]
    model, asked = holds(monkeypatch, lambda number, held: GOAL + [wrong[number - 1], *np.zeros(6)])
    found = put(model, aim())
    assert len(asked) == ROUNDS and found.distance == pytest.approx(0.5)
    np.testing.assert_allclose(found.via, [np.full(2, 3.0), np.full(2, -3.0)])
    assert model.before == "stands 3"
    assert found.status is SearchStatus.TRIED and found.verdict(reached=False) is Verdict.NOT_CONVERGED


def test_a_hold_that_cannot_be_let_go_is_tried_half_the_way_back(monkeypatch):
    def stands(number, held):
        if number == 2:
            raise NumericalError("slides off")
        return GOAL + [4.0, *np.zeros(6)] if number == 1 else GOAL

    model, asked = holds(monkeypatch, stands)
    found = put(model, aim())
    assert len(asked) == 3 and found.distance == 0.0
    first, lost, again = (goal[:2] for goal, *_ in asked)
    np.testing.assert_allclose(lost, first - [4.0, 0.0])
    np.testing.assert_allclose(again, (first + lost) / 2)


def test_robots_that_cannot_let_go_at_all_say_so(monkeypatch):
    def never(number, held):
        raise NumericalError("slides off")

    model, asked = holds(monkeypatch, never)
    with pytest.raises(NumericalError, match="slides off"):
        put(model, aim())
    assert len(asked) == 1


def opened(J, begin, scale=1.0, course=(0.0, np.inf)):
    J = np.array([*J, [9.0] * len(begin)], float)  # the last row is not steered
    return opening(J, np.arange(len(J) - 1), np.array(begin), np.tile(course, (len(begin), 1)), scale)


def test_robots_open_so_that_what_is_steered_stays_until_the_first_actuator_is_at_rest():
    J, begin = np.array([[1.0, -1.0, 0.2, 0.0], [0.3, 0.4, -1.0, 0.1]]), np.array([2.0, 1.8, 1.1, 0.9])
    lower = opened(J, begin)
    np.testing.assert_allclose(J @ (begin - lower), 0.0, atol=1e-12)
    assert lower.min() == pytest.approx(0.0, abs=1e-12) and (lower < begin).all()
    others = np.linalg.svd(J)[2][2:]  # ways that leave it alone: none is nearer to the straight one to rest
    share = (lower - begin) @ -begin / float((lower - begin) @ (lower - begin))
    np.testing.assert_allclose(others @ (share * (lower - begin) + begin), 0.0, atol=1e-12)


def test_robots_open_straight_to_rest_where_that_steers_nothing():
    np.testing.assert_allclose(opened([[1.0, -2.0]], [2.0, 1.0]), 0.0, atol=1e-12)


def test_actuators_count_by_their_strokes_and_keep_their_course():
    """In shares of their strokes the way is the same, whatever their units; one that would go on is stopped."""
    J, begin, scale = (
        np.array([[1.0, -1.0, 0.2], [0.1, 0.7, -1.0]]),
        np.array([2.0, 1.8, 1.1]),
        np.array([1.0, 10.0, 3.0]),
    )
    np.testing.assert_allclose(opened(J / scale, begin * scale, scale) / scale, opened(J, begin), atol=1e-12)
    np.testing.assert_allclose(opened([[1.0, 1.0]], [2.0, 0.1], course=(0.0, 1.04)), [1.04, 1.04])
