import numpy as np
import pytest

from cfem.control.task.goals.trajectory import arc, half_sphere, laps, loop_of_shares, with_approach


def test_quarter_circle_of_the_finger():
    goals = arc(np.zeros(3), 120.0, -np.pi / 2, 0.0, "yz", 40)
    np.testing.assert_allclose(goals[[0, -1]], [[0, 0, -120], [0, 120, 0]], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(goals, axis=1), 120.0)
    assert np.ptp(np.linalg.norm(np.diff(goals, axis=0), axis=1)) < 1e-12


@pytest.mark.parametrize("plane, axis", [("xy", 2), ("yz", 0), ("zx", 1)])
def test_arcs_stay_in_their_plane(plane, axis):
    assert (arc(np.array([1.0, 2.0, 3.0]), 5.0, 0.0, 6.0, plane, 9)[:, axis] == axis + 1.0).all()


def test_half_spheres_spiral_from_the_top_down_to_the_equator():
    centre = np.array([1.0, 2.0, 3.0])
    goals = half_sphere(centre, 195.0, 2.25, 37) - centre
    np.testing.assert_allclose(np.linalg.norm(goals, axis=1), 195.0)
    np.testing.assert_allclose(goals[[0, -1]], [[0, 0, 195], [0, 195, 0]], atol=1e-9)  # two turns and a quarter
    assert (np.diff(goals[:, 2]) < 0).all()
    np.testing.assert_allclose(np.diff(np.arccos(goals[1:, 2] / 195)), np.pi / 72, rtol=1e-6)
    turned = np.diff(np.unwrap(np.arctan2(goals[1:, 1], goals[1:, 0])))
    np.testing.assert_allclose(turned, 2.25 * 2 * np.pi / 36)


@pytest.mark.parametrize("n_a", [1, 2, 3])
def test_loops_close_and_stay_in_the_cube(n_a):
    shares = loop_of_shares(np.full(n_a, 0.5), np.full(n_a, 0.4), 24)
    assert shares.shape == (24, n_a)
    assert shares.min() >= 0.1 - 1e-12 and shares.max() <= 0.9 + 1e-12
    step = np.linalg.norm(np.roll(shares, -1, axis=0) - shares, axis=1)
    assert step[-1] <= step.max() + 1e-12


def test_an_approach_ends_a_step_before_the_first_goal():
    goals = arc(np.array([0.0, 0.0, 10.0]), 4.0, 0.0, np.pi, "xy", 3)
    found = with_approach(goals, np.array([0.0, 0.0, 10.0]), 4)
    np.testing.assert_allclose(found[:4], [[0, 0, 10], [1, 0, 10], [2, 0, 10], [3, 0, 10]])
    np.testing.assert_array_equal(found[4:], goals)
    np.testing.assert_array_equal(with_approach(goals, goals[1], 0), goals)


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
