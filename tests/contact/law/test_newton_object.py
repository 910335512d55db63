"""Newton's method on problems with an object, against the search over all modes."""

from itertools import product

import numpy as np
import pytest
from support.all_modes import all_modes
from support.fast_cases import fast_are

from cfem.contact.law.check import check
from cfem.contact.law.modes import Mode, ModeStatus, solve_mode
from cfem.contact.law.newton_object import newton_with_object
from cfem.contact.law.problem import ContactProblem
from cfem.contact.law.solve import solve_contact


def table(points, push, mu, seed=0):
    """A plate on `points` legs that yield differently, with its weight and a push along the ground."""
    rng = np.random.default_rng(seed)
    arms = np.column_stack(
        [np.cos(2 * np.pi * np.arange(points) / points), np.sin(2 * np.pi * np.arange(points) / points)]
    )
    G = np.zeros((3 * points, 6))
    for i, (y, z) in enumerate(arms):
        G[3 * i : 3 * i + 3, :3] = np.eye(3)
        G[3 * i : 3 * i + 3, 3:] = [[0, z, -y], [-z, 0, 0], [y, 0, 0]]
    A = rng.normal(size=(3 * points, 3 * points))
    free = np.zeros(3 * points)
    free[::3] = 0.02 * rng.normal(size=points)
    return ContactProblem(
        A @ A.T / points + np.eye(3 * points), free, G, np.array([5.0, push, 0.3, 0.1, 0.2, -0.1]), mu
    )


@pytest.mark.parametrize("seed, push", fast_are([(0, 2.0), (1, 0.0), (2, 1.0)], product(range(3), [0.0, 1.0, 2.0])))
def test_four_points_find_a_state_of_the_full_search(seed, push):
    problem = table(4, push, 0.6, seed)
    lam, xi, _ = newton_with_object(problem.normalised, 0.6)
    lam, xi = lam.ravel() * problem.units.force, xi * problem.units.motion
    assert check(problem, "coulomb", lam, xi).valid()
    states = all_modes(problem, "coulomb")
    assert min(np.abs(one.lam - lam).max() for one in states) < 1e-8


def test_many_points_are_solved_without_a_search_and_some_slip():
    problem = table(9, 2.6, 0.6)
    found = solve_contact(problem, "coulomb")
    assert found.check.valid() and found.tried < 40
    assert Mode.SLIP in found.modes
    np.testing.assert_allclose(problem.motion.T @ found.lam, problem.load, atol=1e-8)


def test_more_push_than_friction_has_no_state():
    assert newton_with_object(table(9, 3.2, 0.6).normalised, 0.6) is None


def test_two_points_that_touch_cannot_hold_what_turns_about_their_line():
    """Whatever they do, and however much friction there is: no search over their directions is begun."""
    modes = (Mode.SLIP, Mode.OPEN, Mode.SLIP, Mode.OPEN)
    found = solve_mode(table(4, 1.0, 0.6), "coulomb", modes)
    assert found.status is ModeStatus.INCONSISTENT and not len(found.lam)
