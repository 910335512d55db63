"""Cables that are placed lie in the body, apart from its surface, at equal angles about its middle."""

import numpy as np
import pytest
from init.bodies import box_shape, corner, tapered, tube
from scipy.spatial import cKDTree

from cfem.constraint.attachment import locate
from cfem.core.errors import SpecError
from cfem.init.cables.line import attachment_radius, place_cables, read_cable, sections_along
from cfem.init.cables.spine import straight
from cfem.init.hold import guess_hold, read_hold, run_from


def placed(shape, count, hold=None):
    run = run_from(read_hold(hold, shape) if hold else guess_hold(shape)[0], shape)
    spine = straight(run)
    sections = sections_along(shape, spine)
    return *place_cables(shape, run, spine, sections, count, attachment_radius(sections, run)), run


def to_surface(mesh, points):
    """(k,) mm to the nearest of many points of the surface."""
    share = np.array([(a, b, 30 - a - b) for a in range(31) for b in range(31 - a)]) / 30
    return cKDTree((share @ mesh.X[mesh.facets]).reshape(-1, 3)).query(points)[0]


@pytest.mark.parametrize(
    "shape, count",
    [(tapered(), 1), (tapered(), 5), (tube(), 3), (box_shape(), 2), (tapered(0.6, 0.12, 0.08, 0.5, 0.05), 3)],
    ids=["one", "five", "hollow", "box", "tiny"],
)
def test_all_points_lie_inside_by_the_radius(shape, count):
    cables, radius, run = placed(shape, count)
    assert len(cables) == count and radius <= run.length / 40
    for cable in cables:
        assert (locate(shape.mesh, cable.points, within=1e-9)[0] >= 0).all()
        assert to_surface(shape.mesh, cable.points).min() > 0.98 * radius
        along = (cable.points[:, run.axis] - run.base) * run.forward
        assert (np.diff(along) > 0).all() and along[0] > 0 and 0.8 < along[-1] / run.length < 1
        assert cable.pull[run.axis] == run.base


def test_straight_cables_are_not_led_through_the_air_across_a_corner():
    with pytest.raises(SpecError, match=r"straight cables along x would leave the body near \(.*\) mm") as error:
        placed(corner(), 3)
    assert "--cable 'NAME:" in str(error.value)


def test_cables_stay_inside_by_the_radius_between_their_points():
    shape = tapered()
    cables, radius, _ = placed(shape, 3)
    for cable in cables:
        points = np.vstack([cable.points[:-1] + share * np.diff(cable.points, axis=0) for share in (0.25, 0.5, 0.75)])
        assert (locate(shape.mesh, points, within=1e-9)[0] >= 0).all()
        assert to_surface(shape.mesh, points).min() > 0.95 * radius


def test_they_are_near_the_surface_and_follow_the_body():
    shape = tapered(60.0, 12.0, 8.0, 0.5, 5.0)
    cables, radius, _ = placed(shape, 2)
    for cable, side in zip(cables, (1, -1), strict=True):  # across the thin way, y
        share = cable.points[:, 2] / 60
        np.testing.assert_allclose(cable.points[:, 0], 20 * share * (1 - share), atol=0.3)
        np.testing.assert_allclose(side * cable.points[:, 1], 4 * (1 - share / 2) - radius, atol=0.5)


def test_angles_are_equal():
    cables, _, _ = placed(box_shape(), 3)
    middle = np.array([30.0, 5.0, 5.0])
    for index in range(len(cables[0].points)):
        ways = np.array([(cable.points[index] - middle)[1:] for cable in cables])
        angles = np.sort(np.degrees(np.arctan2(ways[:, 1], ways[:, 0])) % 360)
        np.testing.assert_allclose(np.diff(angles), 120, atol=2)


def test_they_start_where_the_body_is_held():
    shape = box_shape()
    cables, _, _ = placed(shape, 2, "x >= 50 mm")
    for cable in cables:
        assert cable.pull[0] == 60 and cable.points[0, 0] < 50 and (np.diff(cable.points[:, 0]) < 0).all()


def test_no_room_is_said():
    shape = box_shape((60.0, 10.0, 10.0))
    run = run_from(guess_hold(shape)[0], shape)
    with pytest.raises(SpecError, match=r"no room for 3 cables along x.*--cable"):
        place_cables(shape, run, straight(run), sections_along(shape, straight(run)), 3, 40.0)


def test_a_cable_on_one_line():
    cable = read_cable("left: 0, 0, 5; 10, 0, 5; 2, 0, 0.5 cm")
    assert cable.name == "left" and cable.length == pytest.approx(20)
    np.testing.assert_allclose(cable.points, [[10, 0, 5], [20, 0, 5]])


@pytest.mark.parametrize(
    "text", ["left", "left: 0, 0, 5", ": 0, 0, 0; 1, 0, 0", "a: 0, 0; 1, 0, 0", "a b: 0,0,0; 1,0,0"]
)
def test_what_is_no_cable(text):
    with pytest.raises(ValueError, match=r"expected|a name has letters"):
        read_cable(text)
