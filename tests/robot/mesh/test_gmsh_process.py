"""What the process around gmsh makes of gmsh's answers."""

import signal
import subprocess
import sys
from unittest.mock import MagicMock

import meshio
import numpy as np
import pytest
from support.blocks import block

from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.robot.cad import Box, Difference, Frustum, SurfaceSolid
from cfem.robot.mesh.gmsh_process import mesh, processor_time, segments
from cfem.robot.mesh.meshing import run_gmsh
from cfem.robot.spec import Meshing


@pytest.mark.parametrize(("length", "kept"), [(30.0, True), (28.0, True), (24.0, False)])
def test_a_mesh_that_lacks_an_end_of_the_body_is_refused(tmp_path, length, kept):
    """A bar of 30 mm in cells of 10 mm; gmsh answers with one of `length`."""
    body, answer = block((30.0, 5.0, 5.0), (6, 1, 1)), block((length, 5.0, 5.0), (6, 1, 1))
    np.savez(tmp_path / "surface.npz", X=body.X, triangles=body.facets)
    gmsh = MagicMock()
    gmsh.model.mesh.getNodes.return_value = (np.arange(len(answer.X)) + 1, answer.X.ravel(), None)
    gmsh.model.mesh.getElementsByType.return_value = (None, answer.cells.ravel() + 1)
    job = {
        "solid": {"kind": "SurfaceSolid"},
        "surface": str(tmp_path / "surface.npz"),
        "size": 10.0,
        "factor": 1.0,
        "anew": True,
        "around": 0,
        "patience": 1,
        "refine": [],
        "max_cells": 1e6,
    }
    limits = []
    if kept:
        assert len(mesh(gmsh, job, limits.append)["cells"]) == len(answer.cells)
        assert limits == [11]  # s, before the first cell is made
        return
    with pytest.raises(ValueError, match="left out an end of the body: the mesh is 6 mm shorter"):
        mesh(gmsh, job)


@pytest.mark.parametrize(("degrees", "edges"), [(0, 1), (60, 1), (90, 2), (180, 3), (300, 5), (360, 6)])
def test_an_arc_keeps_its_shape_by_an_edge_for_each_60_degrees(degrees, edges):
    half = np.radians(degrees) / 2
    assert segments(float(np.sinc(half / np.pi))) == edges  # chord by length of an arc


def surface_file(path, body):
    """The skin of tetrahedra."""
    meshio.write(path, meshio.Mesh(body.X, [("triangle", body.facets)]))
    return SurfaceSolid(str(path), 1.0)


def test_straight_edges_of_a_surface_cost_no_more_cells_than_its_faces_need(tmp_path):
    """A frame of 28 x 28 x 6 mm with nine windows of 4 mm."""
    full = block((28.0, 28.0, 6.0), (14, 14, 3))
    corners = full.X[full.cells].mean(axis=1)[:, :2] % 8
    cells = full.cells[(corners < 4).any(axis=1)]
    frame = Mesh(full.X, cells, boundary_facets(cells), {}, {}, {})
    X, made, volume, _ = run_gmsh(surface_file(tmp_path / "frame.obj", frame), Meshing(size="8 mm", element="tet4"))
    assert volume == pytest.approx(frame.volumes.sum())
    edges = X[made[:, [1, 2, 3]]] - X[made[:, :1]]
    assert np.abs(np.linalg.det(edges)).sum() / 6 == pytest.approx(volume, rel=1e-9)
    assert len(made) < 800  # 2451 where cuts ignore the sharp edges and each curve has three edges


@pytest.mark.parametrize("size", [5.0, 12.0])
def test_a_hole_that_is_small_beside_the_cells_stays_open(tmp_path, size):
    """A plate of 30 x 30 x 4 mm with a hole of 2 mm."""
    plate = Difference(Box((0, 0, 0), (30, 30, 4)), (Frustum((15, 15, -1), (0, 0, 6), 1.0, 1.0),))
    X, cells, *_ = run_gmsh(plate, Meshing(size="1.5 mm", element="tet4"))
    own = Mesh(X, cells, boundary_facets(cells), {}, {}, {})
    X, cells, volume, _ = run_gmsh(
        surface_file(tmp_path / "plate.obj", own), Meshing(size=f"{size} mm", element="tet4")
    )
    filled = np.abs(np.linalg.det(X[cells[:, 1:]] - X[cells[:, :1]])).sum() / 6
    assert 0.7 * (3600 - volume) < 3600 - filled < 1.1 * (3600 - volume)


def test_the_time_that_gmsh_may_take_counts_the_cells_that_a_grading_asks_for():
    """A box of 10 x 10 x 10 mm in cells of 10 mm, and graded at 1 mm; two cells of a grading lie beyond the body."""
    body = block((10.0, 10.0, 10.0), (2, 2, 2))
    corners = body.X[body.cells]
    rows = np.hstack([corners[:, :, 0], corners[:, :, 1], corners[:, :, 2], np.ones((len(corners), 4))]).tolist()
    assert processor_time(8.485, {}) == 11
    assert processor_time(8.485, {"grading": [*rows, *2 * [[1e3] * 16]]}) == np.ceil(10 + 8485 / 200)


def test_a_process_that_takes_too_much_of_the_processor_is_ended():
    program = "from cfem.robot.mesh.gmsh_process import end_after; end_after(1)\nwhile True: pass"
    assert subprocess.run([sys.executable, "-c", program]).returncode == -signal.SIGXCPU
