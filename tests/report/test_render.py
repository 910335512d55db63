import numpy as np

from cfem.report.render import Body, Camera, Frame, draw, flat_triangles

SQUARE = np.array([[0.0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]])
QUAD = np.array([[0, 1, 2], [0, 2, 3]])
CAMERA = Camera.looking(0.0, 0.0)


def paint(x, triangles):
    frame = Frame.around(np.array([[0, -2, -2], [0, 2, 2.0]]), CAMERA, width=100, margin=0.0)
    return draw(Body(x, triangles, np.array([1.0, 0.5, 0.25])), CAMERA, frame)


def test_a_square_that_faces_the_viewer_covers_its_share_and_keeps_its_colour():
    image, extent = paint(SQUARE, QUAD)
    assert extent == (-2.0, 2.0, -2.0, 2.0)
    assert abs(image[..., 3].mean() - 0.25) < 0.01
    middle = image[50, 50]
    assert middle[3] == 1.0
    np.testing.assert_allclose(middle[1:3] / middle[0], [0.5, 0.25])


def test_backs_are_not_drawn():
    assert paint(SQUARE, QUAD[:, ::-1])[0][..., 3].max() == 0.0


def test_the_nearer_of_two_hides_the_other_whatever_their_order():
    tilted = SQUARE + np.array([1.0, 0, 0])
    tilted[[2, 3], 0] -= 1.2
    x = np.vstack([SQUARE, tilted])
    one = paint(x, np.vstack([QUAD, QUAD + 4]))[0]
    other = paint(x, np.vstack([QUAD + 4, QUAD]))[0]
    np.testing.assert_array_equal(one, other)


def test_quadratic_facets_become_four_triangles_of_the_same_area():
    corners = np.array([[0.0, 0, 0], [0, 2, 0], [0, 0, 2]])
    middle = (corners + np.roll(corners, -1, axis=0)) / 2
    x, facet = np.vstack([corners, middle]), np.arange(6)[None]
    triangles = flat_triangles(facet)
    u, v = x[triangles[:, 1]] - x[triangles[:, 0]], x[triangles[:, 2]] - x[triangles[:, 0]]
    areas = np.cross(u, v)[:, 0] / 2
    np.testing.assert_allclose(areas, 0.5)


def test_the_camera_is_a_rotation_and_looks_where_it_says():
    for azimuth, elevation in ((0, 0), (30, 20), (-65, 14)):
        axes = Camera.looking(azimuth, elevation).axes
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(axes) > 0
    np.testing.assert_allclose(CAMERA.project(np.array([3.0, 1.0, 2.0])), [1.0, 2.0, 3.0], atol=1e-15)


def test_every_triangle_may_have_its_own_colour():
    frame = Frame.around(np.array([[0, -2, -2], [0, 2, 2.0]]), CAMERA, width=100, margin=0.0)
    image = draw(Body(SQUARE, QUAD, np.array([[1.0, 0, 0], [0, 1.0, 0]])), CAMERA, frame)[0]
    red, green = (image[..., channel] > 0.3 for channel in (0, 1))
    assert abs(red.mean() - 0.125) < 0.01 and abs(green.mean() - 0.125) < 0.01
