"""Closed inner surfaces are found with their volumes, and a point inside each."""

import numpy as np
import pytest
from init.bodies import box_shape, chambered, tube

from cfem.constraint.cavity import enclosed, make_cavity
from cfem.init.chambers import chambers_of, read_chamber


def test_each_room_is_a_chamber_of_its_volume():
    shape = chambered()
    large, small = chambers_of(shape)
    assert (large.name, small.name) == ("chamber-1", "chamber-2")
    assert (large.volume, small.volume) == pytest.approx((14 * 36, 12 * 36))
    for each in (large, small):
        wall = shape.mesh.facets[enclosed(shape.mesh, each.inside)]
        assert make_cavity(shape.mesh.X, wall, each.name).rest_volume == pytest.approx(each.volume)
        assert np.linalg.norm(each.corners.reshape(-1, 3) - each.inside, axis=1).min() > 2


def test_a_body_without_one_has_none():
    assert chambers_of(box_shape()) == () and chambers_of(tube()) == ()


def test_a_chamber_is_stated_by_a_point_inside(tmp_path):
    shape = chambered()
    found = read_chamber("left: 10, 6, 6", shape)
    assert found.name == "left" and found.volume == pytest.approx(12 * 36)
    np.testing.assert_array_equal(found.inside, [10, 6, 6])


def test_a_chamber_is_stated_by_a_file_of_its_surface(tmp_path):
    from init.bodies import write_stl

    write_stl(tmp_path / "room.stl", (20.0, 6.0, 6.0))  # from the origin: its middle lies in the left room
    shape = chambered()
    shape.mesh.X[:] -= [0, 3, 3]
    assert read_chamber(f"left: {tmp_path / 'room.stl'}", shape).volume == pytest.approx(12 * 36)


@pytest.mark.parametrize(
    "text, part", [("left", "expected 'NAME"), ("left: 1, 1, 1", "no closed inner surface is around")]
)
def test_what_is_no_chamber(text, part):
    with pytest.raises(ValueError, match=part):
        read_chamber(text, chambered())
