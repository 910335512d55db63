import numpy as np
import pytest
from support.blocks import block

from cfem.mechanics.mesh import Mesh
from cfem.robot.cad import Box, Placed
from cfem.robot.geometry import Part
from cfem.robot.mesh.placement import join, place, seen_from

PLAIN = block((3, 2, 1), (3, 2, 1))
MESH = Mesh(PLAIN.X, PLAIN.cells, PLAIN.facets, {"end": np.array([0, 1])}, {"skin": np.array([2])})


def part(**where):
    return Part.model_validate({"name": "p", "geometry": {"kind": "bar"}, **where})


QUARTER = part(rotate={"axis": [0, 0, 2], "angle": "90 deg"}, translate={"mm": [0, 30, 70]})
OBLIQUE = part(rotate={"axis": [1, 2, 3], "angle": "20 deg"}, translate={"mm": [5, -4, 2]})


def test_turned_about_its_origin_then_moved():
    np.testing.assert_allclose(place(MESH, QUARTER).X, MESH.X[:, [1, 0, 2]] * [-1, 1, 1] + [0, 30, 70], atol=1e-12)
    assert place(MESH, part()).X.tolist() == MESH.X.tolist()
    turned = place(MESH, OBLIQUE)
    np.testing.assert_allclose(turned.volumes, MESH.volumes, rtol=1e-12)


def test_a_box_of_the_scene_is_found_in_the_coordinates_of_the_part():
    box = Box((0.0, 30.0, 70.0), (1.0, 33.0, 72.0))
    seen = seen_from(box, QUARTER)
    np.testing.assert_allclose([seen.low, seen.high], [[0, -1, 0], [3, 0, 2]], atol=1e-12)
    oblique = seen_from(box, OBLIQUE)
    assert isinstance(oblique, Placed)
    there = part(
        rotate={"axis": list(oblique.axis), "angle": f"{oblique.angle} rad"}, translate={"mm": oblique.translate}
    )
    np.testing.assert_allclose(place(place(MESH, there), OBLIQUE).X, MESH.X, atol=1e-12)


def test_parts_in_one_mesh_keep_their_names():
    far = place(MESH, QUARTER)
    whole = join({"a": MESH, "b": far})
    n, m, k = len(MESH.X), len(MESH.cells), len(MESH.facets)
    assert whole.volumes.sum() == pytest.approx(12.0)
    np.testing.assert_array_equal(whole.node_sets["b"], n + np.arange(n))
    np.testing.assert_array_equal(whole.X[whole.cells[whole.cell_sets["b"]]], far.X[far.cells])
    np.testing.assert_array_equal(whole.X[whole.facets[whole.facet_sets["b"]]], far.X[far.facets])
    assert whole.node_sets["b.end"].tolist() == [n, n + 1] and whole.facet_sets["a.skin"].tolist() == [2]
    assert (len(whole.X), len(whole.cells), len(whole.facets)) == (2 * n, 2 * m, 2 * k)
