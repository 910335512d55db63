"""Rotations of parts of a surface, against the singular values of Kabsch's method, and where a part is flat."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cfem.mechanics.surface_turns import members_of, rotations, spread

RNG = np.random.default_rng(4)


def kabsch(spreads):
    left, _, right = np.linalg.svd(spreads)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return left @ right


@pytest.mark.parametrize("height", [1.0, 0.1, 1e-3, 0.0])
def test_the_rotation_that_fits_best_is_that_of_singular_values(height):
    """Of parts between round and flat, long and short, that are stretched and sheared by 10 % beside."""
    spreads = []
    for turn in Rotation.random(50, rng=RNG).as_matrix():
        rest = RNG.normal(size=(8, 3)) * [1.0, RNG.uniform(0.2, 1.0), height]
        moved = rest @ (turn @ (np.eye(3) + 0.1 * RNG.normal(size=(3, 3)))).T
        spreads.append((moved - moved.mean(axis=0)).T @ (rest - rest.mean(axis=0)))
    spreads = np.array(spreads)
    np.testing.assert_allclose(rotations(spreads), kabsch(spreads), atol=1e-13)
    np.testing.assert_allclose(rotations(1e4 * spreads), rotations(spreads), atol=1e-13)


def test_parts_that_turn_as_a_whole_are_found_turned_so():
    """A flat strip and a corner of three triangles."""
    rest = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [5, 5, 5], [6, 5, 5], [5, 6, 5], [5, 5, 6]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [4, 7, 5]])
    members = members_of(triangles, np.repeat([0, 1], 4), 2)
    turn = Rotation.from_rotvec([0.4, -1.2, 2.0]).as_matrix()
    found = rotations(spread(members, rest, rest @ turn.T + [3.0, 1.0, -2.0]))
    np.testing.assert_allclose(found, [turn, turn], atol=1e-13)
