"""Fibres of rubber: against sums over the disc, and differences of their own energy."""

import numpy as np
import pytest

from cfem.mechanics.rod.fibres import beyond_linear

YOUNG, RADIUS = 0.3, 5.0
AREA = np.pi * RADIUS**2


def beyond(eps, kappa):
    found = beyond_linear(np.array([eps]), np.array([kappa]), np.array([YOUNG]), np.array([AREA]), np.array([RADIUS]))
    return found.energy[0], found.force[0], found.tangent[0]


def energy_of_a_disc(eps, kappa):
    """By midpoints of rings and angles."""
    r = (np.arange(400) + 0.5) / 400 * RADIUS
    phi = (np.arange(90) + 0.5) / 90 * 2 * np.pi
    y, z = np.outer(r, np.cos(phi)), np.outer(r, np.sin(phi))
    lam = 1 + eps + kappa[0] * z - kappa[1] * y
    W = YOUNG / 6 * (lam**2 + 2 / lam - 3) - YOUNG / 2 * (lam - 1) ** 2
    return (W.mean(axis=1) * 2 * np.pi * r).sum() * RADIUS / 400


@pytest.mark.parametrize(("eps", "kappa"), [(-0.1, (0.03, -0.05)), (0.2, (0.0, 0.02)), (-0.2, (0.0, 0.0))])
def test_energy_is_the_sum_over_the_disc(eps, kappa):
    assert beyond(eps, kappa)[0] == pytest.approx(energy_of_a_disc(eps, kappa), rel=1e-4)


@pytest.mark.parametrize(("eps", "kappa"), [(-0.1, (0.03, -0.05)), (0.1, (1e-9, 0.0)), (-0.3, (0.12, 0.1))])
def test_force_and_tangent_are_derivatives(eps, kappa):
    _, force, tangent = beyond(eps, kappa)
    at, h = np.array([eps, *kappa]), 1e-6
    for i, step in enumerate(h * np.eye(3)):
        ahead, behind = (beyond(one[0], one[1:]) for one in (at + step, at - step))
        assert (ahead[0] - behind[0]) / (2 * h) == pytest.approx(force[i], rel=1e-8, abs=1e-7)
        np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * h), tangent[:, i], rtol=1e-6, atol=1e-4)


def test_pulled_and_pressed_fibres_are_uniaxial_rubber():
    lam = 0.8
    force = beyond(lam - 1, (0.0, 0.0))[1][0] + YOUNG * AREA * (lam - 1)
    assert force == pytest.approx(YOUNG / 3 * AREA * (lam - lam**-2))
