"""Signed distances to closed surfaces, against closed forms and against the winding number."""

import numpy as np
import pytest
from support.closed import box_arrays, box_surface, octahedral_sphere, prism_arrays

from cfem.contact.obstacle import Box
from cfem.contact.surface.closed_surface import ClosedSurface
from cfem.core.errors import InputError

HALF = np.array([1.0, 2.0, 3.0])


def joined(*pieces) -> tuple[np.ndarray, np.ndarray]:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
    moved = [triangles + start for (_, triangles), start in zip(pieces, starts, strict=False)]
    return np.vstack([vertices for vertices, _ in pieces]), np.vstack(moved)


def test_a_box_of_triangles_is_the_box():
    points = 3 * np.random.default_rng(0).normal(size=(2000, 3))
    distance, normal = box_surface(HALF).distance(points)
    np.testing.assert_allclose(distance, Box(HALF).distance(points), atol=1e-13)
    np.testing.assert_allclose(normal, Box(HALF).normals(points), atol=1e-12)


def test_an_angle_is_the_union_of_its_legs_outside_and_the_rest_of_a_box_inside():
    polygon = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]], float)
    surface = ClosedSurface(*prism_arrays(polygon, [[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]], 2.0))
    box = lambda low, high: Box((np.array(high) - low) / 2, t=(np.array(high) + low) / 2)  # noqa: E731
    whole, gone = box([0.0, 0, 0], [4, 3, 2]), box([1.0, 1, -50], [50, 50, 50])
    legs = box([0.0, 0, 0], [4, 1, 2]), box([0.0, 0, 0], [1, 3, 2])
    points = np.random.default_rng(1).uniform(-1, 5, (3000, 3))
    inside = (whole.distance(points) < 0) & (gone.distance(points) > 0)
    outside = np.minimum(*(leg.distance(points) for leg in legs))
    expected = np.where(inside, np.maximum(whole.distance(points), -gone.distance(points)), outside)
    assert 50 < inside.sum() < 1000
    np.testing.assert_allclose(surface.distance(points)[0], expected, atol=1e-12)


@pytest.mark.parametrize("levels", [0, 2, 5])  # 8, 128 and 8192 triangles
def test_the_sign_is_that_of_the_winding_number_on_a_rugged_surface(levels):
    rng = np.random.default_rng(levels)
    directions, triangles = octahedral_sphere(levels)
    surface = ClosedSurface(directions * rng.uniform(0.5, 1.0, (len(directions), 1)), triangles)
    points = rng.uniform(-1, 1, (300, 3))
    winding = surface.winding(points)
    np.testing.assert_allclose(winding, np.round(winding), atol=1e-9)
    distance, normal = surface.distance(points)
    np.testing.assert_array_equal(distance < 0, np.round(winding) == 1)
    foot = points - distance[:, None] * normal
    np.testing.assert_allclose(surface.distance(foot)[0], 0, atol=1e-12)
    # Nothing is nearer: not one of many points of the surface.
    shares = rng.dirichlet(np.ones(3), len(triangles))
    on = np.einsum("tc,tci->ti", shares, surface.vertices[triangles])
    nearest = np.linalg.norm(points[:, None] - on[None], axis=2).min(axis=1)
    assert (np.abs(distance) <= nearest + 1e-12).all()


def test_a_cavity_is_outside_and_pieces_apart_are_one_obstacle():
    vertices, triangles = box_arrays([-1, -1, -1], [1, 1, 1])
    hollow = joined(
        box_arrays([-3, -3, -3], [3, 3, 3]), (vertices, triangles[:, ::-1]), box_arrays([5, 0, 0], [6, 1, 1])
    )
    surface = ClosedSurface(*hollow)
    points = np.array([[0.5, 0, 0], [2.25, 0, 0], [1.5, 0, 0], [4.25, 0.5, 0.5], [5.25, 0.5, 0.5]])
    np.testing.assert_allclose(surface.distance(points)[0], [0.5, -0.75, -0.5, 0.75, -0.25], atol=1e-14)


def test_triangles_without_area_change_nothing():
    """A vertex in the middle of an edge of the box, which one side uses and the other meets by a flat triangle."""
    vertices, triangles = box_arrays(-HALF, HALF)
    (a, b, c), others = triangles[0], triangles[1:]
    vertices = np.vstack([vertices, (vertices[a] + vertices[b]) / 2])
    middle = len(vertices) - 1
    flat = ClosedSurface(vertices, np.vstack([others, [[a, middle, c], [middle, b, c], [a, b, middle]]]))
    points = np.vstack([3 * np.random.default_rng(2).normal(size=(1000, 3)), [[-1.5, -2.5, 0.2], [-0.9, -1.9, 0.0]]])
    distance, normal = flat.distance(points)
    np.testing.assert_allclose(distance, Box(HALF).distance(points), atol=1e-12)
    np.testing.assert_allclose(normal, Box(HALF).normals(points), atol=1e-9)


def test_on_the_surface_the_normal_is_that_of_the_face_the_edge_or_the_corner():
    points = np.array([[1.0, 0.3, 0.7], [1.0, 2.0, 0.5], [1.0, 2.0, 3.0]])
    distance, normal = box_surface(HALF).distance(points)
    np.testing.assert_allclose(distance, 0, atol=1e-15)
    expected = np.array([[1.0, 0, 0], [1, 1, 0], [1, 1, 1]])
    np.testing.assert_allclose(normal, expected / np.linalg.norm(expected, axis=1)[:, None], atol=1e-12)


def test_what_encloses_nothing_is_refused_by_one_sentence():
    vertices, triangles = box_arrays([0, 0, 0], [1, 1, 1])
    one = np.arange(len(triangles))[:, None] == 3
    cases = {
        "is not closed: 3 edges belong to one triangle only, one of them from \\(0, 0, 0\\) to": (
            vertices,
            triangles[1:],
        ),
        "is not oriented: at 3 edges": (vertices, np.where(one, triangles[:, ::-1], triangles)),
        "turned inside out: its normals point inward": (vertices, triangles[:, ::-1]),
        "branches: 3 edges": (np.vstack([vertices, [[9, 9, 9]]]), np.vstack([triangles, tent(triangles[0], 8)])),
        "overlaps itself": joined((vertices, triangles), (vertices + 0.25, triangles)),
        "a part is inside out": joined((vertices, triangles), (vertices + 5, triangles[:, ::-1])),
        "name vertices that are not among the 8": (vertices, triangles + 1),
        "finite": (vertices * np.nan, triangles),
        "three numbers": (vertices, triangles[:, :2]),
    }
    for words, arrays in cases.items():
        with pytest.raises(InputError, match=words):
            ClosedSurface(*arrays)


def tent(triangle, top: int) -> np.ndarray:
    """A closed tetrahedron on one triangle of a surface, whose edges then belong to four triangles."""
    a, b, c = triangle
    return np.array([[c, b, a], [a, b, top], [b, c, top], [c, a, top]])


@pytest.mark.parametrize("level", [1, 5])  # 32 and 8192 triangles, of which 200 are tried
def test_a_small_piece_inside_out_is_found_among_many_triangles(level):
    directions, triangles = octahedral_sphere(level)
    vertices, faces = box_arrays([2, 0, 0], [2.1, 0.1, 0.1])
    outward = ClosedSurface(*joined((directions, triangles), (vertices, faces)))
    assert outward.distance(np.array([[2.05, 0.05, 0.05]]))[0] == pytest.approx(-0.05)
    with pytest.raises(InputError, match=r"a part is inside out, at \(2"):
        ClosedSurface(*joined((directions, triangles), (vertices, faces[:, ::-1])))


def test_the_largest_triangle_of_a_piece_tells_its_side():
    """A piece that begins with triangles without area, which have no side, is judged by another."""
    vertices, triangles = box_arrays([0, 0, 0], [1, 1, 1])
    (a, b, c), others = triangles[0], triangles[1:]
    vertices = np.vstack([vertices, (vertices[a] + vertices[b]) / 2])
    middle = len(vertices) - 1
    flat = np.vstack([[[a, b, middle], [a, middle, c], [middle, b, c]], others])
    assert ClosedSurface(vertices, flat).distance(np.array([[0.5, 0.5, 0.5]]))[0] == pytest.approx(-0.5)
    with pytest.raises(InputError, match="inside out: its normals point inward"):
        ClosedSurface(vertices, flat[:, ::-1])


def test_an_overlap_beyond_the_first_triangles_is_found():
    """Two spheres of 8192 triangles overlap in a cap: some of the 200 that are tried are there."""
    directions, triangles = octahedral_sphere(5)
    with pytest.raises(InputError, match="overlaps itself"):
        ClosedSurface(*joined((directions, triangles), (directions + [1.2, 0, 0], triangles)))
