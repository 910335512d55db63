"""Best designs and fronts, against those known in closed form and against brute force."""

import numpy as np
import pytest
from design.problems import finger, plain

from cfem.core.errors import NumericalError
from cfem.design.optimisers.front import best_of_each, hypervolume, non_dominated, pareto_front
from cfem.design.optimisers.search import Scalar, best, evaluate_grid, evaluate_scattered


def bowl(p):
    return (p[:, 0] - 0.37) ** 2 + 2 * (p[:, 1] - 0.61) ** 2


def test_a_smooth_minimum_is_found_between_the_points_of_the_grid():
    problem = plain(bowl=bowl)
    grid = evaluate_grid(problem, (5, 4))
    found = best(problem, grid, Scalar.weighted([1.0]))
    assert problem.p(found.z) == pytest.approx([0.37, 0.61], abs=1e-6) and found.objectives[0] < 1e-11
    assert len(grid.z) == 20 and grid.scores.objectives[:, 0].min() > 1e-3


def test_a_constraint_holds_at_the_best():
    problem = plain({"line": lambda p: 0.8 - p[:, 0] - p[:, 1]}, bowl=bowl)
    grid = evaluate_grid(problem, (6, 6))
    found = best(problem, grid, Scalar.weighted([1.0]))
    # the nearest point of the line, in the bowl's metric: Lagrange's conditions by hand
    mu = 2 * (0.37 + 0.61 - 0.8) / 1.5
    assert found.z == pytest.approx([0.37 - mu / 2, 0.61 - mu / 4], abs=1e-6)
    assert found.constraints[0] == pytest.approx(0, abs=1e-7)


def test_constraints_that_no_design_keeps_are_named():
    problem = plain({"never": lambda p: p[:, 0] - 2}, bowl=bowl)
    with pytest.raises(NumericalError, match="never"):
        evaluate_grid(problem, (3, 3))


def test_the_best_of_many_valleys_comes_from_the_best_starts():
    problem = plain(waves=lambda p: np.cos(9 * p[:, 0]) * np.cos(7 * p[:, 1]) + 0.3 * p.sum(axis=1))
    grid = evaluate_grid(problem, (9, 9))
    found = best(problem, grid, Scalar.weighted([1.0]), starts=4)
    fine = evaluate_grid(problem, (201, 201)).scores.objectives[:, 0].min()
    assert fine - 1e-3 < found.value * grid.width[0] + grid.low[0] <= fine + 1e-9


def test_gradients_do_no_worse_than_the_grid_for_the_finger():
    problem = finger()
    grid = evaluate_grid(problem, (8, 8))
    for index, found in enumerate(best_of_each(problem, grid, 3)):
        fine = evaluate_grid(problem, (81, 81)).scores.objectives[:, index].min()
        assert found.objectives[index] <= fine + 1e-9


# f1 = x, f2 = h(x) + 4 (y - 1/2)^2: the front is y = 1/2, f2 = h(f1)
FRONTS = {"convex": lambda x: (1 - np.sqrt(x)) ** 2, "concave": lambda x: 1 - x**2}


@pytest.mark.parametrize("shape", FRONTS)
def test_fronts_known_in_closed_form_are_covered_whether_convex_or_not(shape):
    curve = FRONTS[shape]
    problem = plain(first=lambda p: p[:, 0], second=lambda p: curve(np.abs(p[:, 0])) + 4 * (p[:, 1] - 0.5) ** 2)
    grid = evaluate_grid(problem, (10, 9))
    front = pareto_front(problem, grid, ("first", "second"), 15, best_of_each(problem, grid, 3))
    points = np.array([one.objectives for one in front.designs])
    assert len(points) >= 15 and front.beaten == 0
    assert points[:, 1] == pytest.approx(curve(points[:, 0]), abs=1e-4)
    assert np.diff(points[:, 0]).max() < 0.2
    assert front.volume >= front.grid_volume - 1e-9 and front.corners["first"] == 0


def test_the_fingers_front_is_better_than_six_hundred_designs_of_a_grid():
    problem = finger(stiff=lambda states: states.lam[:, 0])
    grid = evaluate_grid(problem, (25, 24))
    ends = best_of_each(problem, grid, 3)
    front = pareto_front(problem, grid, ("strength", "stiff"), 15, [ends[1], ends[2]])
    assert front.beaten == 0 and front.volume >= front.grid_volume - 1e-9
    assert non_dominated(np.array([one.objectives[1:] for one in front.designs])).all()


def test_three_objectives_have_a_front_as_well():
    problem = plain(
        a=lambda p: ((p - [0.1, 0.1]) ** 2).sum(axis=1),
        b=lambda p: ((p - [0.9, 0.1]) ** 2).sum(axis=1),
        c=lambda p: ((p - [0.5, 0.9]) ** 2).sum(axis=1),
    )
    grid = evaluate_grid(problem, (9, 9))
    front = pareto_front(problem, grid, ("a", "b", "c"), 10, best_of_each(problem, grid, 2))
    z = np.array([one.z for one in front.designs])
    # the front is the triangle between the three minima
    inside = np.array([[0.8, 0.4], [0.0, 0.8]])
    shares = np.linalg.solve(inside, (z - 0.1).T)
    assert len(z) >= 10 and front.beaten == 0
    assert 0.7 < front.volume < front.grid_volume  # which has all of the grid's better designs
    assert shares.min() > -1e-4 and shares.sum(axis=0).max() < 1 + 1e-4


def test_hypervolume_of_steps():
    assert hypervolume(np.array([[0.0, 0.5], [0.5, 0.0], [0.7, 0.7], [2.0, -1.0]])) == pytest.approx(0.75)
    assert hypervolume(np.array([[1.0, 0.0]])) == 0.0


def test_hypervolume_of_three_objectives_is_the_share_of_points_that_are_beaten():
    rng = np.random.default_rng(0)
    hat = rng.random((20, 3)) ** 0.5
    points = rng.random((200_000, 3))
    beaten = np.zeros(len(points), dtype=bool)
    for one in hat:
        beaten |= (one <= points).all(axis=1)
    assert hypervolume(hat) == pytest.approx(beaten.mean(), abs=3e-3)
    assert hypervolume(np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0.5]])) == pytest.approx(0.125)


def test_scattered_designs_serve_as_a_grid_does():
    problem = plain(f=lambda p: (p[:, 0] - 0.3) ** 2 + (p[:, 1] - 0.8) ** 2)
    grid = evaluate_scattered(problem, 100)
    assert len(grid.z) == 100 and grid.shape == () and (grid.z[0] == 0.5).all()
    found = best(problem, grid, Scalar.weighted(np.ones(1)))
    np.testing.assert_allclose(found.z, [0.3, 0.8], atol=1e-4)


def test_of_equal_rows_both_stay():
    assert non_dominated(np.array([[0.0, 1], [0, 1], [1, 1], [1, 0]])).tolist() == [True, True, False, True]


def test_a_front_in_two_pieces_says_where_it_jumps():
    """second = y (1 - 0.3 x) + (1 - y) (1.35 - x): y = 1 is better for x < 1/2, y = 0 beyond."""
    problem = plain(
        first=lambda p: p[:, 0],
        second=lambda p: p[:, 1] * (1 - 0.3 * p[:, 0]) + (1 - p[:, 1]) * (1.35 - p[:, 0]),
    )
    grid = evaluate_grid(problem, (12, 12))
    front = pareto_front(problem, grid, ("first", "second"), 15, best_of_each(problem, grid, 3))
    before, after = (front.designs[front.corners[name]].z for name in ("before gap", "after gap"))
    assert before[0] < 0.5 < after[0] and [before[1], after[1]] == pytest.approx([1, 0], abs=1e-6)
    assert front.corners["after gap"] == front.corners["before gap"] + 1
