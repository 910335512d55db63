"""Newton's method on the contact law: its answers obey the law, and it knows no others."""

import numpy as np
import pytest
from support.all_modes import all_modes

from cfem.contact.law import newton as newton_module
from cfem.contact.law.check import check
from cfem.contact.law.modes import Mode
from cfem.contact.law.newton import modes_from, newton, projected, scaled
from cfem.contact.law.problem import ContactProblem


def a_problem(seed, m, mu):
    rng = np.random.default_rng(seed)
    modes = rng.normal(size=(3 * m, 8))
    free = rng.normal(size=3 * m)
    free[::3] -= 0.5
    return ContactProblem(modes @ modes.T + 0.2 * np.eye(3 * m), free, mu=mu)


@pytest.mark.parametrize(("mu", "least"), [(0.0, 40), (0.3, 38), (0.8, 36)])
def test_answers_obey_the_law(mu, least):
    """Which it does not find it says so; the least counts are those that it found when this was written."""
    found = 0
    for seed in range(40):
        problem = a_problem(seed, 1 + seed % 30, mu)
        force, systems = newton(problem.W, problem.free, mu)
        if force is not None:
            found += 1
            assert systems <= 40
            assert check(problem, "coulomb", force.ravel()).largest <= 1e-10
    assert found >= least


def test_points_without_compliance_and_numbers_that_are_not_finite_are_refused_before_any_system():
    for W in (np.zeros((3, 3)), np.full((3, 3), np.nan)):
        assert newton(W, np.full(3, -1.0), 0.3) == (None, 0)


def test_it_is_one_of_all_states():
    for seed in range(30):
        problem = a_problem(seed, 2, 0.4)
        force, _ = newton(problem.W, problem.free, 0.4)
        if force is None:
            continue
        states = all_modes(problem, "coulomb")
        nearest = min(states, key=lambda one: np.abs(one.lam - force.ravel()).max())
        assert np.abs(nearest.lam - force.ravel()).max() < 1e-8 * max(1.0, np.abs(force).max())
        assert nearest.modes == modes_from(force, 0.4)


def test_from_its_own_answer_it_has_nothing_to_do():
    problem = a_problem(3, 12, 0.5)
    force, _ = newton(problem.W, problem.free, 0.5)
    again, systems = newton(problem.W, problem.free, 0.5, force)
    assert systems == 1 and np.allclose(again, force, atol=1e-12 * np.abs(force).max())


def test_points_out_of_reach_stay_open():
    problem = a_problem(0, 5, 0.5)
    force, _ = newton(problem.W, np.tile([1.0, 0.3, -0.2], 5), 0.5)
    assert not force.any() and modes_from(force, 0.5) == (Mode.OPEN,) * 5


def test_a_matrix_that_it_cannot_take_is_no_answer():
    assert newton(np.full((3, 3), np.nan), np.array([-1.0, 0, 0]), 0.3)[0] is None


@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_a_step_leaves_out_rows_that_need_no_system(mu):
    """Against the whole system, from forces at which some points are open and some are not."""
    problem = a_problem(3, 8, mu)
    A, constant = scaled(problem.W, problem.free)
    lam = np.random.default_rng(4).normal(size=24)
    P, D = projected(A @ lam - constant, mu)
    F, room, step = lam - P.ravel(), np.empty((24, 24)), np.empty(24)
    assert 0 < (D[:, 0, 0] > 0).sum() < 8
    assert newton_module._step(A, F, D, mu, room, step)
    whole = np.eye(24) - (D @ A.reshape(8, 3, 24)).reshape(24, 24)
    np.testing.assert_allclose(step, np.linalg.solve(whole, -F), rtol=1e-9, atol=1e-12)
