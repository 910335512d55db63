"""Sizes of nested sets, and errors of states left out."""

from itertools import pairwise

import numpy as np

from cfem.surrogate.series.chebyshev import index_set
from cfem.surrogate.series.nested_fit import level_counts, try_counts


def test_sizes_are_those_of_whole_degrees_or_grow_by_a_quarter():
    _, order = index_set(np.ones(2), 30, 4)
    assert level_counts(order, smooth=False) == [1, 3, 6, 10, 15]
    _, order = index_set(np.array([1.0, 1.3]), 40, 8)
    counts = level_counts(order, smooth=True)
    assert all(b >= 1.25 * a for a, b in pairwise(counts[:-1])) and counts[-1] == len(order)


def test_states_left_out_tell_the_degree_of_a_polynomial():
    z = np.random.default_rng(0).uniform(-1, 1, (60, 2))
    noise = 1e-6 * np.random.default_rng(1).normal(size=60)
    targets = (z[:, 0] ** 3 - z[:, 1] * z[:, 0] + noise)[:, None, None]
    indices, order = index_set(np.ones(2), 40, 6)
    counts = level_counts(order, smooth=False)
    errors = [error for error, _ in try_counts(z, ((),), targets, np.ones(1), indices, counts, 5)]
    assert counts[int(np.argmin(errors))] == 10 and errors[2] > 1e-2 and errors[3] < 2e-6
