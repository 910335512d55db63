"""Points inside, as the attachment of points finds them in another way."""

import numpy as np
import pytest
from support.blocks import box

from cfem.constraint.attachment import locate
from cfem.init.body.interior import interior
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


def test_only_what_is_near():
    mesh = box((3.0, 2.0, 1.0), (3, 2, 2), "tet4")
    body = interior(mesh)
    low, high = (extreme(mesh.X[mesh.cells][:, :, 0], axis=1) for extreme in (np.min, np.max))
    x = np.array([1.0, 0, 0])
    np.testing.assert_array_equal(body.near_plane(1.5 * x, x), np.flatnonzero((low < 1.5) & (high > 1.5)))
    point = np.array([[2.5, 0.5, 0.5]])
    assert (
        body.contains(point, body.near_plane(2.5 * x, x)).all()
        and body.contains(point, body.near_points(point, 0.1)).all()
    )
    assert not body.contains(point, body.near_plane(0.5 * x, x)).any()
    assert not body.contains(point, body.near_plane(9.0 * x, x)).any()
    aslant = np.array([0.6, 0.8, 0.0])
    assert body.contains(point, body.near_plane(point[0], aslant)).all()
