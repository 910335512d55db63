"""What of the scatter is told to grow with the load."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from cfem.identify.cases.scatter import Linearised, Scatter, estimate_scatter, restricted_likelihood


def test_what_grows_is_told_from_what_does_not():
    rng, moved = np.random.default_rng(0), np.repeat([1.0, 10.0], 200)
    nothing = np.zeros((400, 1)), np.zeros(1), np.ones(1)
    grown = estimate_scatter(Linearised(0.1 * moved * rng.standard_normal(400), *nothing, moved), Scatter(1.0))
    assert grown.share == pytest.approx(0.1, rel=0.1) and grown.fixed < 0.06
    even = estimate_scatter(Linearised(0.5 * rng.standard_normal(400), *nothing, moved), Scatter(1.0))
    assert even.fixed == pytest.approx(0.5, rel=0.1) and even.share < 0.02
    alike = estimate_scatter(Linearised(0.5 * rng.standard_normal(400), *nothing, np.full(400, 5.0)), Scatter(1.0))
    assert alike.variance(5.0) == pytest.approx(0.25, rel=0.2) and alike.variance(20.0) > 4 * alike.variance(5.0)


def test_markers_that_never_moved_scatter_by_a_fixed_part():
    rng = np.random.default_rng(0)
    at = Linearised(rng.standard_normal(50), np.zeros((50, 1)), np.zeros(1), np.ones(1), np.zeros(50))
    assert estimate_scatter(at, Scatter(3.0)).share == 0


def test_restricted_likelihood_is_that_of_what_was_measured():
    """With all unknowns integrated out: normal, of covariance s^2 V + J P^-1 J^T, up to a constant."""
    rng = np.random.default_rng(2)
    J, prior = rng.standard_normal((12, 3)), np.array([1.0, 2.0, 0.5])
    u = rng.standard_normal(3) / prior
    r = J @ u + 0.3 * rng.standard_normal(12)
    found = []
    for V in (np.ones(12), np.linspace(0.2, 3, 12)):
        s2, likelihood = restricted_likelihood(Linearised(r, J, np.zeros(3), prior, np.ones(12)), V, 1.0)
        covariance = np.diag(s2 * V) + J @ np.diag(prior**-2) @ J.T
        found.append(likelihood - multivariate_normal(np.zeros(12), covariance).logpdf(r))
    assert found[0] == pytest.approx(found[1], abs=1e-9)
