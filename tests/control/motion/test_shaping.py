"""Shapers against the closed form of an oscillator."""

import numpy as np
import pytest

from cfem.control.motion.shaping import shaper

F, ZETA = 8.0, 0.07


def vibration(found, f, zeta):
    """Amplitude that impulses leave in x'' + 2 zeta w x' + w^2 x = 0 after the last of them, over that of one impulse
    at the same time, by its impulse response on a fine grid, its decay taken off."""
    omega = 2 * np.pi * f
    damped = omega * np.sqrt(1 - zeta**2)
    t = found.time.max() + np.linspace(0, 1 / f, 2001)

    def response(since):
        return np.exp(-zeta * omega * since) * np.sin(damped * since)

    total = sum(a * response(t - s) for a, s in zip(found.amplitude, found.time, strict=True))
    grown = np.exp(zeta * omega * (t - found.time.max()))
    return np.abs(total * grown).max() / np.abs(response(t - found.time.max()) * grown).max()


@pytest.mark.parametrize("kind", ["zv", "zvd"])
def test_no_vibration_is_left(kind):
    found = shaper(kind, np.array([F]), np.array([ZETA]))
    assert found.amplitude.sum() == pytest.approx(1)
    assert vibration(found, F, ZETA) < 1e-12 and found.residual(F, ZETA) < 1e-12


@pytest.mark.parametrize("kind", ["zv", "zvd"])
def test_what_is_left_of_other_modes_is_that_of_the_oscillator(kind):
    found = shaper(kind, np.array([F]), np.array([ZETA]))
    for f in (7.0, 9.5):
        assert found.residual(f, ZETA) == pytest.approx(vibration(found, f, ZETA), rel=1e-3)


def test_zvd_is_flat_about_its_frequency():
    """A frequency that is wrong by 5 % leaves 8 % of the vibration with two impulses, and its square with three."""
    zv, zvd = (shaper(kind, np.array([F]), np.array([0.0])).residual(1.05 * F, 0.0) for kind in ("zv", "zvd"))
    assert zv == pytest.approx(np.cos(np.pi / 2 * 1.05) * -1, rel=1e-9)
    assert zvd == pytest.approx(zv**2, rel=1e-9)


def test_modes_are_shaped_one_after_the_other():
    both = shaper("zv", np.array([F, 11.0]), np.array([ZETA, 0.1]))
    assert len(both.time) == 4 and both.residual(F, ZETA) < 1e-12 and both.residual(11.0, 0.1) < 1e-12


def test_ticks_keep_sum_and_mean():
    """Linear interpolation between ticks keeps both; commands are taken from later by the delay."""
    found = shaper("zvd", np.array([F]), np.array([ZETA]))
    weights, later = found.ticks(0.01)
    ago = np.arange(len(weights)) - later
    assert weights.sum() == pytest.approx(1) and weights @ ago == pytest.approx(0, abs=1e-12)
