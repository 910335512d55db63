"""Intervals and radii of predicted markers against distributions that are known, and against draws."""

import numpy as np
import pytest
from scipy.stats import chi2, norm

from cfem.identify.fit.prediction_intervals import degrees_of_freedom, half_and_radius, inflation_of, share_covered

MANY = 1e9  # degrees of freedom, as good as normal


def test_a_marker_of_one_deviation_in_all_axes_has_the_radius_of_chi_squared():
    half, radius = half_and_radius(4.0 * np.eye(3)[None], 1.5, MANY, 0.95)
    np.testing.assert_allclose(half[0], 3.0 * norm.ppf(0.975), rtol=1e-6)
    assert radius[0] == pytest.approx(3.0 * np.sqrt(chi2.ppf(0.95, 3)), rel=1e-6)


def test_draws_of_unlike_axes_lie_within_as_often_as_is_said():
    rng, C = np.random.default_rng(0), np.array([[4.0, 1.0, 0.0], [1.0, 1.0, 0.2], [0.0, 0.2, 0.3]])
    error = rng.multivariate_normal(np.zeros(3), C, (4000, 1))
    half, radius = half_and_radius(C[None], 1.0, MANY, 0.9)
    inside, near = share_covered(error, half, radius)
    assert inside == pytest.approx(0.9, abs=0.01) and near == pytest.approx(0.9, abs=0.015)


def test_what_was_not_measured_is_not_counted():
    error = np.array([[[0.5, np.nan, 3.0], [0.0, 0.0, 0.1]]])
    assert share_covered(error, np.ones((1, 2, 3)), np.ones((1, 2))) == (0.8, 1.0)
    assert np.isnan(share_covered(np.full((1, 1, 3), np.nan), np.ones((1, 1, 3)), np.ones((1, 1)))).all()


def test_degrees_of_freedom_are_those_of_the_numbers_where_these_are_independent():
    """Ratios of five cases of twelve independent numbers have sixty degrees, as draws of them tell on average."""
    rng = np.random.default_rng(1)
    ratios = rng.chisquare(12, (4000, 5)) / 12
    median = np.median([degrees_of_freedom(drawn, 1e6) for drawn in ratios])
    assert 40 < median < 80 and degrees_of_freedom(ratios[0], 7.0) == 7.0
    assert inflation_of(np.array([4.0, 0.0])) == pytest.approx(np.sqrt(2)) and inflation_of(np.array([0.1])) == 1.0
