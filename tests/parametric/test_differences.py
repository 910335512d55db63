"""Differences against derivatives that are known, and their order."""

import numpy as np
import pytest

from cfem.parametric.differences import Stencil, with_slopes

Z = np.array([0.3, 0.7])


def wave(z):
    return np.stack([np.sin(3 * z[:, 0]) * np.exp(z[:, 1]), z[:, 0] ** 2 * z[:, 1]], axis=1)


EXACT = np.array([[3 * np.cos(0.9) * np.exp(0.7), np.sin(0.9) * np.exp(0.7)], [2 * 0.3 * 0.7, 0.3**2]])


def test_value_and_slopes_of_a_batched_function():
    value, slopes = with_slopes(wave, Z, Stencil(6, 0.01))
    assert np.array_equal(value, wave(Z[None])[0])
    assert slopes == pytest.approx(EXACT, abs=2e-11)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_the_error_falls_with_the_order(order):
    errors = [np.abs(with_slopes(wave, Z, Stencil(order, step))[1] - EXACT).max() for step in (0.2, 0.1)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


def test_no_coordinates_have_no_slopes():
    value, slopes = with_slopes(lambda z: np.ones((len(z), 3)), np.zeros(0), Stencil(2, 0.1))
    assert value.shape == (3,) and slopes.shape == (3, 0)
