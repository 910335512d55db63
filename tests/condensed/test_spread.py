import numpy as np
import pytest

from cfem.condensed.spread import outermost, spread


def test_each_point_is_the_farthest_from_those_before():
    points = np.random.default_rng(0).normal(size=(60, 3))
    chosen = spread(points, 10, 7)
    assert chosen[0] == 7 and len(set(chosen.tolist())) == 10
    for number in range(1, 10):
        apart = np.linalg.norm(points[:, None] - points[chosen[:number]], axis=2).min(axis=1)
        assert apart[chosen[number]] == pytest.approx(apart.max())


def test_equal_points_are_chosen_once_each():
    assert sorted(spread(np.zeros((4, 2)), 9, 2).tolist()) == [0, 1, 2, 3]


def test_no_point_is_farther_from_the_middle_than_the_outermost():
    points = np.random.default_rng(1).normal(size=(30, 2))
    distance = np.linalg.norm(points - 0.3, axis=1)
    assert distance[outermost(points, np.full(2, 0.3))] == distance.max()
