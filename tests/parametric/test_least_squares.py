"""Bounded least squares against scipy's solver of linear problems, and problems that have no answer somewhere."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from cfem.core.errors import NumericalError
from cfem.parametric.least_squares import FitSettings, best_of, fit, spread_starts

A = np.array([[1.0, 2.0], [3.0, -1.0], [0.5, 0.5]])
TARGET = np.array([4.0, 1.0, 2.0])


def linear(u, with_jacobian):
    return A @ u - TARGET, A if with_jacobian else None


@pytest.mark.parametrize("high", [np.inf, 1.2])
def test_a_linear_problem_within_bounds_and_at_one(high):
    answer = fit(linear, np.array([0.5, 0.5]), FitSettings(low=0.0, high=high, try_ends=True))
    wanted = lsq_linear(A, TARGET, (0.0, high), tol=1e-14)
    np.testing.assert_allclose(answer.u, wanted.x, atol=1e-8)
    assert answer.cost == pytest.approx(wanted.cost, abs=1e-12) and answer.failure is None
    assert len(answer.costs) == len(answer.history) and answer.costs.min() == answer.cost


def test_each_place_is_evaluated_once_where_the_jacobian_comes_with_the_residuals():
    asked = []

    def both(u, with_jacobian):
        asked.append(u.copy())
        return A @ u - TARGET, A

    answer = fit(both, np.array([0.2, 0.2]), FitSettings())
    assert len(asked) == len(np.unique(asked, axis=0)) == len(answer.costs)


def test_a_failure_ends_the_fit_or_is_a_barrier():
    def beyond(u, with_jacobian):
        if u[0] > 0.9:
            raise NumericalError("too stiff")
        return np.array([u[0] - 0.8, 10 * (u[0] - 0.8) ** 2]), np.array([[1.0], [20 * (u[0] - 0.8)]])

    failed = fit(beyond, np.array([0.95]), FitSettings())
    assert failed.failure == "too stiff" and failed.cost == np.inf
    answer = fit(beyond, np.array([0.1]), FitSettings(barrier=1e3))
    assert answer.u[0] == pytest.approx(0.8, abs=1e-6)
    with pytest.raises(NumericalError, match="too stiff"):
        fit(beyond, np.array([0.95]), FitSettings(barrier=1e3))
    assert best_of([failed, answer]) is answer
    with pytest.raises(NumericalError, match="failed from every start: too stiff"):
        best_of([failed])


def test_starts_begin_in_the_middle_and_fill_the_square():
    starts = spread_starts(64, 2)
    np.testing.assert_array_equal(starts[0], [0.5, 0.5])
    assert starts.shape == (64, 2) and len(np.unique((4 * starts).astype(int), axis=0)) == 16
