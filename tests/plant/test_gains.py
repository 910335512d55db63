import numpy as np
import pytest
from control.loop_poles import integral_bound, poles

from cfem.plant.gains import integral_for, late_samples


def response(integral, late, m, proportional=0.0, ticks=400, noise=0.0, seed=0):
    """The loop by hand: x = m g, the controller hears of x `late` + 1 ticks later."""
    random = np.random.default_rng(seed)
    total, heard, x = 0.0, [0.0] * (late + 1), []
    for _ in range(ticks):
        error = 1.0 - heard[0]
        total += integral * error
        x.append(m * (1.0 + total + proportional * error))
        heard = [*heard[1:], x[-1] + noise * random.standard_normal()]
    return np.array(x)


@pytest.mark.parametrize("late", [0, 1, 2, 5])
def test_stability_ends_at_the_bound(late):
    bound = integral_bound(late)
    assert np.abs(poles(0, 0.999 * bound, late)).max() < 1
    assert np.abs(poles(0, 1.001 * bound, late)).max() > 1
    assert abs(response(0.9 * bound, late, 1.0)[-1] - 1) < 1e-2 < abs(response(1.1 * bound, late, 1.0)[-1] - 1)


def test_known_bounds():
    assert integral_bound(0) == pytest.approx(2) and integral_bound(1) == pytest.approx(1)
    assert integral_bound(2) == pytest.approx((np.sqrt(5) - 1) / 2)


@pytest.mark.parametrize("late", [0, 1, 3])
@pytest.mark.parametrize("margin", [30, 45, 60])
def test_phase_margin_read_off_the_open_loop(late, margin):
    integral = integral_for(np.deg2rad(margin), late)
    w = np.linspace(1e-3, np.pi, 400_001)
    loop = integral * np.exp(-1j * w * late) / (np.exp(1j * w) - 1)
    crossing = np.argmax(np.abs(loop) < 1)
    assert np.rad2deg(np.pi + np.unwrap(np.angle(loop))[crossing]) == pytest.approx(margin, abs=0.02)


def test_one_sample_late_sixty_degrees_bear_stiffness_wrong_by_half():
    integral = integral_for(np.deg2rad(60), 1)
    assert integral == pytest.approx(0.3473, abs=1e-4)
    assert integral_bound(1) / integral == pytest.approx(2.879, abs=1e-3)
    for share in (-0.5, 0.5):
        assert np.abs(poles(0, integral, 1, 1 / (1 + share))).max() < 0.84


@pytest.mark.parametrize("late, proportional", [(0, 0.0), (1, 0.0), (1, 0.1), (2, 0.05)])
def test_the_slowest_pole_is_the_rate_of_decay(late, proportional):
    integral, m = 0.1, 0.8
    error = np.abs(response(integral, late, m, proportional, ticks=60) - 1)
    slowest = np.abs(poles(proportional, integral, late, m)).max()
    assert (error[50] / error[30]) ** (1 / 20) == pytest.approx(slowest, rel=0.02)


@pytest.mark.parametrize(
    "delay, ticks, late", [(0, 1, 0), (1, 1, 1), (1, 2, 0), (3, 2, 1), (0, 11.1, 0), (12, 11.1, 1)]
)
def test_late_samples(delay, ticks, late):
    assert late_samples(delay, ticks) == late
