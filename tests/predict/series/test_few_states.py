"""The states at which finite elements are solved, of those that a model was trained on."""

from itertools import product
from math import comb
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.predict.series.few_states import MOST, TERMS, degrees, linear_states, patch_states


def domain(states, low, high):
    return SimpleNamespace(states=np.hstack([states, 0 * states]), delta_a=np.array([low, high], float))


@pytest.mark.parametrize("n_a", [1, 2, 3, 4, 12])
def test_degrees_are_all_of_the_highest_total_that_has_few_terms(n_a):
    found = degrees(n_a)
    total = found.sum(axis=1)
    best = max(d for d in range(1, MOST + 1) if d == 1 or comb(n_a + d, d) <= TERMS)
    assert len(found) == len({tuple(row) for row in found}) == comb(n_a + best, best)
    assert total[0] == 0 and (np.diff(total) >= 0).all() and total[-1] == best


def test_a_line_of_states_is_known_at_its_ends():
    """Of 9 states between 2 and 10 mm, also where the domain is not about 0: a line is best known from both ends."""
    states = np.linspace(2.0, 10.0, 9)[:, None]
    found = linear_states(domain(states, [2.0], [10.0]), states)
    np.testing.assert_array_equal(found, [0, 8])


def test_a_plane_is_known_at_corners_whatever_their_order():
    states = np.array([*product([0.0, 1.0, 2.0, 3.0], [5.0, 6.0, 7.0])])
    order = np.random.default_rng(0).permutation(len(states))
    found = linear_states(domain(states, [0.0, 5.0], [3.0, 7.0]), states[order])
    assert len(found) == 3 and (np.diff(found) > 0).all()
    chosen = states[order][found]
    assert (np.isin(chosen[:, 0], [0, 3]) & np.isin(chosen[:, 1], [5, 7])).all()
    assert abs(np.linalg.det(np.column_stack([np.ones(3), chosen]))) == 3.0 * 2.0  # the most of any three


def test_fewer_states_than_terms_are_all_taken():
    states = np.array([[1.0, 0.0], [0.0, 2.0]])
    found = linear_states(domain(states, [0.0, 0.0], [1.0, 2.0]), states)
    np.testing.assert_array_equal(found, [0, 1])


def test_the_states_of_patches_tell_all_terms_and_are_of_the_training():
    rng = np.random.default_rng(1)
    states = rng.uniform([-1.0, 4.0], [1.0, 8.0], (60, 2))
    chosen = patch_states(domain(states, [-1.0, 4.0], [1.0, 8.0]), 2)
    assert len(chosen) == 10  # of degree 3 in two
    rows = [np.flatnonzero((states == one).all(axis=1))[0] for one in chosen]
    assert rows == sorted(rows)
    scaled = (chosen - [0.0, 6.0]) / [1.0, 2.0]
    terms = np.array([[x**i * y**j for i, j in degrees(2)] for x, y in scaled])
    assert np.linalg.cond(terms) < 100
