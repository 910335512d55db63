"""Basis, gradient and Hessian against numpy.polynomial and finite differences."""

from itertools import combinations_with_replacement, product

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from cfem.predict.series.chebyshev import polynomials
from cfem.predict.series.derivatives import derivative_matrices
from cfem.surrogate.series.chebyshev import design_rows, index_set


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 8, 13])
def test_polynomials_are_chebyshevs_inside_and_outside_the_box(degree):
    z = np.linspace(-1.1, 1.1, 23)
    assert np.allclose(polynomials(z, degree).T, chebyshev.chebvander(z, degree), rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("weights", [[1.0], [1.0, 1.0], [1.0, 2.5], [1.0, 1.3, 4.0], [2.0, 1.0, 1.0, 1.5]])
def test_an_index_set_is_all_below_a_degree_and_lower_ones_are_prefixes(weights):
    found, order = index_set(np.array(weights), 400, 8)
    assert np.allclose(order, found @ weights) and (np.diff(order) >= -1e-9).all() and len(found) <= 400
    reach = [range(int(8 / weight) + 1) for weight in weights]
    expected = [k for k in product(*reach) if np.dot(k, weights) <= np.floor(order[-1] + 1e-9) + 1e-9]
    if len(expected) <= 400:
        assert {tuple(k) for k in found.tolist()} == {k for k in expected if np.dot(k, weights) <= order[-1] + 1e-9}
    members = {tuple(k) for k in found.tolist()}
    for k in members:  # with every index all smaller ones
        for axis, power in enumerate(k):
            assert power == 0 or (*k[:axis], power - 1, *k[axis + 1 :]) in members


def test_the_number_of_terms_is_kept():
    for terms in (1, 4, 5, 100):
        assert len(index_set(np.ones(3), terms, 40)[0]) <= terms
    assert len(index_set(np.ones(3), 84, 40)[0]) == 84  # all of degree 6


def test_derivative_matrix_of_one_variable_is_numpys_chebder():
    (D,) = derivative_matrices(index_set(np.ones(1), 10, 40)[0])
    coefficients = np.random.default_rng(0).normal(size=10)
    assert np.allclose((D @ coefficients)[:-1], chebyshev.chebder(coefficients), rtol=1e-13)


@pytest.mark.parametrize("n", [2, 3, 4])
def test_derivatives_against_finite_differences(n):
    indices, _ = index_set(np.ones(n), 1000, 6)
    z, h = np.random.default_rng(1).uniform(-0.9, 0.9, (7, n)), 1e-5
    for order in (1, 2, 3):
        for one in combinations_with_replacement(range(n), order):
            step = h * np.eye(n)[one[-1]]
            ahead, behind = (design_rows(z + sign * step, indices, (one[:-1],)) for sign in (1, -1))
            assert np.allclose(design_rows(z, indices, (one,)), (ahead - behind) / (2 * h), atol=1e-5)
