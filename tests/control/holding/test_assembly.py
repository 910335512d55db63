"""Control of held objects begins where the model has data; a box has the surface that a box has."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.contact.obstacle import Box
from cfem.contact.surface.facets import unmatched_edges
from cfem.control.holding.assembly import (
    TOUCHES,
    WITHIN,
    _demand_touch,
    _stable,
    _taut_state,
    box_surface,
    place_of,
    table_under,
)
from cfem.control.holding.spec import RobotSpec
from cfem.core.errors import InputError, NumericalError


def test_it_begins_at_the_training_state_nearest_to_the_middle_of_their_box():
    """Two actuators and a pose of one coordinate; in shares of each range, the third state is 0.1 off."""
    displacements = np.array([[0.0, 0.0, 5.0], [10.0, 2.0, 7.0], [4.0, 1.0, 6.2], [2.0, 1.9, 5.0]])
    states = np.hstack([displacements, np.zeros((4, 3))])
    predictor = SimpleNamespace(domain=SimpleNamespace(states=states))
    np.testing.assert_array_equal(_taut_state(predictor, 1), [4.0, 1.0])


@pytest.mark.parametrize("width", [3, 4, 6])
def test_the_surface_of_a_box_is_closed_and_holds_its_volume(width):
    """Volume by the divergence theorem, facet by facet, as triangles about the first node; middles lie on straight
    sides."""
    points, facets = box_surface((1.0, -2.0, 0.5), np.array([2.0, 3.0, 4.0]), width)
    corners = facets[:, :4] if width == 4 else facets[:, :3]
    fans = [corners[:, [0, k, k + 1]] for k in range(1, corners.shape[1] - 1)]
    volume = sum(np.linalg.det(points[fan]).sum() / 6 for fan in fans)
    assert volume == pytest.approx(4 * 6 * 8)
    places = np.unique(points, axis=0, return_inverse=True)[1].ravel()  # facets of six nodes share none of them
    assert unmatched_edges(places[facets]).size == 0


def test_a_robot_is_turned_about_the_scenes_origin_and_then_shifted():
    plain = RobotSpec(name="a")
    for found, expected in zip(place_of(plain), (np.eye(3), np.zeros(3)), strict=True):
        np.testing.assert_array_equal(found, expected)
    turn = {"axis": [0, 0, 2], "angle": "90 deg"}
    R, t = place_of(RobotSpec(name="a", rotate=turn, translate={"mm": [1, 2, 3]}))
    np.testing.assert_allclose(R @ [1.0, 0, 0] + t, [1.0, 3.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(R @ [0.0, 0, 5.0], [0.0, 0.0, 5.0], atol=1e-12)


@pytest.mark.parametrize(
    ("holds", "expected"), [([1.0], 1.0), ([0.5, 0.3], 0.5), ([0.25], 0.25), ([0.0], 0.0), ([0.1], None)]
)
def test_robots_begin_as_taut_as_they_hold_the_object(monkeypatch, holds, expected):
    taut, tried = np.array([2.0, 4.0]), []

    class Coupled:
        def __init__(self, *of):
            assert of == ("robots", "object")

        def at_displacement(self, delta):
            tried.append(delta[0] / 2.0)
            if tried[-1] not in holds:
                raise NumericalError("nobody holds it")

    monkeypatch.setattr("cfem.control.holding.assembly.Coupled", Coupled)
    if expected is None:
        with pytest.raises(NumericalError, match="nobody holds it"):
            _stable("robots", "object", taut)
        assert tried == [1.0, 0.5, 0.25, 0.0]
        return
    np.testing.assert_array_equal(_stable("robots", "object", taut), expected * taut)
    assert tried == [share for share in (1.0, 0.5, 0.25, 0.0) if share >= expected]


@pytest.mark.parametrize(
    ("table", "gap", "said"),
    [
        (False, 0.0, None),
        (False, 0.99 * TOUCHES, None),
        (False, 0.5, "contact point 'tip' of robot 'right' does not reach the object: 0.5 mm are missing"),
        (False, -0.5, "contact point 'tip' of robot 'right' is 0.5 mm inside the object"),
        (True, 0.5, None),
        (True, -0.5, "contact point 'tip' of robot 'right' is 0.5 mm inside the object"),
    ],
)
def test_contact_points_that_do_not_touch_the_object_are_named(table, gap, said):
    """The second point of the second robot, beside a box of 4 mm; others touch it."""
    spec = SimpleNamespace(
        object=SimpleNamespace(table=table), robots=[SimpleNamespace(name=name) for name in ("left", "right")]
    )
    robot = SimpleNamespace(rows=SimpleNamespace(contacts=tuple(f"{at}.{k}" for at in ("base", "tip") for k in "xyz")))
    fingers = [
        SimpleNamespace(points=np.array([[-2.0, 0.0, 0.0], [-2.0, 1.0, 0.0]])),
        SimpleNamespace(points=np.array([[2.0, 0.0, 0.0], [2.0 + gap, 1.0, 0.0]])),
    ]
    shape = Box(np.full(3, 2.0))
    if said is None:
        _demand_touch(spec, robot, shape, fingers)
        return
    with pytest.raises(InputError, match=said):
        _demand_touch(spec, robot, shape, fingers)


@pytest.mark.parametrize(("axis", "force"), [(2, [0.1, 0.0, -3.0]), (2, [0.0, 1.0, 2.0]), (0, [-2.0, 1.0, 0.0])])
def test_a_table_is_under_the_side_that_the_load_points_to(axis, force):
    centre, half = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    points = table_under(centre, half, np.array(force)).points - centre
    assert len(np.unique(points, axis=0)) == 4
    np.testing.assert_allclose(points[:, axis], np.sign(force[axis]) * half[axis])
    others = [k for k in range(3) if k != axis]
    np.testing.assert_allclose(np.abs(points[:, others]), WITHIN * half[others] * np.ones((4, 2)))
    np.testing.assert_allclose(points[:, others].sum(axis=0), 0.0, atol=1e-12)
