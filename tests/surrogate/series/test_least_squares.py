"""Nested least squares by blocks equal separate least squares on all rows."""

import numpy as np
import pytest

from cfem.predict.series.chebyshev import basis
from cfem.surrogate.series.chebyshev import index_set
from cfem.surrogate.series.least_squares import DEGREE, least_norm, residual_square, solve_nested, triangular

RNG = np.random.default_rng(0)
A, B = RNG.normal(size=(60, 8)), RNG.normal(size=(60, 2))


@pytest.mark.parametrize("at_once", [1, 7, 60])
def test_blocks_do_not_matter(at_once):
    R = triangular(np.hstack([A, B])[i : i + at_once] for i in range(0, 60, at_once))
    for count, found in zip((1, 5, 8), solve_nested(R, 2, [1, 5, 8]), strict=True):
        expected, residual, *_ = np.linalg.lstsq(A[:, :count], B)
        assert np.allclose(found, expected, atol=1e-12)
        assert residual_square(R, 2, found) == pytest.approx(residual.sum())


def test_residual_of_other_rows():
    R = triangular([np.hstack([A, B])[:20]])
    x = RNG.normal(size=(5, 2))
    assert residual_square(R, 2, x) == pytest.approx(((A[:20, :5] @ x - B[:20]) ** 2).sum())


def test_dependent_columns_have_no_solution():
    twice = np.hstack([A[:, :3], A[:, :1], B])
    assert [found is None for found in solve_nested(triangular([twice]), 2, [2, 3, 4])] == [False, False, True]


def test_fewer_rows_than_columns_have_no_solution():
    assert solve_nested(triangular([np.hstack([A, B])[:4]]), 2, [4, 5])[1] is None


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
