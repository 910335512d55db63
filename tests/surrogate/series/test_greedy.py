"""Index sets that grow: what they find, that they are closed, and what they leave out."""

from itertools import product

import numpy as np

from cfem.surrogate.series.chebyshev import design_rows
from cfem.surrogate.series.greedy import greedy_set, neighbours
from cfem.surrogate.series.observations import Observations
from cfem.surrogate.series.spectral import MANY, fit_quantity

N = MANY + 2
DERIVATIVES = ((), *((i,) for i in range(N)))


def observed(z: np.ndarray) -> Observations:
    """exp(z0 + z1 / 2) + z2^2 z3 and its gradient; the other coordinates do nothing."""
    e = np.exp(z[:, 0] + z[:, 1] / 2)
    slopes = np.zeros((len(z), N))
    slopes[:, 0], slopes[:, 1], slopes[:, 2], slopes[:, 3] = e, e / 2, 2 * z[:, 2] * z[:, 3], z[:, 2] ** 2
    values = np.column_stack([e + z[:, 2] ** 2 * z[:, 3], slopes])
    return Observations(DERIVATIVES, values[:, :, None], 0)


def states(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (count, N))


def test_neighbours_are_those_that_keep_a_set_closed():
    inside = np.array([[0, 0], [1, 0], [0, 1], [2, 0], [1, 1]])
    assert sorted(map(tuple, neighbours(inside, 9).tolist())) == [(0, 2), (2, 1), (3, 0)]
    assert sorted(map(tuple, neighbours(inside, 2).tolist())) == [(0, 2)]


def test_terms_go_where_the_function_bends_and_every_step_is_a_closed_set():
    z = states(80)
    targets, divisors = observed(z).scaled()
    indices, sizes = greedy_set(z, targets, DERIVATIVES, divisors, 60, 9)
    assert len(indices) == sizes[-1] <= 60 and sizes == sorted(set(sizes))
    for size in sizes:
        known = set(map(tuple, indices[:size].tolist()))
        assert all(tuple(low) in known for k in known for low in product(*(range(i + 1) for i in k)))
    assert indices.sum(axis=1).max() <= 9
    degrees = indices[: sizes[len(sizes) // 2]].max(axis=0)
    assert degrees[0] >= 4 and degrees[2] >= 2 and degrees[4:].max() == 1
    assert [0, 0, 2, 1] + [0] * (N - 4) in indices.tolist()


def test_a_series_of_many_inputs_is_found_from_fewer_states_than_a_total_degree_has_terms():
    z, others = states(60), states(200, seed=1)
    series, _, records = fit_quantity(z, observed(z), max_degree=12, max_terms=150, folds=5)
    found = design_rows(others, series.indices, DERIVATIVES) @ series.coefficients
    np.testing.assert_allclose(found, observed(others).values, atol=2e-5)  # degree 6 alone has 8008 terms
    assert {one["weights"] for one in records} == {"greedy"}
