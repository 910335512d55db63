"""Guesses for many points lead to states that satisfy the law."""

import numpy as np
import pytest

from cfem.contact.check import check
from cfem.contact.modes import VALID
from cfem.contact.problem import ContactProblem
from cfem.contact.solve import ContactStatus, solve_contact
from cfem.contact.sweep import _on_cone, guess


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


def test_without_friction_the_guess_is_the_answer():
    for seed in range(20):
        problem = random_problem(seed, 20, 0.0)
        assert guess(problem, "coulomb")[0] == solve_contact(problem, "coulomb").modes


@pytest.mark.parametrize("force", [[1.0, 0.2, 0.1], [-1.0, 0.1, 0.0], [0.3, 1.0, -2.0], [0.0, 1.0, 0.0]])
def test_the_projection_onto_the_cone_is_the_nearest_force_of_it(force):
    force, mu = np.array(force), 0.5
    found = _on_cone(force, mu)
    assert np.linalg.norm(found[1:]) <= mu * found[0] + 1e-12
    rng = np.random.default_rng(0)
    for _ in range(200):
        normal = rng.uniform(0, 3)
        angle, share = rng.uniform(0, 2 * np.pi), rng.uniform()
        other = np.array([normal, *(share * mu * normal * np.array([np.cos(angle), np.sin(angle)]))])
        assert np.linalg.norm(force - found) <= np.linalg.norm(force - other) + 1e-12


def test_an_unstable_compliance_is_named_and_not_swept():
    for seed in range(5):
        problem = random_problem(seed, 6, 0.4)
        found = solve_contact(ContactProblem(problem.W - 30.0 * np.eye(18), problem.free, mu=0.4), "coulomb")
        if found.status is ContactStatus.SOLVED:
            assert found.check.valid()
        else:
            assert found.status is ContactStatus.UNSTABLE and not found.modes
