"""A user's own geometry: STL-bounded volumes, mesh files, STEP; and what goes wrong with them."""

import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest
from support.blocks import block

from cfem.core.errors import InputError
from cfem.core.spec import load_spec
from cfem.robot import meshing
from cfem.robot.spec import SceneSpec

SCENE = """
name: own
out: mesh
length: 30 mm
geometry: {geometry}
mesh: {{size: 4 mm, element: tet4}}
material: {{young: 1 MPa, poisson: 0.3}}
fixed: [{{kind: plane, point: {{mm: [0, 0, 0]}}, normal: [-1, 0, 0]}}]
actuators: [{{kind: cable, name: c, points: {{mm: [[5, 5, 5], [25, 5, 5]]}}, reach: {{mm: [0, 3]}}}}]
effectors: [{{name: tip, point: {{mm: [29, 5, 5]}}}}]
"""


def scene(tmp_path, geometry):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE.format(geometry=geometry))
    return load_spec(path, SceneSpec)


def box_stl(path, facets=slice(None)):
    mesh = block((3, 1, 1), (3, 1, 1))
    meshio.write(path, meshio.Mesh(mesh.X, [("triangle", mesh.facets[facets])]), binary=False)


def test_the_volume_within_a_closed_surface(tmp_path):
    box_stl(tmp_path / "box.stl")
    mesh, volume = meshing.make_mesh(scene(tmp_path, "{kind: mesh-file, path: box.stl, unit: 1 cm}"), tmp_path)
    assert volume == pytest.approx(3000.0, rel=1e-6)
    assert mesh.volumes.sum() == pytest.approx(3000.0, rel=1e-9) and (mesh.volumes > 0).all()


def test_a_solid_from_a_step_file(tmp_path):
    code = (
        "import gmsh, sys; gmsh.initialize(interruptible=False); gmsh.option.setNumber('General.Terminal', 0);"
        "occ = gmsh.model.occ; whole, slot = occ.addBox(0, 0, 0, 30, 10, 10), occ.addBox(10, 4, -1, 10, 2, 12);"
        "occ.cut([(3, whole)], [(3, slot)]);"
        "occ.synchronize(); gmsh.write(sys.argv[1]); gmsh.finalize()"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "slot.step")], check=True, capture_output=True)
    mesh, volume = meshing.make_mesh(scene(tmp_path, "{kind: step, path: slot.step}"), tmp_path)
    assert volume == pytest.approx(2800.0, rel=1e-9) and mesh.volumes.sum() == pytest.approx(2800.0, rel=1e-9)


def test_an_open_surface_is_refused(tmp_path):
    box_stl(tmp_path / "open.stl", slice(2, None))
    with pytest.raises(InputError, match=r"open\.stl.*not closed"):
        meshing.make_mesh(scene(tmp_path, "{kind: mesh-file, path: open.stl}"), tmp_path)


def test_a_users_tetrahedra_keep_their_sets_and_are_turned_upright(tmp_path):
    mesh = block((30, 10, 10), (3, 1, 1))
    turned = mesh.cells[:, [1, 0, 2, 3]]
    flags = {"set:held": (mesh.X[:, 0] < 1e-9).astype(np.int8)}
    meshio.write(tmp_path / "own.vtu", meshio.Mesh(mesh.X, [("tetra", turned)], point_data=flags))
    ours, volume = meshing.make_mesh(scene(tmp_path, "{kind: mesh-file, path: own.vtu}"), tmp_path)
    assert volume is None and (ours.volumes > 0).all()
    np.testing.assert_array_equal(ours.node_sets["held"], np.flatnonzero(mesh.X[:, 0] < 1e-9))


def test_missing_libraries_become_one_sentence_with_the_packages(tmp_path, monkeypatch):
    fake = tmp_path / "gmsh.py"
    fake.write_text("raise OSError('libGLU.so.1: cannot open shared object file')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(InputError, match=r"libGLU\.so\.1.*apt-get install libglu1-mesa"):
        meshing.make_mesh(scene(tmp_path, "{kind: bar}"), tmp_path)


def test_set_up_installs_the_packages_that_the_message_names():
    script = (Path(__file__).parents[2] / "scripts" / "setup.sh").read_text()
    assert set(meshing.DEBIAN_PACKAGES.split()) == set(script.split('packages="')[1].split('"')[0].split())


@pytest.mark.parametrize("geometry", ["{kind: step, path: none.step}", "{kind: mesh-file, path: none.vtu}"])
def test_missing_files(tmp_path, geometry):
    with pytest.raises(InputError, match="no such file"):
        meshing.make_mesh(scene(tmp_path, geometry), tmp_path)
