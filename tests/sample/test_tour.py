"""The order visits every row once, keeps neighbours together, and depends on the plan alone."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cfem.sample.tour import shards, skeleton, walk


@given(st.integers(1, 150), st.integers(1, 4), st.integers(1, 30), st.integers(1, 60), st.integers(0, 9))
def test_skeleton_and_shards_hold_every_row_once(m, n_a, count, size, seed):
    u = np.random.default_rng(seed).random((m, n_a))
    first = skeleton(u, count)
    pieces = shards(u, np.setdiff1d(np.arange(m), first), size)
    assert len(first) == min(m, count) and all(0 < len(piece) <= size for piece in pieces)
    np.testing.assert_array_equal(np.sort(np.concatenate([first, *pieces])), np.arange(m))


def test_repeated_rows_are_visited_too():
    u = np.zeros((9, 2))
    assert sorted(np.concatenate(shards(u, np.arange(9), 2))) == list(range(9))
    assert len(set(skeleton(u, 9))) == 9


def test_the_skeleton_spreads():
    u = np.random.default_rng(0).random((400, 2))
    first = u[skeleton(u, 16)]
    nearest = np.sqrt(((u[:, None] - first) ** 2).sum(axis=2)).min(axis=1)
    assert nearest.max() < 0.25
    np.testing.assert_array_equal(first[0], u[(u**2).sum(axis=1).argmin()])  # a walk that begins at rest


def test_steps_within_a_shard_are_short():
    u = np.random.default_rng(0).random((400, 2))
    pieces = shards(u, np.arange(400), 50)
    steps = np.concatenate([np.linalg.norm(np.diff(u[piece], axis=0), axis=1) for piece in pieces])
    assert steps.mean() < 0.06  # random order: 0.52


def test_a_walk_along_a_line_goes_straight():
    u = np.random.default_rng(1).permutation(20)[:, None] / 20
    np.testing.assert_array_equal(u[walk(u, np.arange(20)), 0], np.arange(20) / 20)
