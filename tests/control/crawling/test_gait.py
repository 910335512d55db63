"""Gaits: commands from shares, and the search for the one that goes farthest."""

import numpy as np
import pytest
from scipy.stats import qmc

from cfem.control.crawling.gait import DRAWN, Gait, best_gait, commands_of


def test_commands_follow_the_cosine_within_the_range_and_mirrored_legs_swap_actuators():
    gait = Gait.of(np.array([0.5, 0.6, 0.5, 0.2, 0.25]))
    u = commands_of(gait, [False, True], (1.0, 3.0), 8, 2)
    assert u.shape == (16, 4)
    np.testing.assert_allclose(u[:8], u[8:])
    np.testing.assert_allclose(u[:, :2], u[:, :1:-1])
    phi = np.arange(1, 9) / 8
    np.testing.assert_allclose(u[:8, 0], 1 + 2 * (0.5 + 0.5 * np.cos(2 * np.pi * phi)))
    np.testing.assert_allclose(u[:8, 1], 1 + 2 * (0.6 + 0.2 * np.cos(2 * np.pi * (phi - 0.25))))


def test_shares_beyond_the_range_are_cut():
    leg = Gait(np.array([0.9]), np.array([0.5]), np.array([0.0])).leg(4)
    assert leg.max() == 1.0 and leg.min() == pytest.approx(0.4)


def test_a_gait_encloses_the_area_of_its_polygon():
    ring = Gait(np.array([0.5, 0.4]), np.array([0.3, 0.2]), np.array([0.0, 0.25]))
    x, y = ring.leg(8).T
    polygon = sum(x[i - 1] * y[i] - x[i] * y[i - 1] for i in range(8)) / 2
    assert ring.encloses(8) == pytest.approx(abs(polygon), rel=1e-12)
    assert ring.encloses(1000) == pytest.approx(np.pi * 0.3 * 0.2, rel=1e-4)
    assert Gait(ring.mean, ring.amplitude, np.array([0.0, 0.5])).encloses(8) == pytest.approx(0, abs=1e-15)


def test_the_best_of_a_known_landscape_is_found_and_pushing_costs():
    """Distance is largest at means (0.3, 0.7), full amplitude and a quarter turn, but the best means push."""

    def distance(gait):
        missed = (
            np.sum((gait.mean - [0.3, 0.7]) ** 2) + np.sum((gait.amplitude - 0.5) ** 2) + (gait.phase[1] - 0.25) ** 2
        )
        return 5.0 - missed, min(0.0, gait.mean[0] - 0.4)

    gait, far = best_gait(distance, 2, 8, 400)
    assert far > 4.97
    np.testing.assert_allclose(gait.mean, [0.4, 0.7], atol=0.05)
    assert gait.phase[1] == pytest.approx(0.25, abs=0.08)


def test_a_gait_that_goes_far_backwards_is_tried_in_reverse():
    """Of the gaits tried all over, one alone is near a good one: in its mirror image in time."""
    drawn = [Gait.of(shares) for shares in qmc.Halton(5, seed=1).random(5 * DRAWN)]
    backwards = max(drawn[-DRAWN:], key=lambda gait: gait.encloses(8))
    asked, sense = [], np.sign(np.sin(2 * np.pi * backwards.phase[1]))

    def distance(gait):
        asked.append(gait)
        alike = np.abs(gait.mean - backwards.mean).max() + np.abs(gait.amplitude - backwards.amplitude).max() < 0.2
        return (-sense * float(np.sin(2 * np.pi * gait.phase[1])) if alike else 0.0), 0.0

    assert distance(backwards)[0] < 0
    _, far = best_gait(distance, 2, 8, 20)
    assert far >= -distance(backwards)[0] and len(asked) <= 22


def test_gaits_that_cannot_be_walked_are_left_out():
    _, far = best_gait(lambda gait: (np.nan if gait.mean[0] > 0.5 else float(gait.mean[0]), 0.0), 1, 8, 40)
    assert 0.3 < far <= 0.5
