"""Objectives over a workspace, at a place and over scattered parameters, on robots in closed form."""

import numpy as np
import pytest
from design.problems import finger, plain

from cfem.condensed import Rows
from cfem.design.problem import DesignProblem
from cfem.design.workspace import (
    Force,
    Manipulability,
    OfBody,
    Robust,
    Stiffness,
    WorkspaceMeasure,
    actuation_grid,
    normal_offsets,
    simplices,
)
from cfem.parametric.states import States

ROWS = {n: Rows(("tip.x", "tip.y", "tip.z"), tuple(f"a{i}" for i in range(n))) for n in (1, 2, 3)}
E = np.arange(3)


def moved(x_e, n, W=None):
    """States whose effectors are at x_e (m, 3)."""
    m = len(x_e)
    W = np.tile(np.eye(3 + n), (m, 1, 1)) if W is None else W
    free = np.hstack([x_e, np.zeros((m, n))])
    return States(ROWS[n], W, free, np.zeros((m, n)), np.zeros((m, 1)), np.zeros((m, 3)))


@pytest.mark.parametrize("n, expected", [(1, 2.0), (2, 6.0), (3, 24.0)])
def test_reach_of_an_affine_robot_is_that_of_its_box(n, expected):
    """u in [0, 1]^n goes to (2 u1, 3 u2, 4 u3), turned."""
    at = actuation_grid(np.tile([0.0, 1.0], (n, 1)), 4)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    x = (at * [2.0, 3.0, 4.0][:n]) @ turn[:n]
    both = moved(np.concatenate([x, 2 * x]), n)
    np.testing.assert_allclose(WorkspaceMeasure(E, at, 4)(both), [-expected, -(2**n) * expected], rtol=1e-12)


def test_reach_of_a_curve_comes_to_its_length():
    at = actuation_grid(np.array([[0.0, np.pi]]), 200)
    x = np.hstack([np.cos(at), np.sin(at), 0 * at])
    assert WorkspaceMeasure(E, at, 200)(moved(x, 1))[0] == pytest.approx(-np.pi, rel=1e-4)


def test_simplices_fill_their_cells():
    for n in (1, 2, 3):
        at, cut = actuation_grid(np.tile([0.0, 1.0], (n, 1)), 3), simplices(3, n)
        edges = at[cut[:, 1:]] - at[cut[:, :1]]
        assert np.abs(np.linalg.det(edges)).sum() / np.prod(range(1, n + 1)) == pytest.approx(1.0)


def test_manipulability_is_the_smallest_gain():
    """W_ea W_aa^-1 = diag(2, 0.5) for two actuators, in half of the states twice that."""
    W = np.tile(np.eye(5), (4, 1, 1))
    W[:, 0, 3] = W[:, 3, 0] = [2.0, 2.0, 4.0, 4.0]
    W[:, 1, 4] = W[:, 4, 1] = [0.5, 0.5, 1.0, 1.0]
    states = moved(np.zeros((4, 3)), 2, W)
    two = Manipulability(E, np.zeros((2, 2)))
    np.testing.assert_allclose(two(states), [-0.5, -1.0], rtol=1e-12)


def test_stiffness_and_force_hold_the_actuators():
    W = np.zeros((2, 4, 4))
    W[:, 3, 3] = 2.0
    W[:, :3, :3] = np.diag([1.0, 2.0, 3.0])
    W[:, 0, 3] = W[:, 3, 0] = 1.0  # locked: 1 - 1/2
    x = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    states = moved(x, 1, W)
    np.testing.assert_allclose(Stiffness(E, np.array([1.0, 0, 0]))(states), [-2.0, -2.0])
    assert Stiffness(E, np.array([0, 0, 1.0]), np.zeros((2, 1)))(states) == pytest.approx(-1 / 3)
    push = Force(E, np.array([1.0, 0, 0]), np.zeros(3))
    np.testing.assert_allclose(push(states), [-2.0, -4.0])  # what returns to its place is what it pushes


def test_an_objective_over_actuations_has_states_of_its_own_for_each_design():
    seen = []

    class Arm:
        def __init__(self):
            self.plain = plain()

        def __getattr__(self, name):
            return getattr(self.plain.family, name)

        def at(self, kind, u, p):
            seen.append((kind, np.array(u), np.array(p)))
            return self.plain.family.at(kind, u, p)

    at = np.array([[1.0], [2.0], [3.0]])
    asked = Stiffness(E, np.array([1.0, 0, 0]), at)
    problem = DesignProblem(Arm(), "displacement", np.zeros(1), [0, 1], np.array([0.5, 0.5]), {"stiff": asked})
    found = problem(np.array([[0.2, 0.3], [0.4, 0.5]]))
    assert found.objectives.shape == (2, 1) and problem.evaluations == 2
    kind, u, p = seen[-1]
    assert kind == "displacement" and u[:, 0].tolist() == [1, 2, 3, 1, 2, 3]
    np.testing.assert_allclose(p[:, 0], [0.2] * 3 + [0.4] * 3)


def test_robust_statistics_are_those_of_a_normal_scatter():
    """f = x: mean x, 95 % quantile x + 1.645 s; and the scatter stays within the ranges."""
    offsets = normal_offsets(np.array([0.05, 0.0]), 2000)
    assert (offsets[:, 1] == 0).all() and offsets[:, 0].std() == pytest.approx(0.05, rel=0.01)
    low, high = np.zeros(2), np.ones(2)

    def value(states):
        return states.p[:, 0]

    found = {
        share: DesignProblem(
            plain().family,
            "displacement",
            np.zeros(1),
            [0, 1],
            np.array([0.5, 0.5]),
            {"it": Robust(value, offsets, low, high, share, offsets[0])},
        )(np.array([[0.5, 0.2], [1.0, 0.2]])).objectives[:, 0]
        for share in (None, 0.95)
    }
    assert found[None][0] == pytest.approx(0.5, abs=1e-3)
    assert found[0.95][0] == pytest.approx(0.5 + 1.645 * 0.05, abs=2e-3)
    assert found[0.95][1] == 1.0


def test_a_robust_number_may_be_one_over_actuations():
    at = np.array([[1.0], [2.0]])
    robust = Robust(
        Stiffness(E, np.array([1.0, 0, 0]), at),
        normal_offsets(np.array([0.1, 0.1]), 16),
        *np.eye(2) * 0 + [[0], [1]],
        None,
        np.array([0.1, 0.1]),
    )
    problem = DesignProblem(plain().family, "displacement", np.zeros(1), [0, 1], np.array([0.5, 0.5]), {"it": robust})
    assert problem(np.array([[0.5, 0.5]])).objectives == pytest.approx(-1.0)


def test_slopes_of_the_learned_kind_see_all_of_them():
    asked = {"stiff": Stiffness(E, np.array([0, 1.0, 0]), np.array([[5.0], [10.0]]))}
    problem = finger(**asked)
    z = np.array([0.4, 0.6])
    values, slopes = problem.with_slopes(z)
    h = 1e-4
    plain_slopes = [
        (np.hstack(problem((z + h * e)[None])) - np.hstack(problem((z - h * e)[None])))[0] / (2 * h) for e in np.eye(2)
    ]
    np.testing.assert_allclose(slopes, np.array(plain_slopes).T, rtol=1e-5, atol=1e-7)
    assert values[-1] < 0


def test_a_number_of_the_body_is_taken_as_it_is():
    states = moved(np.zeros((2, 3)), 1)
    states = States(
        *(getattr(states, name) for name in ("rows", "W", "delta_free", "lam", "p", "rest_e")),
        {"mass": np.array([1.0, 2.0])},
    )
    np.testing.assert_allclose(OfBody("mass")(states), [1.0, 2.0])
