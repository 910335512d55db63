"""What finite elements lack: its derivatives, and where it ends."""

import numpy as np
import pytest

from cfem.condensed.discrepancy import Discrepancy, features, terms_of


@pytest.fixture(scope="module")
def lacking():
    weights = np.random.default_rng(4).standard_normal((len(terms_of(3)), 2))
    return Discrepancy(("tip.x", "tip.z"), np.array([2.0, 0.5, 30.0]), weights)


def test_features_are_each_force_and_each_product():
    assert terms_of(2) == [(0,), (1,), (0, 0), (0, 1), (1, 1)]
    np.testing.assert_allclose(features(np.array([[0.5, -0.2]])), [[0.5, -0.2, 0.25, -0.1, 0.04]])


def test_derivatives_are_those_of_differences(lacking):
    lam = np.array([0.7, -0.3, 11.0])
    for j, step in enumerate(1e-4 * lacking.largest * np.eye(3)):
        h = 2 * step[j]
        slope = (lacking.value(lam + step) - lacking.value(lam - step)) / h
        np.testing.assert_allclose(lacking.slopes(lam)[:, j], slope, rtol=1e-8)
        curvature = (lacking.slopes(lam + step) - lacking.slopes(lam - step)) / h
        np.testing.assert_allclose(lacking.curvatures(lam)[:, :, j], curvature, rtol=1e-8, atol=1e-12)


def test_there_is_none_without_force_and_no_more_beyond_the_calibration(lacking):
    assert not lacking.value(np.zeros(3)).any()
    beyond = np.array([5.0, -2.0, 11.0])
    np.testing.assert_array_equal(lacking.value(beyond), lacking.value(np.array([2.0, -0.5, 11.0])))
    assert not lacking.slopes(beyond)[:, :2].any() and lacking.slopes(beyond)[:, 2].all()
