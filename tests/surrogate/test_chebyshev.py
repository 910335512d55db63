"""Basis, gradient and Hessian against numpy.polynomial and finite differences."""

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from cfem.predict.chebyshev import basis, polynomials
from cfem.surrogate.chebyshev import derivative_matrices, index_set, number_of_terms
from cfem.surrogate.spectral import design_rows


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 8, 13])
def test_polynomials_are_chebyshevs_inside_and_outside_the_box(degree):
    z = np.linspace(-1.1, 1.1, 23)
    assert np.allclose(polynomials(z, degree).T, chebyshev.chebvander(z, degree), rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_a_lower_degree_is_a_prefix_of_a_higher_one(n):
    full = index_set(n, 5)
    assert len(np.unique(full, axis=0)) == len(full) == number_of_terms(n, 5)
    for degree in range(6):
        assert np.array_equal(index_set(n, degree), full[: number_of_terms(n, degree)])


def test_derivative_matrix_of_one_variable_is_numpys_chebder():
    (D,) = derivative_matrices(index_set(1, 9))
    coefficients = np.random.default_rng(0).normal(size=10)
    assert np.allclose((D @ coefficients)[:-1], chebyshev.chebder(coefficients), rtol=1e-13)


@pytest.mark.parametrize("n", [2, 3, 4])
def test_gradient_and_hessian_against_finite_differences(n):
    indices = index_set(n, 6)
    z, h = np.random.default_rng(1).uniform(-0.9, 0.9, (7, n)), 1e-5
    rows = design_rows(z, indices, 2)
    pairs = [(i, j) for i in range(n) for j in range(i, n)]
    for i in range(n):
        step = h * np.eye(n)[i]
        central = (basis(z + step, indices) - basis(z - step, indices)) / (2 * h)
        assert np.allclose(rows[:, 1 + i], central, atol=1e-7)
        gradients = [design_rows(z + sign * step, indices, 1)[:, 1:] for sign in (1, -1)]
        for j in range(n):
            column = 1 + n + pairs.index((min(i, j), max(i, j)))
            assert np.allclose(rows[:, column], (gradients[0] - gradients[1])[:, j] / (2 * h), atol=1e-6)
