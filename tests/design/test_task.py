"""Design and control together, against designs whose answer is known."""

import numpy as np
import pytest
from parametric.synthetic import Arc

from cfem.core.errors import NumericalError
from cfem.design.task import Task, serve

TRUTH = np.array([46.0, 0.45, 3.0])
REFERENCE = np.array([40.0, 0.45, 3.0])
PULLS = np.array([[3.0], [8.0], [14.0]])
WHOLE, NONE = np.ones(3), np.zeros((3, 3))


def places(p=TRUTH):
    return Arc().at("displacement", PULLS, np.tile(p, (3, 1)))


def test_a_design_that_can_reach_all_goals_is_found_with_its_control():
    task = Task(places().x_e, False, WHOLE, NONE)
    found = serve(Arc(), task, [0], REFERENCE)
    assert found.p[0] == pytest.approx(46.0, abs=1e-6) and found.u == pytest.approx(PULLS, abs=1e-5)
    assert found.distance.max() < 1e-6
    fixed = serve(Arc(), task, [], REFERENCE)
    assert np.array_equal(fixed.p, REFERENCE) and fixed.distance.min() > 1


def test_goals_from_rest_do_not_ask_for_the_designs_own_length():
    task = Task(places().delta_e, True, WHOLE, NONE)
    assert serve(Arc(), task, [0], REFERENCE).p[0] == pytest.approx(46.0, abs=1e-5)


def test_rows_without_weight_do_not_matter():
    goals = places().x_e + [5.0, 0.0, 0.0]
    found = serve(Arc(), Task(goals, False, np.array([0.0, 1.0, 1.0]), NONE), [0], REFERENCE)
    assert found.p[0] == pytest.approx(46.0, abs=1e-5) and found.distance.max() < 1e-5


def test_a_force_moves_the_tip_by_the_locked_compliance():
    force = np.tile([0.0, 0.3, 0.0], (3, 1))
    states = places()
    goals = states.x_e + np.einsum("mij,mj->mi", states.locked_compliance, force)
    found = serve(Arc(), Task(goals, False, WHOLE, force), [0], REFERENCE)
    assert found.p[0] == pytest.approx(46.0, abs=1e-5) and found.u == pytest.approx(PULLS, abs=1e-4)


def test_no_answer_is_an_error():
    with pytest.raises(NumericalError, match="the co-design failed from every start"):
        serve(Arc(limit=1e-3), Task(places().x_e, False, WHOLE, NONE), [0], REFERENCE)
