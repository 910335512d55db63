"""Weights of coordinates from functions that fall, or bend, at known rates along each."""

import numpy as np
import pytest

from cfem.surrogate.series.chebyshev import index_set
from cfem.surrogate.series.weights import active_weights, decay_weights, searched_weights


def test_weights_by_decay_are_the_ratios_of_the_rates():
    indices, _ = index_set(np.ones(2), 200, 10)
    coefficients = np.exp(-1.0 * indices[:, 0] - 2.0 * indices[:, 1])[:, None]
    assert decay_weights(indices, coefficients) == pytest.approx([1, 2], rel=0.02)


def test_a_search_gives_little_to_the_coordinate_that_hardly_matters():
    z = np.random.default_rng(0).uniform(-1, 1, (300, 2))
    targets = (np.exp(2 * z[:, 0]) + 0.1 * z[:, 1])[:, None, None]
    weights = searched_weights(z, ((),), targets, np.ones(1), 12, 16)
    assert weights.min() == 1 and weights[0] == 1 and weights[1] > 3


def test_axes_along_which_the_map_hardly_bends_weigh_two_and_parameters_one():
    s = np.random.default_rng(0).uniform(-1, 1, (50, 3))
    assert active_weights(np.diag([1.0, 1.0, 1e-4]), s, 2).tolist() == [2, 1, 1, 1, 1]
    assert active_weights(np.eye(2), s[:, :2], 2) is None
