import numpy as np
import pytest
from support.blocks import block, hexahedra

from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.robot.mesh.quality import dihedral_angles, quality, scaled_jacobians


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


def test_figures_of_hexahedra_are_those_of_their_corners():
    figures = quality(hexahedra((3, 2, 1), (3, 2, 1)), 6.0)
    assert figures.smallest_scaled_jacobian == pytest.approx(1.0) and figures.smallest_dihedral_deg is None
    assert figures.volume == pytest.approx(6.0) and figures.inverted == 0


def test_a_sheared_cube_has_the_sine_of_its_angle_at_every_corner_whatever_its_edges():
    mesh = hexahedra((1, 1, 1), (1, 1, 1))
    slope = np.radians(60)
    sheared = mesh.X @ np.array([[3.0, 0, 0], [5 * np.cos(slope), 5 * np.sin(slope), 0], [0, 0, 7]])
    np.testing.assert_allclose(scaled_jacobians(Mesh(sheared, mesh.cells, mesh.facets)), np.sin(slope), rtol=1e-12)


def test_a_hexahedron_with_one_corner_pushed_through_is_inverted_though_it_has_volume():
    mesh = hexahedra((1, 1, 1), (1, 1, 1))
    X = mesh.X.copy()
    X[-1] = 0.3
    figures = quality(Mesh(X, mesh.cells, mesh.facets), None)
    assert figures.inverted == 1 and figures.volume > 0 and figures.smallest_scaled_jacobian < 0


def test_a_mesh_that_holds_less_than_its_body_is_doubted():
    mesh = block((3, 2, 1), (3, 2, 1))
    assert quality(mesh, 6.1).doubts() == [] and quality(mesh, None).doubts() == []
    (said,) = quality(mesh, 6.6).doubts()
    assert said.startswith("the cells hold 9.1 % less") and "18 % softer" in said


def test_cells_that_are_nearly_flat_are_doubted_with_what_to_do():
    mesh = block((2, 2, 2), (2, 2, 2))
    X, middle = mesh.X.copy(), int(np.argmin(np.linalg.norm(mesh.X - 1, axis=1)))
    assert quality(mesh, None).doubts() == []
    X[middle] = [1.999, 1.0, 1.0]  # nearly on the face that its cells stand on
    figures = quality(Mesh(X, mesh.cells, mesh.facets), None)
    assert figures.flat > 0 and (figures.smallest_dihedral_deg < 1 or figures.largest_dihedral_deg > 179)
    assert "nearly flat" in figures.doubts()[0] and "a smaller mesh.size" in figures.doubts()[0]
    assert "as .stl, which cfem meshes itself" in figures.doubts(from_file=True)[0]


def test_a_hexahedron_that_is_nearly_flat_is_doubted():
    mesh = hexahedra((1, 1, 1), (1, 1, 1))
    slope = np.radians(1)
    sheared = mesh.X @ np.array([[1.0, 0, 0], [np.cos(slope), np.sin(slope), 0], [0, 0, 1]])
    (said,) = quality(Mesh(sheared, mesh.cells, mesh.facets), None).doubts()
    assert said.startswith("1 of 1 cell is nearly flat, with a scaled Jacobian down to 0.017")
