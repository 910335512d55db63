"""Patches on obstacles, in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.contact.obstacle import Sphere
from cfem.contact.obstacle_set import ObstacleSet
from cfem.predict.contact.step.on_obstacles import NOTHING, OnObstacles, ended, held_by_friction


def test_what_sticks_is_held_where_it_was_on_the_surface_and_what_slides_where_it_is():
    places = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.2], [2.0, 0.0, -0.1], [3.0, 0.0, 4.0]])
    stuck = places + [0.3, -0.2, 0.5]
    frames, push, sticks = np.tile(np.eye(3)[[2, 0, 1]], (3, 1, 1)), np.zeros((4, 3)), np.arange(4) == 2
    push[[1, 2], 2] = 1.0
    stood, goes = (np.eye(3)[None], np.zeros((1, 3))), (np.eye(3)[None], np.array([[0.5, 0.0, 2.0]]))
    of_near = np.array([0, 1, 2]), push, sticks, np.zeros(4, dtype=np.int64), frames
    for now, along in ((stood, 0.0), (goes, 0.5)):
        held = held_by_friction(places, stuck, *of_near, *stood, *now, along > 0)
        assert np.isnan(held[[0, 3]]).all()
        np.testing.assert_allclose(held[1], places[1])
        np.testing.assert_allclose(held[2], [2.3 + along, -0.2, -0.1])  # its slip stays, its gap is none


@pytest.mark.parametrize("keeps", [True, False])
def test_pairs_depend_on_their_own_patch_alone_and_what_is_far_is_forgotten(keeps):
    """Patch 3 is pressed, 1 overlaps, 2 is near, and 0 is far."""
    places, push, sticks = np.arange(12.0).reshape(4, 3), np.zeros((4, 3)), np.zeros(4, dtype=bool)
    push[3, 1], near, frames = 2.0, np.arange(4), np.arange(36.0).reshape(4, 3, 3)
    which, distance = np.array([0, 1, 0, 1]), np.array([0.3, -0.1, 0.05, 0.0])
    poses = (np.eye(3)[None], np.zeros((1, 3))) * 2
    of_near = places, places + 1, near, push, sticks, which, frames, distance
    end = ended(*of_near, (*poses, False), 0.1, keeps, 5)
    pairs = end.pairs
    np.testing.assert_array_equal(pairs.slots, [5, 7])
    np.testing.assert_array_equal(pairs.points, [1, 3])
    np.testing.assert_array_equal(pairs.relative, [[0, 1, 0, 0], [0, 0, 0, 1]])
    np.testing.assert_array_equal(pairs.partners, [6, 6])
    np.testing.assert_array_equal(pairs.gaps, [-0.1, 0.0])
    np.testing.assert_array_equal(pairs.frames, frames[[1, 3]])
    np.testing.assert_array_equal(end.push, [[0, 0, 0], [0, 2, 0]])
    assert end.touching.tolist() == [1, 3] and end.near.tolist() == [1, 2, 3] and end.met.tolist() == [1, 0, 1]
    assert np.isnan(end.stuck[:3]).all() and np.array_equal(end.stuck[3], places[3]) == keeps


@pytest.mark.parametrize(("near", "pressing", "turns"), [([1], 2.0, True), ([1], 0.0, False), ([], 0.0, False)])
def test_forces_turn_where_a_patch_presses_a_ball(near, pressing, turns):
    """As a patch goes by dx along a ball of 5 mm its normal turns by dx / 5 mm: a force of 2 N by 0.4 N/mm."""
    scene = SimpleNamespace(bodies=[None] * 2)
    met = OnObstacles(SimpleNamespace(scene=scene, obstacles=ObstacleSet((Sphere(5.0),))), None)
    met.near, met.push[1] = np.array(near, dtype=NOTHING.dtype), [0.0, 0.0, pressing]
    places, known = np.array([[0.0, 0.0, 9.0], [0.0, 0.0, 5.0]]), np.arange(2)
    turned = met.turned(0.1 * np.eye(6), places, known)
    assert (turned is not None) == turns
    if turns:
        moved = np.linalg.solve(np.eye(6) / 0.1 - np.diag([0, 0, 0, 0.4, 0.4, 0]), [1.0, 0, 0, 1.0, 0, 1.0])
        np.testing.assert_allclose(turned.compliance @ [1.0, 0, 0, 1.0, 0, 1.0], moved, atol=1e-12)
