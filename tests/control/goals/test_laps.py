import numpy as np
import pytest

from cfem.control.goals.laps import laps

ANGLE = 2 * np.pi * np.arange(40) / 40
CIRCLE = 5 * np.stack([np.cos(ANGLE), np.sin(ANGLE)], axis=1)


def test_a_circle_is_run_at_its_speed():
    goals, before = laps(CIRCLE, 2.0, 3, 0.5, 0.01)
    assert before == 50 and len(goals) == 50 + 150
    np.testing.assert_allclose(np.linalg.norm(goals, axis=1), 5, atol=1e-4)
    pace = np.linalg.norm(np.diff(goals, axis=0), axis=1) / 0.01
    np.testing.assert_allclose(pace[51:], 2 * 2 * np.pi * 5, rtol=2e-3)
    np.testing.assert_allclose(pace[:49], pace[51] * (np.arange(1, 50) + 0.5) / 50, rtol=2e-3)


def test_the_last_point_may_be_the_first():
    closed = np.concatenate([CIRCLE, CIRCLE[:1]])
    np.testing.assert_allclose(laps(closed, 1.0, 1, 0.0, 0.01)[0], laps(CIRCLE, 1.0, 1, 0.0, 0.01)[0])


def test_without_run_up_it_starts_at_once():
    goals, before = laps(CIRCLE, 1.0, 1, 0.0, 0.25)
    assert before == 0
    assert goals == pytest.approx(np.array([[0, 5], [-5, 0], [0, -5], [5, 0]]), abs=1e-6)
