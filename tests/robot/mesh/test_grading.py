"""Graded meshes: about as many cells as asked for, a smaller error of W than even ones, the same every time."""

import numpy as np
import pytest
from robot.scenes import scene
from support.blocks import bar as bar_robot
from support.blocks import block

from cfem.core.errors import SpecError
from cfem.core.stage import Options
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.mesh.grading import estimate, grade
from cfem.robot.mesh.mesh_file import read_mesh
from cfem.robot.mesh.meshing import Grading, make_mesh
from cfem.robot.stage import run

PULL = "[{kind: cable, name: c, radius: 1 mm, pull_point: {mm: [0, 0, 4]}, points: {mm: [[10, 0, 4], [25, 0, 3]]},"
PULL += " reach: {mm: [0, 3]}}]"


def W_of(folder, mesh):
    spec = scene(folder, mesh=mesh, actuators=PULL)
    made, volume, _ = scene_mesh(spec, folder)
    found = solve(Problem(build_robot(spec, made)), actuation.force([0.0]))
    return found.condensed.W, made, volume


@pytest.mark.slow
def test_a_graded_mesh_errs_less_than_an_even_one_of_as_many_cells(tmp_path):
    fine, _, _ = W_of(tmp_path, "{size: 6 mm, cells: 6000, element: tet10p0}")
    graded, mesh, volume = W_of(tmp_path, "{size: 10 mm, cells: 1200, element: tet10p0}")
    even, plain, _ = W_of(tmp_path, "{size: 2.7 mm, element: tet10p0}")
    assert 0.6 * 1200 < len(mesh.cells) < 1.4 * 1200
    assert len(plain.cells) > 0.9 * len(mesh.cells)
    assert mesh.volumes.sum() == pytest.approx(volume, rel=1e-12)
    errors = [abs(W[3, 3] / fine[3, 3] - 1) for W in (graded, even)]  # of the cable
    assert errors[0] < 0.7 * errors[1]


@pytest.mark.usefixtures("anew")
def test_it_is_the_same_every_time_and_below_the_largest_size(tmp_path):
    spec = scene(tmp_path, mesh="{size: 6 mm, cells: 300, element: tet4}")
    one, *_ = scene_mesh(spec, tmp_path)
    results = run(tmp_path / "scene.yaml", [], None, Options(quiet=True))["results"]
    np.testing.assert_array_equal(one.X, read_mesh(tmp_path / "mesh" / "mesh.vtu").X)
    assert f"{len(one.cells)} cells; " in results["headline"][0]
    assert results["headline"][0].endswith("; sizes were graded for 300 cells")
    edges = np.linalg.norm(one.X[one.cells[:, 0]] - one.X[one.cells[:, 1]], axis=1)
    assert edges.max() < 2 * 6.0


def test_sizes_give_the_number_of_cells_asked_for_and_follow_the_error():
    robot = bar_robot(divisions=(6, 2, 2))
    errors = estimate(robot)
    assert (errors.squared >= 0).all() and errors.squared.sum() > 0
    mesh = robot.body.mesh
    coarse, fine = (grade(mesh, errors, cells, 30.0).sizes for cells in (200, 2000))
    assert (fine <= coarse + 1e-12).all()
    corners = np.unique(mesh.cells[:, :4])
    h = 6 * np.sqrt(2) * errors.volumes / fine[mesh.cells[:, :4]].mean(axis=1) ** 3
    assert 1000 < h.sum() < 4000
    # finest around the effector, a ball of 2 mm in the end face that a unit force indents
    near = np.linalg.norm(mesh.X[corners] - [60.0, 5.0, 5.0], axis=1) < 3
    assert fine[corners][near].max() < np.median(fine[corners])


def test_parts_of_an_assembly_are_graded_where_they_stand(tmp_path):
    part = "geometry: {kind: bar, length: 30 mm, width: 10 mm, height: 10 mm}"
    left = f"{{name: left, {part}}}"
    right = f"{{name: right, {part}, translate: {{mm: [0, 40, 0]}}, rotate: {{axis: [0, 0, 1], angle: 20 deg}}}}"
    spec = scene(
        tmp_path,
        geometry=f"{{kind: assembly, parts: [{left}, {right}]}}",
        mesh="{size: 8 mm, cells: 400, element: tet4}",
        fixed="[{kind: box, corners: {mm: [[-9, -9, -9], [1, 60, 9]]}}]",
    )
    mesh, *_ = scene_mesh(spec, tmp_path)
    assert set(mesh.cell_sets) == {"left", "right"}
    # only the left one has a cable, so most of the cells are there
    assert len(mesh.cell_sets["left"]) > len(mesh.cell_sets["right"])


def test_what_cannot_be_graded_says_so(tmp_path):
    with pytest.raises(SpecError, match="grades tetrahedra"):
        scene(tmp_path, mesh="{size: 5 mm, element: hex8, cells: 500}")


def test_sizes_from_cells_that_touch_both_sides_of_a_plate(tmp_path):
    plate = block((90.0, 30.0, 4.0), (25, 10, 1))
    spec = scene(tmp_path, geometry="{kind: bar, length: 90 mm, width: 30 mm, height: 4 mm}", mesh="{size: 8 mm}")
    made, volume = make_mesh(spec, tmp_path, Grading(plate, np.full(len(plate.X), 8.0)))
    assert made.volumes.sum() == pytest.approx(90 * 30 * 4) == pytest.approx(volume)
