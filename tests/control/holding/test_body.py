"""Bodies that robots hold: their volume, their centre of mass, and the table that they stand on."""

import struct

import numpy as np
import pytest

from cfem.contact.surface.facets import unmatched_edges
from cfem.control.holding.body import WITHIN, body_of, box_body
from cfem.control.holding.spec import ObjectSpec
from cfem.core.errors import CfemError, SpecError

CENTRE = np.array([1.0, -2.0, 30.0])


def write_stl(path, vertices, triangles):
    corners = np.asarray(vertices, float)[triangles]
    records = (struct.pack("<12fH", 0, 0, 0, *corner.ravel(), 0) for corner in corners)
    path.write_bytes(b" " * 80 + struct.pack("<I", len(corners)) + b"".join(records))


def angle_prism(height=6.0):
    """An L of arms 30 and 20 mm, 8 mm wide, upright along z: its area, and its centroid by two rectangles."""
    outline = np.array([[0, 0], [30, 0], [30, 8], [8, 8], [8, 20], [0, 20]], float)
    bottom = np.column_stack([outline, np.zeros(6)])
    vertices = np.vstack([bottom, bottom + [0, 0, height]])
    caps = [[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]]
    sides = [[i, (i + 1) % 6, 6 + (i + 1) % 6] for i in range(6)] + [[i, 6 + (i + 1) % 6, 6 + i] for i in range(6)]
    triangles = [cap[::-1] for cap in caps] + [[6 + k for k in cap] for cap in caps] + sides
    areas, middles = np.array([240.0, 96.0]), np.array([[15, 4], [4, 14]])
    return vertices, np.array(triangles), np.array([*(areas @ middles / areas.sum()), height / 2])


def spec(**more):
    return ObjectSpec(**({"centre": {"mm": CENTRE.tolist()}} | more))


@pytest.mark.parametrize("width", [3, 4, 6])
def test_the_surface_of_a_box_is_closed_and_holds_its_volume(width):
    """Volume by the divergence theorem, facet by facet, as triangles about the first node; middles lie on straight
    sides."""
    points, facets = box_body((1.0, -2.0, 0.5), (2.0, 3.0, 4.0)).facets(width)
    corners = facets[:, :4] if width == 4 else facets[:, :3]
    fans = [corners[:, [0, k, k + 1]] for k in range(1, corners.shape[1] - 1)]
    volume = sum(np.linalg.det(points[fan]).sum() / 6 for fan in fans)
    assert volume == pytest.approx(4 * 6 * 8)
    places = np.unique(points, axis=0, return_inverse=True)[1].ravel()  # facets of six nodes share none of them
    triangles = np.concatenate([places[fan] for fan in fans])
    apart = (np.diff(np.sort(triangles, axis=1), axis=1) > 0).all(axis=1)  # a facet of four may repeat a corner
    assert unmatched_edges(triangles[apart]).size == 0


@pytest.mark.parametrize(("axis", "force"), [(2, [0.1, 0.0, -3.0]), (2, [0.0, 1.0, 2.0]), (0, [-2.0, 1.0, 0.0])])
def test_a_table_is_under_the_side_that_the_load_points_to(axis, force):
    centre, half = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    points = box_body(centre, half).table(np.array(force)).points - centre
    assert len(np.unique(points, axis=0)) == 4
    np.testing.assert_allclose(points[:, axis], np.sign(force[axis]) * half[axis])
    others = [k for k in range(3) if k != axis]
    np.testing.assert_allclose(np.abs(points[:, others]), WITHIN * half[others] * np.ones((4, 2)))
    np.testing.assert_allclose(points[:, others].sum(axis=0), 0.0, atol=1e-12)


def test_the_centroid_of_a_file_is_put_at_the_centre_and_turned_about_it(tmp_path):
    vertices, triangles, centroid = angle_prism()
    write_stl(tmp_path / "l.stl", vertices / 25.4, triangles)
    turned = {"axis": [0, 0, 1], "angle": "90 deg"}
    body = body_of(spec(file="l.stl", unit="25.4 mm", rotate=turned), tmp_path)
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    expected = np.unique(np.round((vertices - centroid) @ quarter.T + CENTRE, 4), axis=0)
    np.testing.assert_allclose(np.unique(np.round(body.vertices, 4), axis=0), expected, atol=1e-4)
    assert body.shape.distance(CENTRE[None])[0] == pytest.approx(-(8 - centroid[1]), abs=1e-4)
    assert np.abs(body.shape.distance(body.vertices)).max() < 1e-9
    stands = body.table(np.array([0.0, 0.0, -1.0]))
    np.testing.assert_allclose(stands.points[:, 2], CENTRE[2] - 3.0, atol=1e-5)
    assert len(np.unique(np.round(stands.points, 6), axis=0)) == 4
    assert np.abs(body.shape.distance(stands.points)).max() < 1e-9


@pytest.mark.parametrize(
    ("shape", "volume"),
    [({"radius": "4 mm"}, 4 / 3 * np.pi * 64), ({"radius": "3 mm", "half_length": "5 mm"}, 90 * np.pi)],
)
def test_round_bodies_are_drawn_nearly_as_large_as_they_are(tmp_path, shape, volume):
    body = body_of(spec(**shape), tmp_path)
    corners = body.vertices[body.triangles] - CENTRE
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(volume, rel=0.03)
    assert np.linalg.det(corners).min() >= 0
    assert np.abs(body.shape.distance(body.vertices)).max() < 1e-12


def test_a_cylinder_stands_on_its_end_and_a_ball_on_no_side(tmp_path):
    down = np.array([0.0, 0.0, -0.2])
    cylinder = body_of(spec(radius="3 mm", half_length="5 mm"), tmp_path)
    pads = cylinder.table(down).points - CENTRE
    np.testing.assert_allclose(pads[:, 2], -5.0)
    np.testing.assert_allclose(np.linalg.norm(pads[:, :2], axis=1), WITHIN * 3.0, rtol=1e-6)
    lying = body_of(spec(radius="3 mm", half_length="5 mm", rotate={"axis": [1, 0, 0], "angle": "90 deg"}), tmp_path)
    for body in (body_of(spec(radius="4 mm"), tmp_path), lying):
        with pytest.raises(SpecError, match=r"does not stand on a flat side.*turn it by object.rotate"):
            body.table(down)


@pytest.mark.parametrize(
    ("shape", "said"),
    [
        ({}, "give half_size of a box, radius of a ball or cylinder, or file of a body"),
        ({"radius": "1 mm", "half_size": {"mm": [1, 1, 1]}}, "one of these"),
        ({"half_size": {"mm": [1, 1, 1]}, "half_length": "2 mm"}, "half_length is that of a cylinder"),
        ({"half_size": {"mm": [1, 0, 1]}}, "half_size: all three must be above 0"),
    ],
)
def test_a_body_has_one_shape(shape, said):
    with pytest.raises(ValueError, match=said):
        spec(**shape)


def test_a_file_that_encloses_nothing_is_named(tmp_path):
    vertices, triangles, _ = angle_prism()
    write_stl(tmp_path / "open.stl", vertices, triangles[1:])
    with pytest.raises(CfemError, match=r"open\.stl"):
        body_of(spec(file="open.stl"), tmp_path)
