"""Motion beyond the second order of a load: closed forms and differences."""

import numpy as np
import pytest

from cfem.predict.contact.forces.high_order import TRUSTED, beyond, slope


def cubic(rng, n):
    """C (n, n) positive definite, D (n, n, n) symmetric."""
    A, D = rng.normal(size=(n, n)), rng.normal(size=(n, n, n))
    orders = [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
    return A @ A.T + 0.1 * np.eye(n), sum(D.transpose(order) for order in orders) / 6


def at(C, D, w):
    return beyond(w, C @ w, D @ w @ w)


@pytest.mark.parametrize("load", [0.05, 0.2, 0.5])
def test_a_spring_that_its_load_stiffens(load):
    """u = w / (k + w), whose series is w / k - w^2 / k^2 + ...: four orders are right, and it never turns back."""
    k = 1.5
    C, D = np.array([[1 / k]]), np.array([[[-2 / k**2]]])
    exact = load / (k + load)
    off = at(C, D, np.array([load])).motion[0] - exact
    assert abs(off) < 0.3 * (load / k) ** 4 < abs(load / k - load**2 / k**2 - exact)
    motions = [at(C, D, np.array([w])).motion[0] for w in np.linspace(0, 50, 200)]
    assert (np.diff(motions) > 0).all()


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("size", [1e-3, 0.1, 1.0, 30.0])
def test_the_slope_is_that_of_differences_and_symmetric(size, sign):
    rng = np.random.default_rng(4)
    C, D = cubic(rng, 4)
    w = size * rng.normal(size=4)
    w *= sign * np.sign(D @ w @ w @ w)
    r, h = (D @ w @ w @ w) / (2 * w @ C @ w), 1e-6 * size
    assert size < 10 or abs(r) > TRUSTED
    found = slope(at(C, D, w), C, D @ w)
    ends = [[at(C, D, w + way * h * one).motion for one in np.eye(4)] for way in (1, -1)]
    expected = (np.array(ends[0]) - ends[1]).T / (2 * h)
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
    np.testing.assert_allclose(found, found.T, rtol=1e-12)


def test_a_body_that_softens_moves_by_a_bounded_multiple_of_the_first_order():
    C, D = np.eye(1), np.array([[[2.0]]])
    motions = np.array([at(C, D, np.array([w])).motion[0] / w for w in np.geomspace(1e-3, 1e6, 60)])
    assert (np.diff(motions) > 0).all() and 1.0 < motions[0] < 1.01 and 5.6 < motions[-1] < 5.7


def test_no_load_moves_nothing():
    C, D = cubic(np.random.default_rng(5), 3)
    none = np.zeros(3)
    found = at(C, D, none)
    assert not found.motion.any()
    np.testing.assert_array_equal(slope(found, C, D @ none), C)
