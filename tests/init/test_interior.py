"""Points inside, as the attachment of points finds them in another way."""

import numpy as np
import pytest
from support.blocks import box

from cfem.constraint.attachment import locate
from cfem.init.interior import interior
from cfem.mechanics.mesh import Mesh


@pytest.mark.parametrize("element", ["tet4", "tet10", "hex8"])
def test_inside_and_outside(element):
    mesh = box((3.0, 2.0, 1.0), (3, 2, 2), element)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    mesh = Mesh(mesh.X @ turn + 5, mesh.cells, mesh.facets)
    points = np.random.default_rng(2).uniform([-1, -1, -1], [4, 3, 2], (400, 3)) @ turn + 5
    body = interior(mesh)
    found = body.contains(points, np.arange(len(body.low)))
    np.testing.assert_array_equal(found, locate(mesh, points, within=1e-9)[0] >= 0)
    assert 20 < found.sum() < 200


def test_only_what_is_near_a_plane():
    mesh = box((3.0, 2.0, 1.0), (3, 2, 2), "tet4")
    body = interior(mesh)
    low, high = (extreme(mesh.X[mesh.cells][:, :, 0], axis=1) for extreme in (np.min, np.max))
    np.testing.assert_array_equal(body.near(0, 1.5, 0.1), np.flatnonzero((low < 1.6) & (high > 1.4)))
    point = np.array([[2.5, 0.5, 0.5]])
    assert body.contains(point, body.near(0, 2.5)).all()
    assert not body.contains(point, body.near(0, 0.5)).any() and not body.contains(point, body.near(0, 9.0)).any()
