import zipfile

import meshio
import numpy as np
import pytest
from support.blocks import block

from cfem.core.errors import InputError
from cfem.robot.mesh.surface_file import mended, read_surface

MESH = block((6.0, 2.0, 2.0), (3, 1, 1))
TURNED = "0 1 0 -1 0 0 0 0 1 5 0 0"  # by a quarter about z, then 5 along x


def write_3mf(path, X, triangles, unit="millimeter", item=TURNED):
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in X)
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in triangles)
    model = (
        f'<?xml version="1.0"?><model unit="{unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
        f'<resources><object id="1" type="model"><mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles>'
        '</mesh></object><object id="2" type="model"><components><component objectid="1"/></components></object>'
        f'</resources><build><item objectid="2" transform="{item}"/></build></model>'
    )
    with zipfile.ZipFile(path, "w") as package:
        package.writestr("3D/3dmodel.model", model)


def volume(X, triangles):
    return np.linalg.det(X[triangles]).sum() / 6


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off", "vtk", "vtu"])
def test_triangles_of_any_format(tmp_path, suffix):
    used, numbered = np.unique(MESH.facets, return_inverse=True)
    path = tmp_path / f"body.{suffix}"
    meshio.write(path, meshio.Mesh(MESH.X[used], [("triangle", numbered.reshape(-1, 3))]))
    X, triangles, said = read_surface(path)
    assert volume(X, triangles) == pytest.approx(24) and len(triangles) == len(MESH.facets) and said == ()


@pytest.mark.parametrize("suffix", ["vtk", "inp", "msh"])
def test_the_skin_of_a_volume(tmp_path, suffix):
    path = tmp_path / f"body.{suffix}"
    meshio.write(path, meshio.Mesh(MESH.X, [("tetra", MESH.cells)]))
    X, triangles, _ = read_surface(path)
    assert volume(X, triangles) == pytest.approx(24) and len(triangles) == len(MESH.facets)


def test_quadrilaterals_are_cut(tmp_path):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f " + " ".join(str(n + 1) for n in quad) for quad in quads]
    (tmp_path / "cube.obj").write_text("\n".join(lines) + "\n")
    X, triangles, _ = read_surface(tmp_path / "cube.obj")
    assert len(triangles) == 12 and volume(X, triangles) == pytest.approx(1)


def test_a_3mf_with_a_unit_and_a_placed_component(tmp_path):
    write_3mf(tmp_path / "body.3mf", MESH.X, MESH.facets, "inch")
    X, triangles, _ = read_surface(tmp_path / "body.3mf")
    assert volume(X, triangles) == pytest.approx(24 * 25.4**3)
    np.testing.assert_allclose(X.min(axis=0), np.array([3, 0, 0]) * 25.4, atol=1e-9)
    np.testing.assert_allclose(X.max(axis=0), np.array([5, 6, 2]) * 25.4, atol=1e-9)


@pytest.mark.parametrize(
    "content, part",
    [
        (b"PK nothing", "is no .3mf file"),
        ("<model><build><item objectid='7'/></build></model>", "builds an object '7'"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><model/>", "has a document type"),
        ("<model>", "is damaged"),
        ("<model/>", "holds no body"),
    ],
)
def test_a_damaged_3mf_is_one_sentence(tmp_path, content, part):
    path = tmp_path / "body.3mf"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        with zipfile.ZipFile(path, "w") as package:
            package.writestr("3D/3dmodel.model", content)
    with pytest.raises(InputError, match=part):
        read_surface(path)


def test_a_vtu_that_is_called_a_vtk(tmp_path):
    meshio.write(tmp_path / "body.vtu", meshio.Mesh(MESH.X, [("triangle", MESH.facets)]))
    (tmp_path / "body.vtu").rename(tmp_path / "body.vtk")
    assert volume(*read_surface(tmp_path / "body.vtk")[:2]) == pytest.approx(24)


def test_what_is_mended_is_said(tmp_path):
    apart = MESH.X[MESH.cells].reshape(-1, 3)
    cells = np.arange(len(apart)).reshape(-1, 4)
    meshio.write(tmp_path / "body.vtu", meshio.Mesh(apart, [("tetra", cells)]))
    merged = len(apart) - len(MESH.X)
    assert mended(tmp_path / "body.vtu", False) == (f"merged {merged} duplicate nodes, which kept cells apart",)
    meshio.write(tmp_path / "whole.vtu", meshio.Mesh(MESH.X, [("tetra", MESH.cells)]))
    assert mended(tmp_path / "whole.vtu", False) == ()
