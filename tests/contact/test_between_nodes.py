"""Rigid obstacles at a surface between its nodes, against a search over the surface and the distances of points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cfem.contact.between_nodes import between_nodes, facing
from cfem.contact.clearance import nearest_of_surface
from cfem.contact.obstacle import Box, Capsule, Plane, Sphere
from cfem.contact.rounded_boxes import Boxes
from cfem.contact.touching_facets import Facets

WITHIN = 50.0  # mm


def sheet(n=6, bumps=0.0, seed=0):
    """A square sheet of side n mm at z = 0 whose normals are upwards, with nodes up to `bumps` mm above and below."""
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    nodes = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    nodes[:, 2] = np.random.default_rng(seed).uniform(-bumps, bumps, len(nodes))
    corner = np.arange((n + 1) * n).reshape(n, n + 1)[:, :n].ravel()
    a, b, c, d = corner, corner + n + 1, corner + n + 2, corner + 1
    return nodes, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def of(nodes, triangles, obstacle, kept=()):
    return between_nodes(nodes, Facets.of(triangles, nodes), Boxes.of([obstacle]), WITHIN, kept)


def everything(nodes, triangles):
    """Numbers of all facets and edges."""
    facets = Facets.of(triangles, nodes)
    return range(len(facets.triangles) + len(facets.edges))


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 1000),
    x=st.floats(2.2, 3.8),
    y=st.floats(2.2, 3.8),
    height=st.floats(-0.2, 0.3),
    long=st.floats(0.0, 0.9),
    turn=st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)),
)
def test_the_nearest_point_of_a_rough_sheet_to_a_round_obstacle_is_one_of_them_or_a_node(
    seed, x, y, height, long, turn
):
    nodes, triangles = sheet(bumps=0.05, seed=seed)
    capsule = Capsule(1.0, long, R=Rotation.from_rotvec(turn).as_matrix(), t=np.array([x, y, 0.0]))
    up = height - nearest_of_surface(nodes, triangles, capsule, 1e-5).distance
    capsule = Capsule(1.0, long, R=capsule.R, t=capsule.t + [0.0, 0.0, up + 2.5])  # above the sheet
    down = nearest_of_surface(nodes, triangles, capsule, 1e-5).distance - height
    capsule = Capsule(1.0, long, R=capsule.R, t=capsule.t - [0.0, 0.0, down])
    exact = nearest_of_surface(nodes, triangles, capsule, 1e-6).distance
    touching = of(nodes, triangles, capsule, everything(nodes, triangles))
    least = min(touching.gaps.min(initial=np.inf), capsule.distance(nodes).min())
    assert least == pytest.approx(exact, abs=2e-5)


@pytest.mark.parametrize("height", [0.05, -0.1])
def test_a_ball_presses_the_facet_under_it_along_its_normal(height):
    nodes, triangles = sheet()
    touching = of(nodes, triangles, Sphere(2.0, t=np.array([2.7, 2.3, 2.0 + height])))
    deepest = np.argmin(touching.gaps)
    assert touching.gaps[deepest] == pytest.approx(height)
    np.testing.assert_allclose(touching.normals[deepest], [0, 0, -1], atol=1e-12)
    place = touching.shares[deepest] @ nodes[touching.nodes[deepest]]
    np.testing.assert_allclose(place, [2.7, 2.3, 0.0], atol=1e-12)


def test_a_flat_wall_meets_nodes_alone():
    nodes, triangles = sheet(bumps=0.05)
    assert not len(of(nodes, triangles, Plane(R=np.diag([1.0, -1.0, -1.0]), t=np.array([0, 0, 0.0]))).gaps)


def test_a_large_ball_that_reaches_no_farther_between_nodes_than_at_them_meets_nodes_alone():
    nodes, triangles = sheet()
    ball = Sphere(100.0, t=np.array([2.7, 2.3, 99.99]))
    assert not len(of(nodes, triangles, ball).gaps)
    assert len(of(nodes, triangles, ball, everything(nodes, triangles)).gaps)


def corner_down(tip):
    """A cube of 8 mm that stands on a corner at `tip`."""
    third = np.ones(3) / np.sqrt(3)
    across = np.linalg.svd(third[None])[2][1:]
    R = np.vstack([across, third])
    R[0] *= np.linalg.det(R)
    return Box(np.full(3, 4.0), R=R, t=tip + [0, 0, 4 * np.sqrt(3)])


@pytest.mark.parametrize("depth", [-0.05, 0.0, 0.1])
@pytest.mark.parametrize("place", [(2.7, 2.3), (3.0, 3.0), (3.0, 2.4)], ids=["facet", "node", "edge"])
def test_a_corner_of_a_box_presses_once_wherever_it_comes(place, depth):
    """Also where it comes to a node or an edge of the mesh, and as deep as the box reaches into the sheet."""
    nodes, triangles = sheet()
    tip = np.array([*place, -depth])
    touching = of(nodes, triangles, corner_down(tip))
    (at_corner,) = np.flatnonzero(touching.features >= len(everything(nodes, triangles)))
    assert touching.gaps[at_corner] == pytest.approx(-depth, abs=1e-12)
    np.testing.assert_allclose(touching.normals[at_corner], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(touching.shares[at_corner] @ nodes[touching.nodes[at_corner]], [*place, 0], atol=1e-12)
    assert touching.gaps.min() >= -depth - 1e-9


def edge_down(depth, turn=0.3):
    """A cube of 8 mm that stands on an edge, whose middle is at (3, 2.9, -depth) mm, turned about the z axis."""
    R = Rotation.from_rotvec([0, 0, turn]).as_matrix() @ Rotation.from_rotvec([np.pi / 4, 0, 0]).as_matrix()
    return Box(np.full(3, 4.0), R=R, t=np.array([3.0, 2.9, 4 * np.sqrt(2) - depth]))


def test_an_edge_of_a_box_presses_the_edges_of_the_mesh_that_it_crosses():
    nodes, triangles = sheet()
    touching = of(nodes, triangles, edge_down(0.1))
    assert len(touching.gaps) >= 6
    np.testing.assert_allclose(touching.gaps, -0.1, atol=1e-12)
    np.testing.assert_allclose(touching.normals, np.tile([0, 0, -1], (len(touching.gaps), 1)), atol=1e-9)
    across = np.array([-np.sin(0.3), np.cos(0.3), 0.0])
    for number, shares in zip(touching.nodes, touching.shares, strict=True):
        assert across @ (shares @ nodes[number] - [3.0, 2.9, 0.0]) == pytest.approx(0.0, abs=1e-12)


def test_nodes_under_an_edge_do_not_face_the_sides_of_the_box_and_nodes_under_a_side_do():
    nodes, triangles = sheet()
    facets, box = Facets.of(triangles, nodes), edge_down(0.3, turn=0.0)
    inside = np.flatnonzero(box.distance(nodes) < 0)
    assert len(inside) and not facing(nodes, facets, inside, box.normals(nodes[inside])).any()
    flat = Box(np.full(3, 4.0), t=np.array([3.0, 3.0, 3.9]))
    inside = np.flatnonzero(flat.distance(nodes) < 0)
    assert len(inside) and facing(nodes, facets, inside, flat.normals(nodes[inside])).all()


def test_facets_of_several_surfaces_have_the_numbers_of_all_points():
    nodes, triangles = sheet(2)
    once, both = Facets.of(triangles, nodes), np.concatenate([nodes, nodes + [0, 0, 5.0]])
    joined = Facets.joined([once, once], [0, len(nodes), 2 * len(nodes)])
    ball = Boxes.of([Sphere(2.0, t=np.array([0.7, 0.4, 6.9]))])
    touching = between_nodes(both, joined, ball, 0.0)
    alone = between_nodes(both[len(nodes) :], once, ball, 0.0)
    np.testing.assert_allclose(touching.gaps, alone.gaps)
    np.testing.assert_array_equal(touching.nodes, alone.nodes + len(nodes))


def test_sharp_edges_part_the_normals_of_a_surface():
    nodes, triangles = sheet(2)
    nodes[:, 2] = -2.0 * np.abs(nodes[:, 0] - 1.0)  # a ridge
    smooth = Facets.of(triangles, nodes).smooth
    at_ridge = {
        group
        for row, numbers in zip(triangles, smooth, strict=True)
        for i, group in zip(row, numbers, strict=True)
        if i == 4
    }
    assert len(at_ridge) == 2


def test_an_edge_of_a_box_over_a_line_of_nodes_presses_each_node_once():
    nodes, triangles = sheet()
    box = Box(np.full(3, 2.6), R=Rotation.from_rotvec([np.pi / 4, 0, 0]).as_matrix(), t=np.array([3.0, 3, 0]))
    box = Box(box.half, R=box.R, t=box.t + [0, 0, 2.6 * np.sqrt(2) - 0.1])
    touching = of(nodes, triangles, box)
    pressed = touching.nodes[touching.shares > 0.99]
    np.testing.assert_array_equal(np.sort(pressed), np.flatnonzero((nodes[:, 1] == 3) & (abs(nodes[:, 0] - 3) < 2.6)))
    np.testing.assert_allclose(touching.gaps, -0.1, atol=1e-12)
