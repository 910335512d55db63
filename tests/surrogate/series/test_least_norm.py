"""A series through all values, where there are fewer of them than terms."""

import numpy as np
import pytest

from cfem.predict.series.chebyshev import basis
from cfem.surrogate.series.chebyshev import index_set
from cfem.surrogate.series.least_norm import DEGREE, least_norm


def test_it_is_nearer_between_the_states_than_a_series_of_fewer_terms():
    """Functions whose coefficients halve from degree to degree, of more terms than there are states."""
    rng = np.random.default_rng(0)
    z, unseen = rng.uniform(-1, 1, (50, 3)), rng.uniform(-0.9, 0.9, (200, 3))
    true, order = index_set(np.ones(3), 1000, 8)
    drawn = 0.5 ** order[:, None] * rng.normal(size=(len(true), 20))
    values, expected = basis(z, true) @ drawn, basis(unseen, true) @ drawn
    indices, coefficients, left_out = least_norm(z, values)
    assert indices.sum(axis=1).max() == DEGREE and len(indices) > len(z)
    assert basis(z, indices) @ coefficients == pytest.approx(values, abs=1e-3)
    off = np.linalg.norm(basis(unseen, indices) @ coefficients - expected)
    short, _ = index_set(np.ones(3), 35, 4)
    fitted = basis(unseen, short) @ np.linalg.lstsq(basis(z, short), values, rcond=None)[0]
    assert off < 0.6 * np.linalg.norm(fitted - expected)
    assert 0.5 < left_out / (off / np.linalg.norm(expected)) < 5


def test_more_states_than_terms_are_a_least_squares_fit():
    z = np.linspace(-1, 1, 40)[:, None]
    indices, coefficients, left_out = least_norm(z, z**3 - z)
    assert len(indices) == DEGREE + 1 and left_out < 1e-4
    assert basis(z, indices) @ coefficients == pytest.approx(z**3 - z, abs=1e-4)
