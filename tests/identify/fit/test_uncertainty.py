"""What is said of how well parameters are known, against the textbook's straight line and exact small cases."""

import numpy as np
import pytest
from scipy.stats import linregress, norm, t

from cfem.identify.fit.uncertainty import uncertainty


def line(noise=0.3, count=9, seed=0):
    x = np.linspace(0, 4, count)
    y = 1.0 + 2.0 * x + noise * np.random.default_rng(seed).standard_normal(count)
    fit = linregress(x, y)
    return fit, fit.intercept + fit.slope * x - y, np.column_stack([np.ones(count), x])


def test_noise_that_is_not_known_is_estimated_with_its_degrees_of_freedom():
    fit, residuals, jacobian = line()
    found = uncertainty(residuals, jacobian, known=False, confidence=0.95)
    assert found.degrees == 7
    assert found.scale == pytest.approx(np.sqrt(residuals @ residuals / 7))
    np.testing.assert_allclose(found.deviations, [fit.intercept_stderr, fit.stderr])
    assert found.quantile == pytest.approx(t.ppf(0.975, 7)) and found.chance is None


def test_noise_that_is_known_is_taken_as_it_is_unless_the_fit_leaves_more():
    _, residuals, jacobian = line()
    within = uncertainty(residuals / 0.3, jacobian / 0.3, known=True, confidence=0.95)
    assert within.scale == 1.0 and within.quantile == pytest.approx(norm.ppf(0.975)) and within.chance > 1e-3
    beyond = uncertainty(residuals / 0.03, jacobian / 0.03, known=True, confidence=0.95)
    assert beyond.chance < 1e-3 and beyond.scale > 5 and beyond.quantile == pytest.approx(t.ppf(0.975, 7))


def test_as_many_parameters_as_measurements_leave_nothing_to_tell_noise_from():
    found = uncertainty(np.zeros(2), np.eye(2), known=False, confidence=0.95)
    assert found.degrees == 0 and found.covariance is None and np.isinf(found.deviations).all()


def test_a_direction_that_nothing_measures_has_no_interval():
    jacobian = np.column_stack([np.ones(5), np.zeros(5)])
    found = uncertainty(np.array([0.1, -0.1, 0.0, 0.1, -0.1]), jacobian, known=False, confidence=0.95)
    assert np.isfinite(found.deviations[0]) and np.isinf(found.deviations[1])
