"""Rounds that converge linearly, or not at all: maps whose fixed points are known."""

import numpy as np
import pytest

from cfem.contact.acceleration import DEPENDENT, DEPTH, FIRST, Acceleration


def fixed_point(M, b, rounds, rows=lambda k: 0):
    """Distances from the fixed point of x -> M x + b after each round, and whether each combined answers."""
    x, acceleration, exact = np.zeros(len(b)), Acceleration(), np.linalg.solve(np.eye(len(b)) - M, b)
    distances, combined = [], []
    for k in range(rounds):
        answer = M @ x + b
        ahead = acceleration.next(rows(k), answer, answer - x)
        x = answer if ahead is None else ahead
        distances.append(np.linalg.norm(x - exact) / np.linalg.norm(exact))
        combined.append(ahead is not None)
    return np.array(distances), combined


def spiral(rate, angle):
    return rate * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize("rate", [0.85, 1.2])
def test_two_directions_that_spiral_end_with_the_third_answer(rate):
    """Two differences span them, also where plain rounds leave the fixed point, to what `DEPENDENT` leaves out."""
    distances, combined = fixed_point(spiral(rate, 1.1), np.array([1.0, 0.3]), FIRST)
    assert combined == [False] * (FIRST - 1) + [True]
    assert distances[-1] < 10 * DEPENDENT < 0.1 < distances[-2]


def test_many_directions_converge_in_fewer_rounds():
    rng = np.random.default_rng(3)
    Q = np.linalg.qr(rng.normal(size=(12, 12)))[0]
    M = Q @ np.diag([-0.9, 0.85, -0.8, *(0.3 * rng.uniform(-1, 1, 9))]) @ Q.T
    distances, _ = fixed_point(M, rng.normal(size=12), 20)
    plain = 0.9 ** np.arange(1, 21)
    assert (distances < 1e-8).argmax() < 16 and plain[-1] > 0.1


def test_answers_on_other_rows_are_not_combined():
    M, b = spiral(0.85, 1.1), np.array([1.0, 0.3])
    changes = fixed_point(M, b, 5, rows=lambda k: k // 2)
    assert not any(changes[1])
    again = fixed_point(M, b, 4 + FIRST, rows=lambda k: k >= 4)
    assert again[1] == [False, False, True, True] + [False] * (FIRST - 1) + [True]


def test_what_was_forgotten_is_not_combined():
    acceleration = Acceleration()
    for x in (np.zeros(2), np.ones(2)):
        assert acceleration.next(0, x, x + 1) is None
    acceleration.forget()
    assert acceleration.next(0, np.ones(2), np.ones(2)) is None


def test_answers_that_depend_on_each_other_stay_finite():
    """The same answer again and again, and more answers than directions."""
    acceleration, x = Acceleration(), np.array([1.0, 2.0])
    for _ in range(DEPTH + 3):
        ahead = acceleration.next(0, x, np.zeros(2))
    np.testing.assert_array_equal(ahead, x)
    distances, _ = fixed_point(spiral(0.5, 0.0), np.array([1.0, 1.0]), 8)
    assert np.isfinite(distances).all() and distances[-1] < 1e-8
