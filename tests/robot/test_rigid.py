import numpy as np
import pytest
from pydantic import TypeAdapter
from support.blocks import block

from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh
from cfem.robot.rigid import rigid_groups
from cfem.robot.selection import Selection

PLAIN = block((4, 2, 2), (4, 2, 2))
MESH = Mesh(PLAIN.X, PLAIN.cells, PLAIN.facets, {"two": np.array([0, 1])})
FIXED = np.flatnonzero(PLAIN.X[:, 0] == 0)


def slab(low, high):
    return {"kind": "box", "corners": {"mm": [[low, 0, 0], [high, 2, 2]]}}


EDGE = {"kind": "box", "corners": {"mm": [[1, 0, 0], [4, 0, 0]]}}


def groups(*selections):
    made = [TypeAdapter(Selection).validate_python(data) for data in selections]
    return rigid_groups(MESH, made, FIXED)


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
