"""Rims, open edges and solid angles of small surfaces whose answers are counted by hand."""

import numpy as np
import pytest

from cfem.contact.surface.facets import components, edges, solid_angles, unmatched_edges

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


@pytest.mark.parametrize(
    ("facet", "rim"),
    [([5, 6, 7], [5, 6, 7]), ([1, 2, 3, 4], [1, 2, 3, 4]), ([1, 2, 3, 12, 23, 31], [1, 12, 2, 23, 3, 31])],
    ids=["triangle", "quadrilateral", "quadratic triangle: corners, then the middles of its sides"],
)
def test_edges_go_round_the_rim_in_order(facet, rim):
    start, end = edges(np.array([facet]))
    np.testing.assert_array_equal(start, [rim])
    np.testing.assert_array_equal(end, [rim[1:] + rim[:1]])


def test_a_closed_surface_has_no_unmatched_edge_and_a_hole_has_its_rim():
    assert unmatched_edges(TETRAHEDRON).size == 0
    np.testing.assert_array_equal(unmatched_edges(TETRAHEDRON[1:]), [[0, 1], [0, 2], [1, 2]])


def test_a_facet_that_is_turned_round_leaves_its_edges_unmatched():
    turned = TETRAHEDRON.copy()
    turned[0] = turned[0, ::-1]
    np.testing.assert_array_equal(unmatched_edges(turned), [[0, 1], [0, 2], [1, 2]])


def test_components_share_items():
    count, label = components(np.array([[0, 1], [5, 6], [1, 2], [6, 7]]))
    assert count == 2
    np.testing.assert_array_equal(label == label[0], [True, False, True, False])


def test_the_faces_of_a_cube_around_the_origin_fill_the_sphere_alike():
    """Each takes a sixth of 4 pi; seen from inside the normals point away."""
    front = np.array([[1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]], float)
    turns = [np.eye(3), np.roll(np.eye(3), 1, axis=0), np.roll(np.eye(3), 2, axis=0)]
    corners = np.array([side * front @ turn for turn in turns for side in (1, -1)])
    corners[1::2] = corners[1::2, ::-1]
    np.testing.assert_allclose(solid_angles(corners), 4 * np.pi / 6)
    np.testing.assert_allclose(solid_angles(corners[:, ::-1]), -4 * np.pi / 6)
