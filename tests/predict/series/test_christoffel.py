"""How far a model extrapolates, against the largest polynomial found by an eigenvalue problem in monomials."""

import numpy as np
import pytest
from scipy.linalg import eigh

from cfem.predict.series.christoffel import Christoffel


def monomials(x: np.ndarray) -> np.ndarray:
    """(m, 6) of two coordinates to the second degree."""
    a, b = x.T
    return np.column_stack([np.ones(len(x)), a, b, a * a, a * b, b * b])


def test_it_is_the_largest_polynomial_whose_mean_square_over_the_states_is_one():
    rng = np.random.default_rng(0)
    states, places = rng.uniform(3.0, 9.0, (14, 2)), rng.uniform(0.0, 12.0, (8, 2))  # 14: the second degree
    L, mean_square = Christoffel.of(states), monomials(states).T @ monomials(states) / len(states)
    largest = [eigh(np.outer(b, b), mean_square, eigvals_only=True)[-1] for b in monomials(places)]
    assert L(places) == pytest.approx(np.sqrt(np.array(largest) / 6), rel=1e-6)
    assert L(places[0]) == pytest.approx(L(places)[0])
    assert np.mean(L(states) ** 2) == pytest.approx(1.0)


def test_it_grows_beyond_the_states_with_the_degree():
    states = np.linspace(-1, 1, 50)[:, None]
    L = Christoffel.of(states)
    far, farther = L(np.array([[100.0], [200.0]]))
    assert far > 1e6 and farther / far == pytest.approx(2**4, rel=1e-2)


def test_few_states_and_states_on_a_line_have_one_too():
    assert Christoffel.of(np.array([[1.0, 2.0]]))(np.array([5.0, 7.0])) == pytest.approx(1.0)
    line = np.linspace(0, 1, 40)
    L = Christoffel.of(np.column_stack([line, line]))
    assert L(np.array([0.3, 0.3])) == pytest.approx(Christoffel.of(line[:, None])(np.array([0.3])))
