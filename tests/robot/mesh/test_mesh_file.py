import meshio
import numpy as np
import pytest
from support.blocks import block, box

from cfem.core.errors import InputError
from cfem.mechanics.mesh import Mesh
from cfem.robot.mesh.mesh_file import read_mesh, read_own, write_mesh

CELLS = {4: "tetra", 8: "hexahedron"}
FACETS = {4: "triangle", 8: "quad"}


def named(element):
    mesh = box((3, 2, 1), (3, 2, 1), element)
    top = np.flatnonzero(mesh.X[mesh.facets[:, :3], 2].min(axis=1) > 1 - 1e-9)
    half = np.flatnonzero(mesh.X[mesh.cells[:, :4], 0].max(axis=1) < 2 + 1e-9)
    end = np.flatnonzero(mesh.X[:, 0] > 3 - 1e-9)
    return Mesh(mesh.X, mesh.cells, mesh.facets, {"end": end}, {"top": top}, {"half": half, "top": half[:1]})


@pytest.mark.parametrize("element", ["tet4", "tet10", "hex8"])
def test_round_trip_is_exact(tmp_path, element):
    mesh = named(element)
    write_mesh(tmp_path / "mesh.vtu", mesh)
    again = read_mesh(tmp_path / "mesh.vtu")
    for field in ("X", "cells", "facets"):
        np.testing.assert_array_equal(getattr(again, field), getattr(mesh, field))
    for field in ("node_sets", "facet_sets", "cell_sets"):
        mine, read = getattr(mesh, field), getattr(again, field)
        assert mine.keys() == read.keys()
        for name, members in mine.items():
            np.testing.assert_array_equal(read[name], members)


@pytest.mark.parametrize("element", ["tet4", "tet10", "hex8"])
def test_ours_is_also_a_users(tmp_path, element):
    mesh = named(element)
    write_mesh(tmp_path / "mesh.vtu", mesh)
    own, corners = read_own(tmp_path / "mesh.vtu", 1.0), box((3, 2, 1), (3, 2, 1), element.replace("10", "4"))
    np.testing.assert_allclose(own.X, corners.X, atol=1e-15)
    np.testing.assert_array_equal(own.cells, corners.cells)
    np.testing.assert_array_equal(own.X[own.node_sets["end"], 0], 3.0)
    assert (own.X[own.facets[own.facet_sets["top"]], 2] == 1).all() and len(own.facet_sets["top"]) > 5
    np.testing.assert_array_equal(own.cell_sets["half"], mesh.cell_sets["half"])


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".msh"])
@pytest.mark.parametrize("element", ["tet4", "hex8"])
def test_a_users_mesh_of_any_format_and_unit(tmp_path, element, suffix):
    mesh = box((3, 2, 1), (2, 1, 1), element)
    corners = mesh.cells.shape[1]
    stray = np.vstack([mesh.X, [[99.0, 99, 99]]])
    path = tmp_path / f"own{suffix}"
    options = {"file_format": "gmsh22", "binary": False} if suffix == ".msh" else {}
    blocks = [(CELLS[corners], mesh.cells), (FACETS[corners], mesh.facets)]
    meshio.write(path, meshio.Mesh(stray, blocks), **options)
    own = read_own(path, 10.0)
    np.testing.assert_allclose(own.X, mesh.X * 10)
    np.testing.assert_array_equal(own.cells, mesh.cells)


@pytest.mark.parametrize("element", ["tet4", "hex8"])
def test_cells_inside_out_are_turned_upright(tmp_path, element):
    mesh = box((3, 2, 1), (2, 1, 1), element)
    cells = mesh.cells.copy()
    cells[::2] = cells[::2][:, [4, 5, 6, 7, 0, 1, 2, 3] if element == "hex8" else [1, 0, 2, 3]]
    meshio.write(tmp_path / "own.vtu", meshio.Mesh(mesh.X, [(CELLS[cells.shape[1]], cells)]))
    own = read_own(tmp_path / "own.vtu", 1.0)
    np.testing.assert_allclose(own.volumes, mesh.volumes, rtol=1e-12)


@pytest.mark.parametrize(
    "name, content", [("a.vtu", b"<VTKFile"), ("a.msh", b"$Mesh"), ("a.xyz", b"1 2 3"), ("a.vtk", b"\x00\xff")]
)
def test_damaged_files_are_one_clear_error(tmp_path, name, content, capfd):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=name):
        read_own(tmp_path / name, 1.0)


def test_what_is_no_volume_mesh_is_refused(tmp_path):
    mesh = block((1, 1, 1), (1, 1, 1))
    meshio.write(tmp_path / "skin.vtu", meshio.Mesh(mesh.X, [("triangle", mesh.facets)]))
    with pytest.raises(InputError, match="tetrahedra or hexahedra and no other solid cells, got triangle"):
        read_own(tmp_path / "skin.vtu", 1.0)
    mixed = [("tetra", mesh.cells), ("wedge", mesh.cells[:1, [0, 1, 2, 3, 0, 1]])]
    meshio.write(tmp_path / "mixed.vtu", meshio.Mesh(mesh.X, mixed))
    with pytest.raises(InputError, match="got tetra, wedge"):
        read_own(tmp_path / "mixed.vtu", 1.0)
    flat = mesh.X * [1, 1, 0]
    meshio.write(tmp_path / "flat.vtu", meshio.Mesh(flat, [("tetra", mesh.cells)]))
    with pytest.raises(InputError, match="flat"):
        read_own(tmp_path / "flat.vtu", 1.0)
    with pytest.raises(InputError, match="no such file"):
        read_mesh(tmp_path / "none.vtu")


@pytest.mark.parametrize("node", [-1, 99])
def test_cells_name_nodes_that_are_there(tmp_path, node):
    mesh = box((3, 2, 1), (2, 1, 1), "tet4")
    cells = mesh.cells.copy()
    cells[0, 0] = node
    meshio.write(tmp_path / "own.vtu", meshio.Mesh(mesh.X, [("tetra", cells), ("triangle", mesh.facets)]))
    for read in (read_mesh, lambda path: read_own(path, 1.0)):
        with pytest.raises(
            InputError, match=rf"tetra cells name node {node}, but its nodes are 0 to {len(mesh.X) - 1}"
        ):
            read(tmp_path / "own.vtu")
