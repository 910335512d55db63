import numpy as np
import pytest
from support.blocks import block

from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.robot.quality import dihedral_angles, quality


def test_regular_tetrahedron_has_one_dihedral_angle():
    X = np.array([[1.0, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]])
    cells = np.array([[0, 2, 1, 3]])
    angles = dihedral_angles(Mesh(X, cells, boundary_facets(cells)))
    np.testing.assert_allclose(angles, np.degrees(np.arccos(1 / 3)))


@pytest.mark.parametrize("order", [1, 2])
def test_figures_of_a_block(order):
    figures = quality(block((3, 2, 1), (3, 2, 1), order), 6.6)
    assert figures.volume == pytest.approx(6.0) and figures.volume_error == pytest.approx(-1 / 11)
    assert figures.inverted == 0 and figures.cells == 36
    assert figures.smallest_dihedral_deg == pytest.approx(45.0) and figures.largest_dihedral_deg == pytest.approx(90.0)


def test_inverted_cells_are_counted():
    mesh = block((1, 1, 1), (1, 1, 1))
    cells = mesh.cells.copy()
    cells[:2] = cells[:2][:, [1, 0, 2, 3]]
    assert quality(Mesh(mesh.X, cells, mesh.facets), None).inverted == 2
