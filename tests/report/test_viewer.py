import base64
import json

import numpy as np
import pytest

from cfem.report.viewer import (
    BODY,
    HELD,
    Polyline,
    Take,
    Viewer,
    camera_axes,
    carried_along,
    flat_triangles,
    painted,
    visible,
)

X = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10], [99, 99, 99]])  # the last one inside the body
FACETS = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
FRAMES = np.stack([X, X + [0, 2.0, 0], X + [0, 4.0, 1.0]])


def make(errors=(0.1, 0.0, np.nan), name="curve"):
    points = FRAMES[:, 3]
    reached = points.copy()
    reached[np.isnan(errors)] = np.nan
    line = Polyline("</script>$", "--c1", points[:, None])
    take = Take(name, FRAMES, (0, 1, 2), points, reached, errors, (line,))
    return Viewer("tracked", "the <body>", FACETS, np.array([BODY, BODY, BODY, HELD]), (take,))


def decoded(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


def test_the_data_hold_the_shapes_to_a_few_micrometres():
    data = make().data()
    frames = decoded(data["takes"][0]["frames"], "<i2").reshape(3, 4, 3)
    found = np.array(data["origin"]) + data["step"] * frames
    np.testing.assert_allclose(found, FRAMES[:, :4], atol=data["step"])
    assert data["step"] < 14 / 60000  # of a body of 14 mm, all frames together
    points = np.concatenate([np.arange(4), decoded(data["again"], "<u4")])  # each face of a tetrahedron has its own
    triangles = decoded(data["triangles"], "<u4").reshape(-1, 3)
    assert len(np.unique(triangles)) == 12
    np.testing.assert_array_equal(points[triangles], FACETS)
    assert decoded(data["kinds"], "u1").tolist() == [0, 0, 0, 1]


def test_a_goal_where_the_robot_failed_has_no_place_and_no_error():
    take = make().data()["takes"][0]
    assert take["reached"][2] is None and take["errors"] == [0.1, 0.0, None]
    assert None not in take["reached"][:2]


def test_no_name_leaves_the_data():
    html = make().html()
    assert html.count("</script>") == 1 and "the &lt;body&gt;" in html
    inside = html.split('<script type="application/json">')[1].split("</script>")[0]
    assert json.loads(inside)["takes"][0]["lines"][0]["name"] == "</script>$"


def test_the_same_robot_makes_the_same_still_picture():
    assert make().still == make().still and make().still.startswith(b"\x89PNG")


def test_only_a_curve_that_comes_back_is_closed():
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    assert Take("", FRAMES, goals=circle).closed
    assert not Take("", FRAMES, goals=circle[:16]).closed
    assert not Take("", FRAMES, goals=circle[[0, 8, 16]]).closed


def test_a_camera_is_a_rotation_and_looks_where_it_says():
    for azimuth, elevation in ((0, 0), (30, 20), (-65, 14)):
        axes = camera_axes(azimuth, elevation)
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(axes) > 0
    np.testing.assert_allclose(camera_axes(0, 0) @ [3.0, 1.0, 2.0], [1.0, 2.0, 3.0], atol=1e-15)


def test_what_points_at_the_viewer_is_foreshortened():
    axes = camera_axes(0.0, 0.0)
    along, across = np.array([[0.0, 0, 0], [5, 0, 0]]), np.array([[0.0, 0, 0], [0, 5, 0]])
    assert visible(along, axes, 1) < 0.01 and visible(across, axes, 1) == pytest.approx(1)
    slanted = np.array([[0.0, 0, 0], [5, 5, 0]])
    assert visible(slanted, axes, 1) == pytest.approx(np.sqrt(0.5), rel=1e-2)


def test_triangles_are_painted_from_far_to_near_and_backs_are_not():
    square = np.array([[0.0, -1, -1], [0, 1, -1], [0, 1, 1]])
    x = np.vstack([square + [1.0, 0, 0], square, square])
    triangles = np.array([[0, 1, 2], [3, 4, 5], [6, 8, 7]])
    colours = np.eye(3)
    drawn = painted(x, triangles, colours, camera_axes(0, 0)).get_facecolor()[:, :3]
    assert np.argmax(drawn, axis=1).tolist() == [1, 0]


def test_quadratic_facets_become_four_triangles_of_the_same_area():
    corners = np.array([[0.0, 0, 0], [0, 2, 0], [0, 0, 2]])
    x = np.vstack([corners, (corners + np.roll(corners, -1, axis=0)) / 2])
    triangles = flat_triangles(np.arange(6)[None])
    u, v = x[triangles[:, 1]] - x[triangles[:, 0]], x[triangles[:, 2]] - x[triangles[:, 0]]
    np.testing.assert_allclose(np.cross(u, v)[:, 0] / 2, 0.5)
    assert len(flat_triangles(np.zeros((5000, 6), int))) == 5000


def test_points_of_the_body_move_with_it():
    grid = np.stack(np.meshgrid(*[np.arange(5.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    moved = np.stack([grid, grid + [1.0, -2, 3]])
    points = np.array([[2.2, 1.7, 2.0], [4.0, 4.0, 4.0]])
    np.testing.assert_allclose(carried_along(points, grid, moved), [points, points + [1.0, -2, 3]])
