import numpy as np
import pytest

from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.robot.cad import Box
from cfem.robot.mesh.hexahedra import block

BAR = Box((0.0, -5.0, -5.0), (30.0, 5.0, 5.0))


def test_a_bar_in_cells_no_larger_than_asked():
    X, cells = block(BAR, 4.0)
    mesh = Mesh(X, cells, boundary_facets(cells))
    assert cells.shape == (8 * 3 * 3, 8) and len(X) == 9 * 4 * 4
    np.testing.assert_allclose(mesh.volumes, 3000 / 72, rtol=1e-12)
    a, b, c = (X[mesh.facets[:, corner]] for corner in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), X[mesh.facets].mean(axis=1) - [15, 0, 0])
    assert len(mesh.facets) == 2 * (8 * 3 + 8 * 3 + 3 * 3) and (outward > 0).all()


@pytest.mark.parametrize("size", [3.0, 7.0, 100.0])
def test_faces_of_regions_lie_between_cells(size):
    inner = Box((11.0, -9.0, -1.0), (13.5, 9.0, 5.0 - 1e-12))  # beyond the bar in y, at its face in z
    X, cells = block(BAR, size, [inner, inner])
    centre, volumes = X[cells].mean(axis=1), Mesh(X, cells, boundary_facets(cells)).volumes
    inside = ((np.array(inner.low) < centre) & (centre < np.array(inner.high))).all(axis=1)
    assert volumes[inside].sum() == pytest.approx(2.5 * 10 * 6, rel=1e-12)
    assert volumes.sum() == pytest.approx(3000, rel=1e-12) and volumes.min() > 1e-3
