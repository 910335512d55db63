import numpy as np
import pytest
from pydantic import TypeAdapter
from support.blocks import block, box

from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh
from cfem.robot.selection import Selection, facets_of, rigid_groups, select_cells, select_nodes

PLAIN = block((4, 2, 2), (4, 2, 2))
MESH = Mesh(
    PLAIN.X,
    PLAIN.cells,
    PLAIN.facets,
    {"held": np.array([0, 1])},
    {"skin": np.array([0])},
    {"core": np.array([5, 3])},
)
SELECTIONS = {
    "box": ({"kind": "box", "corners": {"mm": [[0, 0, 0], [1, 2, 2]]}}, PLAIN.X[:, 0] <= 1),
    "sphere": (
        {"kind": "sphere", "centre": {"mm": [4, 2, 2]}, "radius": "1 mm"},
        np.linalg.norm(PLAIN.X - [4, 2, 2], axis=1) <= 1,
    ),
    "cylinder": (
        {"kind": "cylinder", "point": {"mm": [9, 2, 1]}, "direction": [3, 0, 0], "radius": "1 mm"},
        np.hypot(PLAIN.X[:, 1] - 2, PLAIN.X[:, 2] - 1) <= 1,
    ),
    "outside a cylinder": (
        {"kind": "cylinder", "point": {"mm": [9, 2, 1]}, "direction": [3, 0, 0], "radius": "2 mm", "side": "outside"},
        np.hypot(PLAIN.X[:, 1] - 2, PLAIN.X[:, 2] - 1) >= 2,
    ),
    "plane": ({"kind": "plane", "point": {"cm": [0.3, 0, 0]}, "normal": [2, 0, 0]}, PLAIN.X[:, 0] >= 3),
}


def selection(data):
    return TypeAdapter(Selection).validate_python(data)


@pytest.mark.parametrize("data, expected", SELECTIONS.values(), ids=SELECTIONS.keys())
def test_shapes_choose_their_nodes(data, expected):
    np.testing.assert_array_equal(select_nodes(MESH, selection(data), "fixed.0"), np.flatnonzero(expected))


@pytest.mark.parametrize("element", ["tet4", "tet10", "hex8"])
def test_cells_are_chosen_by_their_centroid(element):
    mesh = box((4, 2, 2), (4, 2, 2), element)
    corners = mesh.X[mesh.cells[:, : 8 if element == "hex8" else 4]]
    chosen = select_cells(mesh, selection(SELECTIONS["plane"][0]), "region")
    np.testing.assert_array_equal(chosen, np.flatnonzero(corners[..., 0].min(axis=1) >= 3))
    assert mesh.volumes[chosen].sum() == pytest.approx(4.0)


def test_names_choose_cells_and_facets():
    assert select_cells(MESH, selection({"kind": "name", "name": "core"}), "region").tolist() == [3, 5]
    np.testing.assert_array_equal(facets_of(MESH, "skin", "wall"), PLAIN.facets[:1])
    assert set(select_nodes(MESH, selection({"kind": "name", "name": "core"}), "rigid")) == set(
        PLAIN.cells[[3, 5]].ravel()
    )
    with pytest.raises(SpecError, match=r"region: the mesh has no cell set 'skin' \(it has core\)"):
        select_cells(MESH, selection({"kind": "name", "name": "skin"}), "region")
    with pytest.raises(SpecError, match=r"wall: the mesh has no facet set 'core' \(it has skin\)"):
        facets_of(MESH, "core", "wall")
    with pytest.raises(SpecError, match="region: the sphere selects no cell"):
        select_cells(MESH, selection({"kind": "sphere", "centre": {"mm": [0, 0, 0]}, "radius": "0.1 mm"}), "region")


def test_names_choose_node_and_facet_sets():
    assert select_nodes(MESH, selection({"kind": "name", "name": "held"}), "fixed").tolist() == [0, 1]
    assert sorted(select_nodes(MESH, selection({"kind": "name", "name": "skin"}), "fixed")) == sorted(PLAIN.facets[0])


@pytest.mark.parametrize(
    "data, part",
    [
        ({"kind": "sphere", "centre": {"mm": [50, 0, 0]}, "radius": "1 mm"}, "selects no node"),
        ({"kind": "name", "name": "hold"}, "no set 'hold'"),
    ],
)
def test_mistakes_are_named(data, part):
    with pytest.raises(SpecError, match=part):
        select_nodes(MESH, selection(data), "fixed.0")


TWO = Mesh(PLAIN.X, PLAIN.cells, PLAIN.facets, {"two": np.array([0, 1])})
FIXED = np.flatnonzero(PLAIN.X[:, 0] == 0)


def slab(low, high):
    return {"kind": "box", "corners": {"mm": [[low, 0, 0], [high, 2, 2]]}}


EDGE = {"kind": "box", "corners": {"mm": [[1, 0, 0], [4, 0, 0]]}}


def groups(*selections):
    made = [TypeAdapter(Selection).validate_python(data) for data in selections]
    return rigid_groups(TWO, made, FIXED)


def test_groups_are_nodes():
    first, second = groups(slab(1, 2), slab(4, 4))
    np.testing.assert_array_equal(first, np.flatnonzero((PLAIN.X[:, 0] >= 1) & (PLAIN.X[:, 0] <= 2)))
    np.testing.assert_array_equal(second, np.flatnonzero(PLAIN.X[:, 0] == 4))
    assert groups() == ()


@pytest.mark.parametrize(
    "selections, part",
    [
        ([slab(3, 4), EDGE], r"rigid\.1: 4 nodes, all on one line"),
        ([{"kind": "name", "name": "two"}], r"rigid\.0: 2 nodes, all on one line"),
        ([slab(1, 2), slab(2, 3)], r"rigid\.1: shares 9 nodes with rigid\.0"),
        ([slab(0, 1)], r"rigid\.0: shares 9 of its 18 nodes with fixed"),
        ([slab(9, 10)], r"rigid\.0: the box selects no node"),
    ],
)
def test_what_makes_no_rigid_body_is_named(selections, part):
    with pytest.raises(SpecError, match=part):
        groups(*selections)
