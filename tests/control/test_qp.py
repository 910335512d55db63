from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from cfem.control.qp import QpStatus, solve_qp


def enumerate_active_sets(H, f, A, lower, upper, box):
    """The minimiser by trying every choice of active bounds; None where no choice is feasible."""
    rows = np.vstack([np.eye(len(f)), A])
    low, high = np.concatenate([box[:, 0], lower]), np.concatenate([box[:, 1], upper])
    best, best_cost = None, np.inf
    for choice in product((-1, 0, 1), repeat=len(rows)):
        chosen = np.array(choice)
        held = chosen != 0
        if held.sum() > len(f):
            continue
        bound = np.where(chosen < 0, low, high)[held]
        if not np.isfinite(bound).all():
            continue
        k = int(held.sum())
        kkt = np.block([[H, rows[held].T], [rows[held], np.zeros((k, k))]])
        x = np.linalg.lstsq(kkt, np.concatenate([-f, bound]), rcond=None)[0][: len(f)]
        values = rows @ x
        scale = 1 + np.abs(values)
        if (values < low - 1e-9 * scale).any() or (values > high + 1e-9 * scale).any():
            continue
        cost = x @ H @ x / 2 + f @ x
        if cost < best_cost:
            best, best_cost = x, cost
    return best


def problem(seed: int, n: int, m: int, spread: float):
    """A random feasible problem whose variables have scales apart by 10^spread."""
    rng = np.random.default_rng(seed)
    scale = 10.0 ** rng.uniform(-spread / 2, spread / 2, n)
    root = rng.normal(size=(n + 1, n))
    H, f = root.T @ root, 3 * rng.normal(size=n)
    A = rng.normal(size=(m, n))
    inner = rng.uniform(0.1, 0.9, n)
    lower = A @ inner - rng.uniform(0.05, 0.6, m)
    upper = A @ inner + rng.uniform(0.05, 0.6, m)
    box = np.column_stack([np.zeros(n), np.ones(n)]) * scale[:, None]
    rows = 10.0 ** rng.uniform(-spread / 2, spread / 2, m)
    return H / np.outer(scale, scale), f / scale, A / scale * rows[:, None], lower * rows, upper * rows, box, scale


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 3), st.integers(0, 3), st.sampled_from([0.0, 4.0, 10.0]))
def test_daqp_finds_what_enumeration_finds(seed, n, m, spread):
    *data, scale = problem(seed, n, m, spread)
    solution = solve_qp(*data)
    assert solution.status is QpStatus.OPTIMAL
    # Enumeration itself is done in the well-scaled variables.
    H, f, A, lower, upper, box = data
    norm = np.linalg.norm(A * scale, axis=1)
    expected = enumerate_active_sets(
        H * np.outer(scale, scale),
        f * scale,
        A * scale / norm[:, None],
        lower / norm,
        upper / norm,
        box / scale[:, None],
    )
    np.testing.assert_allclose(solution.x / scale, expected, atol=1e-7)


@pytest.mark.parametrize("backend", ["daqp", "osqp"])
@pytest.mark.parametrize("seed", range(4))
def test_multipliers_satisfy_the_conditions_in_the_users_units(backend, seed):
    H, f, A, lower, upper, box, scale = problem(seed, 3, 2, 6.0)
    solution = solve_qp(H, f, A, lower, upper, box, backend)
    assert solution.status is QpStatus.OPTIMAL
    force = H @ solution.x + f + A.T @ solution.y + solution.z
    assert np.abs(force * scale).max() < 1e-7 * max(1.0, np.abs(f * scale).max())
    at_high = np.isclose(solution.x, box[:, 1], rtol=1e-7)
    assert (solution.z[~at_high] <= 1e-9 * np.abs(f).max()).all()


@pytest.mark.parametrize("backend", ["daqp", "osqp"])
def test_bounds_that_exclude_each_other_are_reported(backend):
    row = np.array([[1.0, 1.0]])
    solution = solve_qp(
        np.eye(2), np.zeros(2), row, np.array([3.0]), np.array([4.0]), np.array([[0.0, 1.0]] * 2), backend
    )
    assert solution.status is QpStatus.INFEASIBLE
    assert np.isnan(solution.x).all()


@pytest.mark.parametrize("backend", ["daqp", "osqp"])
def test_open_box_and_singular_hessian(backend):
    H, f, empty = np.ones((2, 2)), -np.ones(2), np.zeros(0)
    box = np.array([[0.0, np.inf], [0.2, 0.2]])
    solution = solve_qp(H, f, np.zeros((0, 2)), empty, empty, box, backend)
    assert solution.status is QpStatus.OPTIMAL
    np.testing.assert_allclose(solution.x, [0.8, 0.2], atol=1e-7)


def test_nan_is_named_not_solved():
    solution = solve_qp(
        np.eye(1), np.array([np.nan]), np.zeros((0, 1)), np.zeros(0), np.zeros(0), np.array([[0.0, 1.0]])
    )
    assert solution.status is QpStatus.NOT_FINITE


def test_backends_write_nothing_to_stdout(capfd):
    solve_qp(np.eye(1), np.zeros(1), np.zeros((0, 1)), np.zeros(0), np.zeros(0), np.array([[-1.0, 1.0]]), "osqp")
    assert capfd.readouterr().out == ""


def nearly_flat(seed: int, curvature: float, m: int):
    """Eight actuators, three effector rows, a ridge of relative curvature `curvature`, m course rows."""
    rng = np.random.default_rng(seed)
    n = 8
    pull = rng.normal(size=(3, n))
    ridge = np.sqrt(curvature) * np.linalg.norm(pull, 2)
    goal = rng.normal(size=3) * rng.choice([0.3, 3.0, 30.0])
    root = rng.normal(size=(n, n))
    A = (root @ root.T + 0.1 * np.eye(n))[:m]
    middle = A @ rng.uniform(0, 1, n)
    lower, upper = middle - rng.uniform(0.1, 2, m), middle + rng.uniform(0.1, 2, m)
    box = np.column_stack([np.zeros(n), np.full(n, rng.choice([1.0, 3.0, np.inf]))])
    return pull, ridge, goal, (pull.T @ pull + ridge**2 * np.eye(n), -pull.T @ goal, A, lower, upper, box)


CURVATURES = [1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13]


@pytest.mark.parametrize("m", [0, 8])
@pytest.mark.parametrize("curvature", CURVATURES)
def test_nearly_flat_programs_are_solved(curvature, m):
    for seed in range(50):
        pull, ridge, goal, data = nearly_flat(seed, curvature, m)
        solution = solve_qp(*data)
        assert solution.status is QpStatus.OPTIMAL, (seed, solution.kkt)
        if m == 0:
            rows, target = np.vstack([pull, ridge * np.eye(8)]), np.concatenate([goal, np.zeros(8)])
            best = lsq_linear(rows, target, tuple(data[-1].T), method="bvls", tol=1e-15)
            cost = 0.5 * ((rows @ solution.x - target) ** 2).sum()
            assert cost <= best.cost * (1 + 1e-5) + 1e-10 * goal @ goal


@pytest.mark.parametrize("curvature", CURVATURES)
def test_nearly_flat_programs_without_an_answer_are_infeasible(curvature):
    H, f, A, lower, upper, box = nearly_flat(1, curvature, 8)[-1]
    apart = np.vstack([A, A[:1]]), np.append(lower, upper[0] + 1.0), np.append(upper, upper[0] + 2.0)
    assert solve_qp(H, f, *apart, box).status is QpStatus.INFEASIBLE
