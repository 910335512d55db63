from itertools import product

import numpy as np
import pytest
from control.programs import KINDS, known, without_a_point
from scipy.optimize import lsq_linear

from cfem.control.search import qp
from cfem.control.search.qp import QpStatus, solve_qp
from cfem.control.search.qp_program import Kkt, scaled

BACKENDS = ("active_set", "osqp")
OPEN = np.tile([-np.inf, np.inf], (2, 1))
NO_ROWS = np.zeros((0, 2)), np.zeros(0), np.zeros(0)


def residuals(M, d, A, lower, upper, box, x, y, z) -> Kkt:
    """Residuals of any x and multipliers of a program that has a solution."""
    low, high = np.concatenate([box[:, 0], lower]), np.concatenate([box[:, 1], upper])
    program, variables, multipliers = scaled(M, d, A, low, high)
    return program.judged(x / variables, np.concatenate([z, y]) / multipliers).kkt.of(program.unit)


@pytest.mark.parametrize("unit", (1e-6, 1e6))
def test_units_of_a_variable_without_part_in_the_objective_change_nothing(unit):
    M, d, A = np.array([[2.0, 0.0], [1.0, 0.0]]), np.array([1.0, 3.0]), np.array([[1.0, -1.0]])
    box, limits, units = np.array([[-5.0, 5.0], [-1.0, 2.0]]), np.array([0.5, 4.0]), np.array([1.0, unit])
    plain, _, _ = scaled(M, d, A, *np.concatenate([box, limits[None]]).T)
    other, _, _ = scaled(M / units, d, A / units, *np.concatenate([box * units[:, None], limits[None]]).T)
    for name in ("M", "d", "G", "low", "high"):
        np.testing.assert_allclose(getattr(other, name), getattr(plain, name), rtol=1e-12, err_msg=name)
    assert np.ptp([plain.low[1], plain.high[1]]) * plain.unit == pytest.approx(1.0)


@pytest.mark.parametrize("size", (1e-3, 1e3))
def test_constraints_of_a_program_are_unit_normals_in_the_coordinates_of_the_objective(size):
    """A row of zeros bounds nothing, and stays one."""
    rng = np.random.default_rng(3)
    A, box = np.vstack([rng.normal(size=(2, 3)), np.zeros(3)]), np.tile([-1.0, 1.0], (3, 1))
    wide = np.concatenate([box, np.tile([-2.0, 2.0], (3, 1))])
    program, _, _ = scaled(size * rng.normal(size=(4, 3)), rng.normal(size=4), A, *wide.T)
    np.testing.assert_allclose(np.linalg.norm(program.normals, axis=1), [1, 1, 1, 1, 1, 0], atol=1e-12)
    x = rng.normal(size=3)
    moved = np.linalg.norm(program.M @ x)
    coordinates = program.S * (program.V.T @ x)
    assert np.linalg.norm(coordinates) == pytest.approx(moved)
    np.testing.assert_allclose(program.length * (program.normals @ coordinates), program.G @ x, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_random_programs_end_at_the_optimum_they_were_built_around(kind):
    rng = np.random.default_rng(20)
    for number in range(80):
        program = known(rng, kind)
        solution = solve_qp(*program.arguments)
        assert solution.status is QpStatus.OPTIMAL, (number, solution.kkt)
        assert program.excess(solution.x) < 1e-9, number
        assert program.overstep(solution.x) < 1e-8, number


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_none_of_many_random_programs_is_solved_wrongly(kind):
    rng = np.random.default_rng(21)
    for number in range(3000):
        program = known(rng, kind)
        solution = solve_qp(*program.arguments)
        assert solution.status is QpStatus.OPTIMAL, (number, solution.kkt)
        assert program.excess(solution.x) < 1e-7, number
        assert program.overstep(solution.x) < 1e-7, number


@pytest.mark.parametrize("kind", ("plain", "conditioned", "flat", "generous", "scaled", "extreme"))
def test_bounds_that_exclude_each_other_are_always_found(kind):
    rng = np.random.default_rng(22)
    for number in range(40):
        assert solve_qp(*without_a_point(rng, kind)).status is QpStatus.INFEASIBLE, number


def enumerate_active_sets(M, d, A, lower, upper, box):
    """The minimiser by trying every choice of active bounds; None where no choice is feasible."""
    n = M.shape[1]
    rows = np.vstack([np.eye(n), A])
    low, high = np.concatenate([box[:, 0], lower]), np.concatenate([box[:, 1], upper])
    best, least = None, np.inf
    for choice in product((-1, 0, 1), repeat=len(rows)):
        chosen = np.array(choice)
        held = chosen != 0
        bound = np.where(chosen < 0, low, high)[held]
        if held.sum() > n or not np.isfinite(bound).all():
            continue
        k = int(held.sum())
        kkt = np.block([[M.T @ M, rows[held].T], [rows[held], np.zeros((k, k))]])
        x = np.linalg.lstsq(kkt, np.concatenate([M.T @ d, bound]), rcond=None)[0][:n]
        scale = 1e-9 * (1 + np.abs(rows @ x))
        if (rows @ x < low - scale).any() or (rows @ x > high + scale).any():
            continue
        cost = float(((M @ x - d) ** 2).sum())
        if cost < least:
            best, least = x, cost
    return best


@pytest.mark.parametrize("backend", BACKENDS)
def test_both_solvers_find_what_enumeration_finds(backend):
    rng = np.random.default_rng(23)
    for _ in range(10):
        n, m = int(rng.integers(1, 4)), int(rng.integers(0, 4))
        M, d, A = rng.normal(size=(n + 1, n)), 3 * rng.normal(size=n + 1), rng.normal(size=(m, n))
        inner = rng.uniform(0.1, 0.9, n)
        bounds = A @ inner - rng.uniform(0.05, 0.6, m), A @ inner + rng.uniform(0.05, 0.6, m)
        program = M, d, A, *bounds, np.tile([0.0, 1.0], (n, 1))
        solution = solve_qp(*program, backend)
        assert solution.status is QpStatus.OPTIMAL
        np.testing.assert_allclose(solution.x, enumerate_active_sets(*program), atol=1e-7)


def test_box_programs_are_solved_as_scipy_solves_them():
    rng = np.random.default_rng(24)
    for curvature in (1e-2, 1e-4, 1e-6):
        for _ in range(20):
            pull, goal = rng.normal(size=(3, 8)), rng.normal(size=3) * rng.choice([0.3, 3.0, 30.0])
            M, d = np.vstack([pull, curvature * np.eye(8)]), np.concatenate([goal, np.zeros(8)])
            box = np.column_stack([np.zeros(8), np.full(8, rng.choice([1.0, 3.0, np.inf]))])
            solution = solve_qp(M, d, np.zeros((0, 8)), np.zeros(0), np.zeros(0), box)
            best = lsq_linear(M, d, tuple(box.T), method="bvls", tol=1e-15)
            assert solution.status is QpStatus.OPTIMAL
            assert 0.5 * ((M @ solution.x - d) ** 2).sum() <= best.cost * (1 + 1e-9) + 1e-18


@pytest.mark.parametrize("bound", [1.0, 1e3, 1e6, 1e9])
def test_copies_of_a_cable_meet_the_goal_however_generous_their_bounds(bound):
    M, d = np.array([[0.1, 0.1]]), np.array([1.0])
    solution = solve_qp(M, d, *NO_ROWS, np.array([[0.0, 9.0 * bound], [0.0, bound]]))
    assert solution.status is QpStatus.OPTIMAL
    assert abs(M @ solution.x - d)[0] < 1e-12
    assert solution.kkt.missed == pytest.approx(0.0, abs=1e-12)


def test_six_chambers_of_rank_four_meet_the_goal_whatever_bounds_they_have():
    rng = np.random.default_rng(25)
    M = rng.normal(size=(6, 4)) @ rng.normal(size=(4, 6))
    goal = M @ rng.uniform(1.0, 5.0, 6)
    for bound in (10.0, 1e3, 1e6, np.inf):
        box = np.column_stack([np.zeros(6), np.full(6, bound)])
        solution = solve_qp(M, goal, np.zeros((0, 6)), np.zeros(0), np.zeros(0), box)
        assert solution.status is QpStatus.OPTIMAL
        assert np.abs(M @ solution.x - goal).max() < 1e-11 * np.abs(goal).max()


# minimise |x - (1, 2)|^2 / 2 subject to 0 <= x_0 <= 0.5, x_1 >= 0: x = (0.5, 2), force 0.5 at the high bound of x_0.
HAND = np.eye(2), np.array([1.0, 2.0]), *NO_ROWS, np.array([[0.0, 0.5], [0.0, np.inf]])


def of_hand(x, z):
    return residuals(*HAND, np.array(x), np.zeros(0), np.array(z))


def test_residuals_of_the_optimum_vanish():
    assert max(of_hand([0.5, 2.0], [0.5, 0.0]).missed, of_hand([0.5, 2.0], [0.5, 0.0]).feasibility) < 1e-15


def test_each_residual_measures_what_it_names():
    moved = of_hand([0.5, 2.3], [0.5, 0.0])
    assert moved.stationarity == pytest.approx(0.3) and moved.feasibility == moved.complementarity == 0.0
    below = of_hand([0.5, -0.2], [0.5, 0.0])
    assert below.feasibility == pytest.approx(1.0)  # all of |x_1|: its bound is 0
    above = of_hand([0.6, 2.0], [0.4, 0.0])
    assert above.feasibility == pytest.approx(0.1 / 0.6) and above.complementarity == pytest.approx(0.1)
    wrong_side = of_hand([0.5, 2.0], [-0.5, 0.0])
    assert wrong_side.complementarity == pytest.approx(0.5) and wrong_side.stationarity == pytest.approx(1.0)
    nobody = of_hand([0.5, 2.0], [0.5, 0.1])  # a force of a bound that does not exist
    assert nobody.complementarity == pytest.approx(0.1)


def test_residuals_of_rows_measure_both_of_their_bounds():
    row = np.array([[1.0, 1.0]])
    program = np.eye(2), np.zeros(2), row, np.array([1.0]), np.array([3.0]), OPEN
    exact = residuals(*program, np.array([0.5, 0.5]), np.array([-0.5]), np.zeros(2))
    assert max(exact.missed, exact.feasibility) < 1e-15
    assert residuals(*program, np.array([0.2, 0.2]), np.zeros(1), np.zeros(2)).feasibility == pytest.approx(0.6)
    assert residuals(*program, np.array([2.0, 2.0]), np.zeros(1), np.zeros(2)).feasibility == pytest.approx(0.25)


def test_residuals_do_not_depend_on_units_or_on_bounds_that_are_far_away():
    program = known(np.random.default_rng(26), "plain")
    solution = solve_qp(*program.arguments)
    x = solution.x + 1e-3
    expected = residuals(*program.arguments, x, solution.y, solution.z).stationarity
    unit = 1e6 ** np.arange(len(x))
    scaled = residuals(
        program.M * unit, program.d, program.A * unit, program.lower, program.upper, program.box / unit[:, None],
        x / unit, solution.y, solution.z * unit,
    )  # fmt: skip
    assert scaled.stationarity == pytest.approx(expected, rel=1e-6)
    wide = np.where(np.abs(solution.z)[:, None] > 0, program.box, program.box * 1e6)
    far = residuals(*program.arguments[:-1], wide, x, solution.y, solution.z)
    assert far.stationarity == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("backend", BACKENDS)
def test_multipliers_balance_the_objective_in_the_users_units(backend):
    rng = np.random.default_rng(27)
    for _ in range(4):
        program = known(rng, "plain")
        solution = solve_qp(*program.arguments, backend)
        assert solution.status is QpStatus.OPTIMAL
        M, d, A = program.M, program.d, program.A
        balance = M.T @ (M @ solution.x - d) + A.T @ solution.y + solution.z
        assert np.abs(balance).max() < 1e-7 * np.abs(M.T @ d).max()


@pytest.mark.parametrize("backend", BACKENDS)
def test_bounds_that_exclude_each_other_are_reported(backend):
    row = np.array([[1.0, 1.0]])
    solution = solve_qp(
        np.eye(2), np.zeros(2), row, np.array([3.0]), np.array([4.0]), np.array([[0.0, 1.0]] * 2), backend
    )
    assert solution.status is QpStatus.INFEASIBLE
    assert np.isnan(solution.x).all()


@pytest.mark.parametrize("box", [[[2.0, 1.0], [0.0, 1.0]], [[np.inf, np.inf], [0.0, 1.0]]])
def test_a_bound_that_excludes_everything_is_reported(box):
    assert solve_qp(np.eye(2), np.ones(2), *NO_ROWS, np.array(box)).status is QpStatus.INFEASIBLE


@pytest.mark.parametrize("backend", BACKENDS)
def test_an_open_box_and_a_flat_objective(backend):
    box = np.array([[0.0, np.inf], [0.2, 0.2]])
    solution = solve_qp(np.array([[1.0, 1.0]]), np.ones(1), *NO_ROWS, box, backend)
    assert solution.status is QpStatus.OPTIMAL
    np.testing.assert_allclose(solution.x, [0.8, 0.2], atol=1e-7)


@pytest.mark.parametrize("count", (2, 60))
def test_of_many_variables_only_two_combinations_matter(count):
    """The rounding of the other singular values grows with the largest, which is the number of variables: it is no
    direction."""
    rng = np.random.default_rng(7)
    M = rng.uniform(0.5, 1.0, (count, 2)) @ rng.uniform(0.5, 1.0, (2, count))
    d = M @ rng.uniform(-1.0, 1.0, count) + 0.1 * rng.normal(size=count)
    box, rows = np.tile([-0.05, 0.05], (count, 1)), (np.zeros((0, count)), np.zeros(0), np.zeros(0))
    solution = solve_qp(M, d, *rows, box)
    by_scipy = lsq_linear(M, d, box.T, tol=1e-12)
    assert solution.status is QpStatus.OPTIMAL and solution.iterations <= 2 * count
    assert np.square(M @ solution.x - d).sum() / 2 == pytest.approx(by_scipy.cost, rel=1e-6)


def test_an_objective_of_nothing_leaves_the_bounds_to_decide():
    solution = solve_qp(np.zeros((1, 2)), np.zeros(1), *NO_ROWS, np.array([[3.0, 4.0], [-2.0, 5.0]]))
    assert solution.status is QpStatus.OPTIMAL
    assert 3.0 <= solution.x[0] <= 4.0 and -2.0 <= solution.x[1] <= 5.0


@pytest.mark.parametrize("where", ["M", "d", "A", "lower", "upper", "box"])
def test_nan_is_named_not_solved(where):
    values = {
        "M": np.eye(1),
        "d": np.zeros(1),
        "A": np.ones((1, 1)),
        "lower": np.zeros(1),
        "upper": np.ones(1),
        "box": np.array([[0.0, 1.0]]),
    }
    values[where] = values[where] * np.nan
    assert solve_qp(**values).status is QpStatus.NOT_FINITE


@pytest.mark.parametrize("size", [1e150, 1e-150, 1e300])
def test_numbers_at_the_ends_of_double_precision_are_solved_or_refused(size):
    M, d = np.array([[size, 0.0], [0.0, 1.0], [size, 1.0]]), np.array([size, 1.0, 0.5])
    solution = solve_qp(M, d, np.array([[1.0, size]]), -np.ones(1), np.ones(1), np.array([[0.0, size]] * 2))
    assert solution.status in (QpStatus.OPTIMAL, QpStatus.INACCURATE)
    assert solution.status is QpStatus.INACCURATE or np.isfinite(solution.x).all()


def test_backends_write_nothing_to_stdout(capfd):
    solve_qp(np.eye(1), np.zeros(1), np.zeros((0, 1)), np.zeros(0), np.zeros(0), np.array([[-1.0, 1.0]]), "osqp")
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize(("away", "status"), [(1e-5, QpStatus.INACCURATE), (1e-11, QpStatus.OPTIMAL)])
def test_an_answer_that_misses_the_optimum_is_not_called_optimal(monkeypatch, away, status):
    def misses(program):
        return program.judged(np.array([0.5, 1.0]) + away, np.zeros(2)), 1

    monkeypatch.setitem(qp._BACKENDS, "active_set", misses)
    solution = solve_qp(np.eye(2), np.array([1.0, 2.0]), *NO_ROWS, OPEN)
    assert solution.status is status
    assert solution.kkt.stationarity == pytest.approx(2 * away * np.sqrt(2), rel=1e-3)


def test_a_plain_program_is_solved_in_one_round():
    M, d, box = np.eye(2), np.array([2.0, 0.5]), np.tile([-1.0, 1.0], (2, 1))
    solution = solve_qp(M, d, *NO_ROWS, box)
    np.testing.assert_allclose(solution.x, [1.0, 0.5], atol=1e-15)
    assert solution.iterations == 1  # of the active set: one bound


def test_what_is_rounding_beside_the_objective_breaks_no_bound_of_zero():
    """x = -1e-7 is beyond the bound, and its own size, but the variables are known to 1e-14 / 5e-5 of M x only."""
    M, x, nothing = np.array([[1.0, 1.0], [1.0, 1.0001]]), np.array([-1e-7, 1.0]), np.zeros(2)
    box = np.array([[0.0, np.inf], [-np.inf, np.inf]])
    found = residuals(M, M @ x, *NO_ROWS, box, x, np.zeros(0), nothing)
    assert 0 < found.feasibility < 1e-4
