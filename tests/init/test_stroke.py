"""The stroke found by solving ends where the body is bent or strained to its limit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.blocks import bar

from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.solve import solve
from cfem.init import stroke
from cfem.init.stroke import strokes


@pytest.fixture(scope="module")
def found():
    robot = bar("tet4", divisions=(12, 2, 2))
    return robot, strokes(robot)


def test_at_its_stroke_an_actuator_is_at_a_limit(found):
    robot, each = found
    assert len(each) == 2 and all(one.force > 0 for one in each)
    problem = Problem(robot)
    target = Actuation(np.eye(2)[[0]], np.array([each[0].reach]), np.zeros(2))
    ended = solve(problem, target, condense=False, slack=False)
    tip = robot.X[:, 0] > 54
    X, x = robot.X[tip], ended.state.x[tip]
    turn = Rotation.align_vectors(x - x.mean(axis=0), X - X.mean(axis=0))[0].magnitude()
    at = problem.evaluate(ended.state.x, ended.state.pressure, 1.0)
    strain = stroke.Strain(8.0).value(problem, at)
    assert max(turn / (np.pi / 2), strain / 0.5) == pytest.approx(1, abs=0.1)
    assert ended.state.lam[0] == pytest.approx(each[0].force, rel=0.1)


def test_the_limit_is_said(found):
    assert {one.why for one in found[1]} <= {"turns the tip by 90 degrees", "strained by 50 %"}


def test_a_lower_limit_ends_the_stroke_earlier(found, monkeypatch):
    monkeypatch.setattr(stroke, "STRAIN", 0.02)
    (first,) = strokes(bar("tet4", divisions=(12, 2, 2), cables=1))
    assert first.reach < 0.6 * found[1][0].reach and first.why == "strained by 2 %"


def test_a_failing_solve_ends_the_stroke(found, monkeypatch):
    true = stroke.solve

    def fails(problem, actuation, *rest, **how):
        ended = true(problem, actuation, *rest, **how)
        far = actuation.target[0] > 1.0
        return replace(ended, status=stroke.Status.LIMIT_POINT) if far else ended

    monkeypatch.setattr(stroke, "solve", fails)
    (first,) = strokes(bar("tet4", divisions=(12, 2, 2), cables=1))
    assert 0.3 < first.reach < 1.0 and first.why == "beyond it, a limit point"
