"""Series against derivatives of closed forms."""

import numpy as np
import pytest

from cfem.surrogate.series.taylor import Taylor

SECOND = ((), (0,), (1,), (0, 0), (0, 1), (1, 1))
THIRD = (*SECOND, (0, 0, 0), (0, 0, 1), (0, 1, 1), (1, 1, 1))
PARTIAL = ((), (0,), (1,), (0, 0))  # the second axis to first order only
POINT = np.array([0.3, -0.7])


def series(taylor: Taylor, derivatives: list[float]) -> np.ndarray:
    return np.array(derivatives) / taylor.factorials


def exponential(a: float, b: float, derivatives: tuple) -> list[float]:
    """Of exp(a x + b y) at POINT."""
    value = np.exp(a * POINT[0] + b * POINT[1])
    return [value * a ** one.count(0) * b ** one.count(1) for one in derivatives]


@pytest.mark.parametrize("derivatives", [((),), SECOND, THIRD, PARTIAL])
def test_the_product_of_exponentials_is_one_of_the_sum(derivatives):
    taylor = Taylor(derivatives)
    f, g = (series(taylor, exponential(*ab, derivatives)) for ab in ((1.1, -0.4), (0.5, 2.0)))
    assert np.allclose(taylor.multiply(f, g), series(taylor, exponential(1.6, 1.6, derivatives)), rtol=1e-13)


@pytest.mark.parametrize("derivatives", [((),), SECOND, THIRD, PARTIAL])
def test_sine_and_cosine_of_a_polynomial(derivatives):
    # f = x^2 + 3 y, so d/dx = 2 x d/df + ..., by hand
    x, y = POINT
    f = x**2 + 3 * y
    s, c = np.sin(f), np.cos(f)
    sine = {
        (): s,
        (0,): 2 * x * c,
        (1,): 3 * c,
        (0, 0): 2 * c - 4 * x**2 * s,
        (0, 1): -6 * x * s,
        (1, 1): -9 * s,
        (0, 0, 0): -12 * x * s - 8 * x**3 * c,
        (0, 0, 1): -6 * s - 12 * x**2 * c,
        (0, 1, 1): -18 * x * c,
        (1, 1, 1): -27 * c,
    }
    given = {(): f, (0,): 2 * x, (1,): 3.0, (0, 0): 2.0}
    taylor = Taylor(derivatives)
    found, cosine = taylor.sine_cosine(series(taylor, [given.get(one, 0.0) for one in derivatives]))
    assert np.allclose(found, series(taylor, [sine[one] for one in derivatives]), rtol=0, atol=1e-13)
    one = taylor.multiply(found, found) + taylor.multiply(cosine, cosine)
    assert np.allclose(one, np.eye(len(derivatives))[0], rtol=0, atol=1e-13)


def test_correlating_is_the_transpose_of_multiplying():
    taylor, rng = Taylor(THIRD), np.random.default_rng(0)
    f, g, h = rng.standard_normal((3, len(THIRD), 5))
    assert np.isclose((taylor.multiply(f, g) * h).sum(), (g * taylor.correlate(f, h)).sum(), rtol=1e-13)


def test_orders_beyond_the_third_are_refused():
    with pytest.raises(ValueError, match="order 3"):
        Taylor(((), (0,), (0, 0), (0, 0, 0), (0, 0, 0, 0)))
