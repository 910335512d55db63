"""The way through the middle of a body, measured against shapes whose middle is known."""

import numpy as np
import pytest
from init.bodies import box_shape, corner, frame, tapered

from cfem.init.cables.centreline import centreline
from cfem.init.hold import guess_hold, read_hold, run_from


def line(shape, held=None):
    hold = read_hold(held, shape) if held else guess_hold(shape)[0]
    return centreline(shape.voxels, run_from(hold, shape))


def test_cubes_fill_the_body_and_know_their_depth():
    shape = box_shape()
    cubes = shape.voxels
    assert cubes.inside.sum() * cubes.step**3 == pytest.approx(6000, rel=0.15)  # half a cube at each face
    middle = np.array([[30.0, 5, 5], [30, 5, 2], [30, 5, 12]])
    np.testing.assert_allclose(cubes.depth_at(middle), [5, 2, 0], atol=cubes.step)


def test_it_follows_a_bent_bar():
    found = line(tapered(60.0, 12.0, 8.0, 0.5, 5.0))
    share = found.points[:, 2] / 60
    np.testing.assert_allclose(found.points[:, 0], 20 * share * (1 - share), atol=0.6)
    np.testing.assert_allclose(found.points[:, 1], 0, atol=0.3)
    assert found.branches == 1 and found.length == pytest.approx(60, rel=0.1)


def test_it_turns_at_a_corner():
    found = line(corner(), "y >= 60 mm")
    assert found.length == pytest.approx(110, rel=0.1)
    np.testing.assert_allclose(found.tangents[2], [0, -1, 0], atol=0.05)
    np.testing.assert_allclose(found.tangents[-3], [1, 0, 0], atol=0.05)


def test_a_ring_has_two_branches():
    assert line(frame()).branches == 2
