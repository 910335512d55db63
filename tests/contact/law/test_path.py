"""Of many points, states are found where Newton's method finds none, by the way along growing friction."""

import numpy as np
import pytest
from support.benchmark import benchmark

from cfem.contact.law.check import check
from cfem.contact.law.modes import VALID
from cfem.contact.law.newton import by_friction, newton, normal_forces, projected
from cfem.contact.law.path import along_friction
from cfem.contact.law.problem import ContactProblem
from cfem.contact.law.solve import ContactStatus, solve_contact

a_problem = benchmark("contact_random").a_problem


def random_problem(seed, m, mu, rank=None):
    """Points on a body whose compliance has a smooth part of few modes and a local one, as a skin has."""
    rng = np.random.default_rng(seed)
    modes = rng.normal(size=(3 * m, rank or 10))
    W = modes @ modes.T + 0.1 * np.kron(np.eye(m), np.diag([1.0, 0.8, 0.8]))
    free = rng.normal(size=3 * m)
    free[::3] -= 0.5
    return ContactProblem(W, free, mu=mu)


@pytest.mark.parametrize("mu", [0.0, 0.3, 0.8])
def test_random_problems_of_up_to_thirty_points_satisfy_the_law(mu):
    for seed in range(10):
        problem = random_problem(seed, 3 * seed + 3, mu)
        found = solve_contact(problem, "coulomb")
        assert found.status is ContactStatus.SOLVED
        assert check(problem, "coulomb", found.lam, found.xi).largest <= VALID


@pytest.mark.parametrize(("seed", "m"), [(169, 20), (979, 20)])
def test_the_path_turns_back_and_arrives_where_newton_fails(seed, m):
    """Two of the nine problems of `benchmarks/contact_random.py` that Newton's method does not solve."""
    problem = a_problem(seed)
    assert problem.m == m and newton(problem.W, problem.free, problem.mu)[0] is None
    force, systems = along_friction(problem.W, problem.free, problem.mu)
    assert systems < 1000
    assert check(problem, "coulomb", force.ravel()).largest <= 1e-11


@pytest.mark.parametrize("mu", [10.0, 1e3, 1e9])
def test_however_large_friction_is_the_way_there_takes_few_systems(mu):
    """Steps grow with friction: at 1e9, in steps of 1, no number of systems led there. A point that slides under so
    much presses by so little that rounding may hide it; then the path ends."""
    for seed in range(6):
        problem = random_problem(seed, 6, mu)
        force, systems = along_friction(problem.W, problem.free, mu)
        assert systems < 1000
        if force is None:
            assert mu == 1e9
            continue
        gap = (problem.W @ force.ravel() + problem.free).reshape(-1, 3)
        pressed, size = force[:, 0] > 0, np.abs(problem.free).max()
        assert (np.linalg.norm(force[:, 1:], axis=1) <= mu * force[:, 0] * (1 + 1e-9)).all()
        assert (gap[:, 0] >= -1e-9 * size).all() and not force[~pressed].any()
        np.testing.assert_allclose(gap[pressed, 0], 0, atol=1e-9 * size)
        held = pressed & (np.linalg.norm(force[:, 1:], axis=1) < 0.99 * mu * force[:, 0])
        np.testing.assert_allclose(gap[held], 0, atol=1e-9 * size)


def test_the_path_ends_at_the_only_state():
    """Below a small enough friction the state is unique: every way leads to that of Newton's method."""
    for seed in range(10):
        problem = random_problem(seed, 6, 0.05)
        by_newton, _ = newton(problem.W, problem.free, 0.05)
        force, _ = along_friction(problem.W, problem.free, 0.05)
        np.testing.assert_allclose(force, by_newton, atol=1e-10 * np.abs(by_newton).max())


def test_no_state_is_larger_than_the_proof_says():
    """|lambda| <= |free| / smallest eigenvalue of W, on which the existence of a state rests."""
    for seed in range(10):
        problem = random_problem(seed, 8, 1.5)
        found = solve_contact(problem, "coulomb")
        largest = np.linalg.norm(problem.free) / np.linalg.eigvalsh(problem.W)[0]
        assert found.status is ContactStatus.SOLVED and np.linalg.norm(found.lam) <= largest


def test_without_friction_the_normal_forces_minimise_the_energy():
    """Against projected gradient steps, which know nothing of Newton's method."""
    problem = random_problem(4, 12, 0.0, rank=3)
    W, free = problem.W[::3, ::3], problem.free[::3]
    slow, rate = np.zeros(12), 1.0 / np.linalg.eigvalsh(W)[-1]
    for _ in range(20000):
        slow = np.maximum(slow - rate * (W @ slow + free), 0.0)
    np.testing.assert_allclose(normal_forces(problem.W, problem.free)[:, 0], slow, atol=1e-8)
    by_path, _ = along_friction(problem.W, problem.free, 0.0)
    np.testing.assert_allclose(by_path[:, 0], slow, atol=1e-8)


def test_friction_changes_the_projection_as_differences_say():
    p, mu, step = np.random.default_rng(2).normal(size=30), 0.4, 1e-7
    differences = (projected(p, mu + step)[0] - projected(p, mu - step)[0]).ravel() / (2 * step)
    np.testing.assert_allclose(by_friction(p, mu), differences, atol=1e-7)
    assert differences.any()


def test_an_unstable_compliance_is_named():
    for seed in range(5):
        problem = random_problem(seed, 6, 0.4)
        found = solve_contact(ContactProblem(problem.W - 30.0 * np.eye(18), problem.free, mu=0.4), "coulomb")
        if found.status is ContactStatus.SOLVED:
            assert found.check.valid()
        else:
            assert found.status is ContactStatus.UNSTABLE and not found.modes


def test_where_newton_fails_the_normal_forces_still_minimise_the_energy(monkeypatch):
    """By the conditions of the minimum, for points that press and points that open."""
    problem = random_problem(3, 6, 0.5)
    expected = normal_forces(problem.W, problem.free)
    monkeypatch.setattr("cfem.contact.law.newton.newton", lambda *asked: (None, 1))
    found = normal_forces(problem.W, problem.free)
    assert found.shape == (6, 3) and not found[:, 1:].any()
    gap = problem.W[::3, ::3] @ found[:, 0] + problem.free[::3]
    pressed = found[:, 0] > 0
    assert 0 < pressed.sum() < 6
    np.testing.assert_allclose(gap[pressed], 0.0, atol=1e-12)
    assert gap[~pressed].min() > 0
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert normal_forces(-problem.W, problem.free) is None
