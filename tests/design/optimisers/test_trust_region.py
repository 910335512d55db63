"""The search that finite elements correct, on functions whose optima are known: with a wrong model it ends at the true
optimum."""

from dataclasses import replace

import numpy as np
import pytest
from design.problems import plain

from cfem.core.errors import NumericalError
from cfem.design.optimisers.search import evaluate_grid
from cfem.design.optimisers.trust_region import TrustRegionSettings, best_of, first_order, optimum

LIMITS = TrustRegionSettings(tolerance=1e-4, solves=30)
TRUE = (0.37, 0.61)


def true(p):
    """A bent valley (Rosenbrock's, milder), lowest at TRUE."""
    x, y = p.T
    return (x - TRUE[0]) ** 2 + 4 * (y - TRUE[1] - 0.5 * (x - TRUE[0]) ** 2) ** 2


def wrong(p):
    """Its valley is elsewhere, too steep, and tilted."""
    x, y = p.T
    return 1.6 * (x - 0.7) ** 2 + 3 * (y - 0.35) ** 2 + 0.5 * x * y - 0.4


class Counted:
    """A problem whose designs are counted."""

    def __init__(self, problem, fails=lambda z: False):
        self.problem, self.fails, self.asked = problem, fails, 0
        self.objectives, self.constraints = problem.objectives, problem.constraints

    def with_slopes(self, z):
        self.asked += 1
        if self.fails(z):
            raise NumericalError("no equilibrium")
        return self.problem.with_slopes(z)


def searched(model, exact, start, limits=LIMITS, constraints=(None, None), fails=lambda z: False):
    model, truth = plain(constraints[0], one=model), Counted(plain(constraints[1], one=exact), fails)
    found = optimum(model, truth, evaluate_grid(model, (9, 9)), np.array([1.0]), np.array(start), limits)
    assert found.solves == truth.asked
    return found


@pytest.mark.parametrize("start", [(0.7, 0.35), (0.0, 1.0), (0.95, 0.02)])
def test_a_wrong_model_leads_to_the_true_optimum(start):
    found = searched(wrong, true, start)
    assert found.z == pytest.approx(TRUE, abs=1e-3) and found.certified
    assert found.solves <= 25 and found.objectives[0] < 1e-6 <= found.first[0]


def test_a_good_model_needs_few_solves():
    found = searched(lambda p: true(p - 0.01) + 0.3, true, (0.38, 0.62))
    assert found.certified and found.solves <= 4 and found.z == pytest.approx(TRUE, abs=1e-3)


def test_a_model_that_bends_the_other_way_still_ends_at_an_optimum():
    found = searched(lambda p: -true(p), true, (0.6, 0.5), replace(LIMITS, solves=80))
    assert found.z == pytest.approx(TRUE, abs=5e-3)


def test_a_constraint_that_the_model_has_wrong_holds_at_the_optimum():
    """Lagrange's conditions by hand, of x^2 + y^2 on x + y = 1.2."""

    def square(p):
        return (p**2).sum(axis=1)

    model = {"line": lambda p: 1.1 * p[:, 0] + 0.9 * p[:, 1] - 0.9}
    truth = {"line": lambda p: p[:, 0] + p[:, 1] - 1.2 + 0.1 * (p[:, 0] - p[:, 1]) ** 2}
    for start in ((0.4, 0.5), (0.9, 0.9), (0.1, 0.1)):  # the first and last violate the true one
        found = searched(square, square, start, constraints=(model, truth))
        assert found.z == pytest.approx([0.6, 0.6], abs=1e-3) and found.certified
        assert found.constraints[0] >= -1e-4


def test_ends_of_ranges_are_optima():
    found = searched(lambda p: -p[:, 0] - 0.1 * p[:, 1], lambda p: -(p[:, 0] ** 2) + p[:, 1], (0.3, 0.6))
    assert found.z == pytest.approx([1.0, 0.0], abs=1e-9) and found.certified and found.solves <= 8


def test_designs_that_cannot_be_solved_shorten_the_step():
    found = searched(wrong, true, (0.7, 0.35), fails=lambda z: abs(z[0] - 0.5) < 0.02 and z[1] < 0.4)
    assert found.z == pytest.approx(TRUE, abs=1e-3) and found.certified


def test_solves_used_up_are_no_optimum():
    found = searched(wrong, true, (0.95, 0.02), replace(LIMITS, solves=2))
    assert not found.certified and found.why == "the solves allowed were used up" and found.solves == 2
    assert best_of([found, searched(wrong, true, (0.4, 0.6))]).certified


def test_the_residual_is_that_of_hand():
    """Of x at its lower end, where it may only grow, and of a constraint that pushes back half of the slope."""
    grid = evaluate_grid(plain(one=true), (3, 3))
    grid = replace(grid, width=np.ones(1))
    weights = np.array([1.0])
    z, slopes = np.array([0.0, 0.5]), np.array([[2.0, 3.0]])
    assert first_order(grid, weights, 1, z, np.zeros(1), slopes)[0] == pytest.approx(3.0)
    assert first_order(grid, weights, 1, z, np.zeros(1), -slopes)[0] == pytest.approx(np.sqrt(13))
    both = np.vstack([slopes, [[0.0, 2.0]]])
    residual, multiplier = first_order(grid, weights, 1, z, np.zeros(2), both)
    assert residual == pytest.approx(0.0, abs=1e-12) and multiplier == pytest.approx(3.0)
    assert first_order(grid, weights, 1, z, np.array([0.0, 1.0]), both)[0] == pytest.approx(3.0)  # not active
