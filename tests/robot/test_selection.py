import numpy as np
import pytest
from pydantic import TypeAdapter
from support.blocks import block

from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh
from cfem.robot.selection import Selection, select_nodes

PLAIN = block((4, 2, 2), (4, 2, 2))
MESH = Mesh(PLAIN.X, PLAIN.cells, PLAIN.facets, {"held": np.array([0, 1])}, {"skin": np.array([0])})
SELECTIONS = {
    "box": ({"kind": "box", "corners": {"mm": [[0, 0, 0], [1, 2, 2]]}}, PLAIN.X[:, 0] <= 1),
    "sphere": (
        {"kind": "sphere", "centre": {"mm": [4, 2, 2]}, "radius": "1 mm"},
        np.linalg.norm(PLAIN.X - [4, 2, 2], axis=1) <= 1,
    ),
    "plane": ({"kind": "plane", "point": {"cm": [0.3, 0, 0]}, "normal": [2, 0, 0]}, PLAIN.X[:, 0] >= 3),
}


def selection(data):
    return TypeAdapter(Selection).validate_python(data)


@pytest.mark.parametrize("data, expected", SELECTIONS.values(), ids=SELECTIONS.keys())
def test_shapes_choose_their_nodes(data, expected):
    np.testing.assert_array_equal(select_nodes(MESH, selection(data), "fixed[0]"), np.flatnonzero(expected))


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
        select_nodes(MESH, selection(data), "fixed[0]")
