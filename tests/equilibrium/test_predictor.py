"""Orders of convergence on a robot known in closed form, and exactness where the map is a polynomial."""

import numpy as np
import pytest
from sample.synthetic import FACTS, SyntheticSolver
from support.blocks import bar
from surrogate.synthetic import energy

from cfem.equilibrium import predictor
from cfem.equilibrium.predictor import Knot, following, knot, predict
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement, force, pull
from cfem.equilibrium.system.problem import Problem
from cfem.sample.plan import actuation

SOLVER = SyntheticSolver()


def solved(u):
    return knot(u, SOLVER.solve(actuation("pulling", u, FACTS.reach, FACTS.compliance), None))


def error(knots, u):
    asked = actuation("pulling", u, FACTS.reach, FACTS.compliance)
    return float(np.abs(predict(knots, u, asked).x - SOLVER.solve(asked, None).state.x).max())


@pytest.mark.parametrize(("count", "order", "h"), [(1, 2, 0.02), (3, 3, 0.1), (5, 4, 0.1), (10, 5, 0.1), (14, 7, 0.2)])
def test_the_error_falls_with_the_power_of_the_distance_that_the_neighbours_allow(count, order, h):
    centre = np.array([0.55, 0.5])
    around = np.random.default_rng(0).uniform(-1, 1, (count, 2))
    errors = [error([solved(centre + size * step) for step in around], centre) for size in (h, h / 4)]
    assert np.log(errors[0] / errors[1]) / np.log(4) > order - 0.4
    assert errors[0] < 0.1


def test_the_degree_follows_the_number_of_equations():
    assert [predictor._degree(count, 2) for count in (1, 2, 3, 5, 8, 11, 14, 20)] == [1, 1, 2, 3, 4, 5, 6, 6]
    assert predictor._degree(20, 6) == 3


def test_a_quadratic_map_is_met_exactly_from_scattered_states():
    rng = np.random.default_rng(1)
    K = np.array([[3.0, 1.0], [1.0, 2.0]])
    bend = rng.normal(size=(5, 3, 2, 2))

    def at(delta):
        x = np.einsum("nipq,p,q->ni", bend, delta, delta)
        dx = np.einsum("nipq,q->nip", bend + bend.swapaxes(2, 3), delta)
        return Knot(delta, delta, K @ delta, K, x, dx)

    knots = [at(delta) for delta in rng.random((6, 2))]
    target = np.array([0.4, 0.6])
    start = predict(knots, target, displacement(target))
    np.testing.assert_allclose(start.x, at(target).x, atol=1e-11)
    np.testing.assert_allclose(start.lam, K @ target, atol=1e-11)


def test_the_predicted_state_meets_what_is_asked():
    u = np.array([0.45, 0.6])
    knots = [solved(u + 0.1 * step) for step in np.random.default_rng(2).uniform(-1, 1, (8, 2))]
    asked = actuation("pulling", u, FACTS.reach, FACTS.compliance)
    start = predict(knots, u, asked)
    np.testing.assert_allclose(start.lam / asked.C[0], start.lam[0] / asked.C[0, 0], rtol=1e-8)
    assert asked.C @ start.x[0, :2] == pytest.approx(asked.target, abs=1e-8)
    assert len(start.pressure) == 0


def test_prescribed_forces_are_met_too():
    u = np.array([0.5, 0.5])
    knots = [solved(u + 0.05 * step) for step in np.random.default_rng(2).uniform(-1, 1, (14, 2))]
    wanted = solved(u)
    start = predict(knots, u, force(wanted.lam))
    np.testing.assert_allclose(start.x, wanted.x, atol=1e-4)


def test_far_from_all_that_is_known_the_start_stays_finite():
    knots = [solved(u) for u in 0.02 * np.random.default_rng(3).random((12, 2)) + 0.01]
    start = predict(knots, np.array([1.0, 1.0]), actuation("pulling", np.ones(2), FACTS.reach, FACTS.compliance))
    assert np.isfinite(start.x).all() and np.abs(start.x).max() < 1e4


def test_nothing_known_nothing_predicted():
    assert predict([], np.ones(2), displacement(np.ones(2))) is None


def test_repeated_knots_do_no_harm():
    u = np.array([0.5, 0.4])
    assert error([solved(u + 0.01)] * 6, u) < 0.05


def test_tangents_are_those_of_the_map():
    u, h = np.array([0.5, 0.4]), 1e-5
    here = solved(u)
    for axis in range(2):
        step = h * np.eye(2)[axis]
        ahead, behind = (SOLVER.solve(displacement(here.delta + sign * step), None).state.x for sign in (1, -1))
        np.testing.assert_allclose(here.dx[..., axis], (ahead - behind) / (2 * h), atol=1e-7)
    np.testing.assert_allclose(here.stiffness, energy(here.delta[None])[2][0], rtol=1e-10)


def test_a_quadratic_map_of_displacements_and_a_parameter_is_met_exactly():
    rng = np.random.default_rng(1)
    K = np.array([[3.0, 1.0, 0.4], [1.0, 2.0, -0.3]])  # by delta, then by q
    bend = rng.normal(size=(5, 3, 3, 3))

    def at(inputs):
        x = np.einsum("nipq,p,q->ni", bend, inputs, inputs)
        dx = np.einsum("nipq,q->nip", bend + bend.swapaxes(2, 3), inputs)
        return Knot(inputs, inputs[:2], K @ inputs, K, x, dx, inputs[2:])

    knots = [at(inputs) for inputs in rng.random((8, 3))]
    target = np.array([0.4, 0.6, 0.3])
    start = predict(knots, target, displacement(target[:2]), target[2:])
    np.testing.assert_allclose(start.x, at(target).x, atol=1e-11)
    np.testing.assert_allclose(start.lam, K @ target, atol=1e-11)
    alone = predict(knots[:1], target, displacement(target[:2]), target[2:])
    first = knots[0]
    np.testing.assert_allclose(alone.x, first.x + first.dx @ (target - first.inputs), atol=1e-12)


def test_pulls_that_follow_each_other_end_in_the_states_from_rest_and_cost_less():
    robot = bar("tet4", divisions=(12, 2, 2))
    pulls = [pull(np.ones(2), robot.reach[:, 1], part) for part in (0.25, 0.5, 0.75, 1.0)]
    followed = following(lambda asked, start: solve(Problem(robot), asked, start))
    ended, alone = [followed(asked) for asked in pulls], [solve(Problem(robot), asked) for asked in pulls]
    for warm, cold in zip(ended, alone, strict=True):
        np.testing.assert_allclose(warm.state.x, cold.state.x, atol=1e-6)
    assert sum(each.factorizations for each in ended) < 0.6 * sum(each.factorizations for each in alone)


@pytest.mark.parametrize("rigid_end", [False, True])
def test_rotations_and_stretches_lead_farther_than_positions(rigid_end):
    problem = Problem(bar("tet10", divisions=(8, 1, 1), rigid_end=rigid_end))
    pulls = [displacement([amount, 0.0]) for amount in (1.0, 4.0, 8.0)]
    states = [solve(problem, asked, slack=False) for asked in pulls]
    known = [knot(state.delta_a, state) for state in states[:2]]
    for knots in (known[:1], known):
        wanted, asked = states[len(knots)], pulls[len(knots)]
        by_positions = predict(knots, asked.target, asked)
        by_shape = predict(knots, asked.target, asked, shape=problem.rotation_strain)
        errors = [np.abs(problem.kinematics.hold(one.x) - wanted.state.x).max() for one in (by_positions, by_shape)]
        assert errors[1] < errors[0] / 4, errors
        costs = [solve(problem, asked, start, slack=False).factorizations for start in (by_positions, by_shape)]
        assert costs[1] <= costs[0]


def test_where_many_states_are_known_positions_serve():
    problem = Problem(bar("tet4", divisions=(6, 1, 1)))
    knots = []
    for share in np.random.default_rng(0).random((12, 2)):
        state = solve(problem, displacement(4.0 * share), predict(knots, share, displacement(4.0 * share)), slack=False)
        knots.append(knot(state.delta_a, state))
    asked = displacement([2.0, 2.0])
    starts = [predict(knots, asked.target, asked, shape=shape) for shape in (None, problem.rotation_strain)]
    np.testing.assert_array_equal(starts[0].x, starts[1].x)
