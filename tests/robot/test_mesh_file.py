import meshio
import numpy as np
import pytest
from support.blocks import block

from cfem.core.errors import InputError
from cfem.mechanics.mesh import Mesh
from cfem.robot.mesh_file import read_mesh, read_tetrahedra, write_mesh


def named(order):
    mesh = block((3, 2, 1), (3, 2, 1), order)
    top = np.flatnonzero(mesh.X[mesh.facets[:, :3], 2].min(axis=1) > 1 - 1e-9)
    return Mesh(mesh.X, mesh.cells, mesh.facets, {"end": np.flatnonzero(mesh.X[:, 0] > 3 - 1e-9)}, {"top": top})


@pytest.mark.parametrize("order", [1, 2])
def test_round_trip_is_exact(tmp_path, order):
    mesh = named(order)
    write_mesh(tmp_path / "mesh.vtu", mesh)
    again = read_mesh(tmp_path / "mesh.vtu")
    for field in ("X", "cells", "facets"):
        np.testing.assert_array_equal(getattr(again, field), getattr(mesh, field))
    np.testing.assert_array_equal(again.node_sets["end"], mesh.node_sets["end"])
    np.testing.assert_array_equal(again.facet_sets["top"], mesh.facet_sets["top"])


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".msh"])
def test_a_users_mesh_of_any_format_and_unit(tmp_path, suffix):
    mesh = block((3, 2, 1), (2, 1, 1))
    stray = np.vstack([mesh.X, [[99.0, 99, 99]]])
    path = tmp_path / f"own{suffix}"
    options = {"file_format": "gmsh22", "binary": False} if suffix == ".msh" else {}
    meshio.write(path, meshio.Mesh(stray, [("tetra", mesh.cells), ("triangle", mesh.facets)]), **options)
    X, cells, _ = read_tetrahedra(path, 10.0)
    np.testing.assert_allclose(X, mesh.X * 10)
    np.testing.assert_array_equal(cells, mesh.cells)


def test_physical_groups_become_node_sets(tmp_path):
    mesh = block((3, 2, 1), (2, 1, 1))
    end = np.flatnonzero(mesh.X[mesh.facets, 0].max(axis=1) < 1e-9)
    tags = np.zeros(len(mesh.facets), dtype=int)
    tags[end] = 7
    data = {
        "gmsh:physical": [np.full(len(mesh.cells), 1), tags],
        "gmsh:geometrical": [np.full(len(mesh.cells), 1), tags],
    }
    own = meshio.Mesh(
        mesh.X,
        [("tetra", mesh.cells), ("triangle", mesh.facets)],
        cell_data=data,
        field_data={"held": np.array([7, 2]), "body": np.array([1, 3])},
    )
    meshio.write(tmp_path / "own.msh", own, file_format="gmsh22", binary=False)
    _, _, sets = read_tetrahedra(tmp_path / "own.msh", 1.0)
    np.testing.assert_array_equal(sets["held"], np.flatnonzero(mesh.X[:, 0] < 1e-9))
    assert len(sets["body"]) == len(mesh.X)


@pytest.mark.parametrize(
    "name, content", [("a.vtu", b"<VTKFile"), ("a.msh", b"$Mesh"), ("a.xyz", b"1 2 3"), ("a.vtk", b"\x00\xff")]
)
def test_damaged_files_are_one_clear_error(tmp_path, name, content, capfd):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=name):
        read_tetrahedra(tmp_path / name, 1.0)


def test_what_is_no_volume_mesh_is_refused(tmp_path):
    mesh = block((1, 1, 1), (1, 1, 1))
    meshio.write(tmp_path / "skin.vtu", meshio.Mesh(mesh.X, [("triangle", mesh.facets)]))
    with pytest.raises(InputError, match="no tetrahedra"):
        read_tetrahedra(tmp_path / "skin.vtu", 1.0)
    flat = mesh.X * [1, 1, 0]
    meshio.write(tmp_path / "flat.vtu", meshio.Mesh(flat, [("tetra", mesh.cells)]))
    with pytest.raises(InputError, match="flat"):
        read_tetrahedra(tmp_path / "flat.vtu", 1.0)
    with pytest.raises(InputError, match="no such file"):
        read_mesh(tmp_path / "none.vtu")
