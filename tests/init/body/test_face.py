"""Flat faces at the ends of a body that no axis is across."""

import numpy as np
import pytest
from init.bodies import box_shape, corner, inclined, tapered
from scipy.spatial.transform import Rotation

from cfem.core.errors import SpecError
from cfem.init.body.face import end_face, face_at
from cfem.init.hold import guess_hold, read_hold, run_from
from cfem.init.watch import guess_watched
from cfem.robot.selection import select_nodes

TURN = Rotation.from_rotvec(np.radians(30) * np.ones(3) / np.sqrt(3))
SHIFT = np.array([300.0, -200.0, 100.0])


def test_the_inclined_face_of_a_turned_body_is_held_and_the_other_one_is_watched():
    straight = box_shape((60.0, 12.0, 10.0))
    shape = inclined(straight)
    hold, why = guess_hold(shape)
    assert why.startswith("the face at one end")
    nodes = select_nodes(shape.mesh, hold.selection(), "fixed")
    np.testing.assert_array_equal(nodes, np.flatnonzero(np.isclose(straight.mesh.X[:, 0], 0)))
    np.testing.assert_allclose(hold.face.centre, TURN.apply([0, 6, 5]) + SHIFT, atol=0.02)
    np.testing.assert_allclose(hold.face.normal, TURN.apply([-1, 0, 0]), atol=1e-5)
    again = read_hold(str(hold), shape)
    np.testing.assert_array_equal(select_nodes(shape.mesh, again.selection(), "fixed"), nodes)
    watched, what = guess_watched(shape, run_from(hold, shape))
    assert what == "the centre of the free end"
    np.testing.assert_allclose(watched, TURN.apply([60, 6, 5]) + SHIFT, atol=0.02)
    assert hold.holds(TURN.apply([0, 1, 1]) + SHIFT) and not hold.holds(watched)


def test_a_face_across_an_axis_is_said_by_the_axis():
    assert guess_hold(box_shape())[0].face is None


def test_an_end_that_is_not_flat_has_no_face():
    shape = tapered(60.0, divisions=(4, 4, 20))
    shape.mesh.X[:, 2] += 0.02 * (shape.mesh.X[:, 0] ** 2 + shape.mesh.X[:, 1] ** 2)
    assert end_face(shape, 2, True) is None
    assert "slice" in guess_hold(shape)[1]


def test_a_face_that_the_body_goes_beyond_is_refused():
    shape = corner(leg=60.0, side=10.0)
    with pytest.raises(SpecError, match="the body goes beyond the face at"):
        face_at(shape, np.array([30.0, 10.0, 5.0]))
    assert face_at(shape, np.array([30.0, 0.0, 5.0])).normal == (0, -1, 0)


def test_a_face_is_written_as_others_are():
    shape = inclined(box_shape())
    with pytest.raises(ValueError, match="expected three coordinates"):
        read_hold("face at the left", shape)
