import numpy as np
import pytest

from cfem.mechanics.assembly import make_pattern
from cfem.mechanics.factorization import SingularMatrixError, analyze

PATTERN = make_pattern(3, [np.array([[0, 1, 2]])], np.array([], dtype=int))


def lower(matrix):
    return np.concatenate([matrix[column:, column] for column in range(9)])


def symmetric(eigenvalues, seed=0):
    Q = np.linalg.qr(np.random.default_rng(seed).standard_normal((9, 9)))[0]
    return Q @ np.diag(eigenvalues) @ Q.T


def test_solves_many_right_hand_sides_and_counts_negative_eigenvalues():
    matrix = symmetric([1.0, 2, 3, 4, 5, 6, -1, -2, 7])
    factor = analyze(PATTERN)(lower(matrix))
    B = np.random.default_rng(1).standard_normal((9, 4))
    np.testing.assert_allclose(matrix @ factor.solve(B), B, atol=1e-12)
    assert factor.negative == 2


@pytest.mark.parametrize(
    "matrix", [np.zeros((9, 9)), symmetric([0.0, 1, 2, 3, 4, 5, 6, 7, 8]), np.full((9, 9), np.nan)]
)
def test_singular_and_non_finite_matrices_are_reported(matrix):
    with pytest.raises(SingularMatrixError):
        analyze(PATTERN)(lower(matrix))
