"""Nested least squares by blocks equal separate least squares on all rows."""

import numpy as np
import pytest

from cfem.surrogate.series.least_squares import residual_square, solve_nested, triangular

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
