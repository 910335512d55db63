"""Free form: what moves with a control point, what a thicker wall is, and what is refused."""

import numpy as np
import pytest
from robot.scenes import scene

from cfem.core.errors import NumericalError
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.robot.build import build_robot
from cfem.robot.cad import Box
from cfem.robot.mesh.hexahedra import block
from cfem.robot.mesh.mesh_file import read_mesh, write_mesh
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.shape.deform import bump, displacement, shaped
from cfem.robot.shape.free_form import Control, FreeForm


def control(at, move, radius, **more) -> Control:
    return Control.model_validate({"at": {"mm": at}, "move": {"mm": move}, "radius": f"{radius} mm", **more})


def test_the_bump_is_one_at_its_point_and_joins_zero_with_four_derivatives():
    assert bump(np.array([0.0, 1.0, 2.0])).tolist() == [1.0, 0.0, 0.0]
    h = 1e-2
    near = bump(np.array([1 - 5 * h, 1 - 4 * h, 1 - 3 * h, 1 - 2 * h, 1 - h, 1.0, 1 + h]))
    assert np.abs(np.diff(near, 4)).max() < 1e-6  # (1 - r)^6: its fourth difference is of the order h^6
    small = np.array([0.02, 0.01])
    fall = (1 - bump(small)) / small**2
    assert fall[0] == pytest.approx(fall[1], rel=0.01)  # no odd power below the fifth: smooth at the point too


def test_a_control_point_moves_by_its_move_and_nothing_beyond_its_radius():
    one = control([0, 0, 5], [0, 2, -1], 8, mirror="z")
    points = np.array([[0, 0, 5.0], [0, 0, -5.0], [9.0, 0, 5.0], [0, 0, 13.1]])
    moved = displacement([one], points)
    other = displacement([one.model_copy(update={"mirror": None})], points)
    np.testing.assert_allclose(other[[0, 2, 3]], [[0, 2, -1], [0, 0, 0], [0, 0, 0]])
    np.testing.assert_allclose(moved[1], moved[0] * [1, 1, -1])  # the image: less where both reach, the same for both
    assert displacement([], points).tolist() == np.zeros((4, 3)).tolist()


SHAPE = "{controls: [{at: {mm: [15, 0, 5]}, move: {mm: [0, 0, 1]}, radius: 12 mm}]}"
PULLED = "[{kind: cable, name: c, points: {mm: [[5, 0, 2], [15, 0, 2], [25, 0, 2]]}, reach: {mm: [0, 3]}}]"


def test_a_robot_that_moves_as_a_whole_is_the_same_robot_elsewhere(tmp_path):
    far = SHAPE.replace("12 mm", "1e7 mm").replace("[0, 0, 1]", "[3, 0, 1]")
    plain, moved = (scene(tmp_path, actuators=PULLED, **more) for more in ({}, {"shape": far}))
    found = []
    for one in (plain, moved):
        robot = build_robot(one, make_mesh(one, tmp_path)[0])
        found.append((solve(Problem(robot), force(np.array([0.02]))), robot))
    np.testing.assert_allclose(found[1][0].condensed.W, found[0][0].condensed.W, rtol=1e-6)
    np.testing.assert_allclose(found[1][1].rest_e, found[0][1].rest_e + [3, 0, 1], atol=1e-9)


def test_all_that_is_attached_follows_the_free_form(tmp_path):
    contact = "[{name: tipped, point: {mm: [29, 0, 4]}}]"
    effectors = "[{name: tip, point: {mm: [29, 0, 0]}}, {name: beside, point: {mm: [15, 0, 6]}, orientation: true}]"
    spec = scene(tmp_path, actuators=PULLED, contacts=contact, effectors=effectors, shape=SHAPE)
    mesh, _ = make_mesh(spec, tmp_path)
    robot = build_robot(spec, mesh)
    before = build_robot(spec.model_copy(update={"shape": None}), mesh.base)
    np.testing.assert_array_equal(robot.actuators[0].nodes, before.actuators[0].nodes)
    np.testing.assert_array_equal(robot.fixed, before.fixed)
    assert np.all([one.value(robot.X) == pytest.approx(one.rest, abs=1e-9) for one in robot.active])
    assert robot.actuators[0].rest_length > before.actuators[0].rest_length + 0.005
    moves = displacement(spec.shape.controls, np.array([[15.0, 0, 6]]))[0]
    np.testing.assert_allclose(robot.rest_e[3:6], [15, 0, 6] + moves, atol=1e-9)
    np.testing.assert_allclose(np.concatenate([one.value(robot.X) for one in robot.effectors]), robot.rest_e, atol=1e-9)
    assert robot.body.mesh.volumes.sum() == pytest.approx(sum(part.volumes.sum() for part in robot.body.solids))


def test_a_force_on_a_region_follows_too(tmp_path):
    pushed = "[{kind: push, name: w, points: {mm: [[15, 0, 3]]}, direction: [0, 0, -1], reach: {mm: [0, 3]}}]"
    spec = scene(tmp_path, actuators=pushed, shape=SHAPE)
    robot = build_robot(spec, make_mesh(spec, tmp_path)[0])
    assert robot.actuators[0].value(robot.X) == pytest.approx(robot.actuators[0].rest) and robot.actuators[0].rest < -3


def test_what_a_mesh_was_before_its_free_form_is_kept_in_its_file(tmp_path):
    mesh, volume = make_mesh(scene(tmp_path, shape=SHAPE), tmp_path)
    write_mesh(tmp_path / "mesh.vtu", mesh)
    read = read_mesh(tmp_path / "mesh.vtu")
    np.testing.assert_array_equal(read.X, mesh.X)
    np.testing.assert_array_equal(read.base.X, mesh.base.X)
    assert volume is None and read.base.volumes.sum() == pytest.approx(3000)
    write_mesh(tmp_path / "mesh.vtu", mesh.base)
    assert read_mesh(tmp_path / "mesh.vtu").unshaped is None


def test_a_move_that_inverts_a_cell_is_refused_with_its_place_and_its_control_point(tmp_path):
    far = SHAPE.replace("[0, 0, 1]", "[0, 0, -9]")
    said = r"shape.controls.0: the free form leaves a cell at \(\S+, \S+, \S+\) mm with \S+ of its volume"
    with pytest.raises(NumericalError, match=said):
        make_mesh(scene(tmp_path, shape=far), tmp_path)


@pytest.fixture(scope="module")
def hollow() -> Mesh:
    """A block of 10 mm with a cubic void of 4 mm in its middle, cells of 1 mm cut from hexahedra."""
    X, cells = block(Box((0.0, 0, 0), (10.0, 10, 10)), 1.0, [])
    from cfem.mechanics.mesh import HEX_TETS

    centre = X[cells].mean(axis=1)
    cells = cells[~(np.abs(centre - X.mean(axis=0)) < 2).all(axis=1)]
    used, cells = np.unique(cells, return_inverse=True)
    X, cells = X[used] - X[used].mean(axis=0), cells.reshape(-1, 8)
    tets = cells[:, HEX_TETS].reshape(-1, 4)
    return Mesh(X, tets, boundary_facets(tets))


def wall(thicker, radius=50.0, **more) -> FreeForm:
    one = {"inside": {"mm": [0, 0, 0]}, "at": {"mm": [2, 0, 0]}, "thicker": f"{thicker} mm", "radius": f"{radius} mm"}
    return FreeForm.model_validate({"walls": [one | more]})


def test_a_wall_grows_into_its_cavity_and_the_outside_stays(hollow):
    made = shaped(wall(0.4, 1e6), hollow)
    outer = np.isclose(np.abs(hollow.X).max(axis=1), 5)
    np.testing.assert_array_equal(made.X[outer], hollow.X[outer])
    face = np.flatnonzero(np.isclose(hollow.X[:, 0], 2) & (np.abs(hollow.X[:, 1:]) < 1.5).all(axis=1))
    np.testing.assert_allclose(made.X[face], hollow.X[face] - [0.4, 0, 0], atol=1e-9)
    assert (made.volumes > 0).all()
    between = np.isclose(hollow.X[:, 0], 3) & (np.abs(hollow.X[:, 1:]) < 1.5).all(axis=1)
    follows = (hollow.X - made.X)[between, 0]
    assert (follows > 0.05).all() and (follows < 0.4).all()


def test_a_wall_changes_within_its_radius_alone(hollow):
    made = shaped(wall(0.3, 2.5), hollow)
    inner = np.isclose(np.abs(hollow.X).max(axis=1), 2)
    away = np.linalg.norm(hollow.X - [2, 0, 0], axis=1) >= 2.5
    np.testing.assert_array_equal(made.X[inner & away], hollow.X[inner & away])
    np.testing.assert_allclose(made.X[np.argmin(np.linalg.norm(hollow.X - [2, 0, 0], axis=1))], [1.7, 0, 0], atol=1e-9)


def test_a_wall_that_crosses_its_cavity_is_refused(hollow):
    with pytest.raises(NumericalError, match=r"shape.walls.0: the free form leaves a cell"):
        shaped(wall(-2.9, 3.0), hollow)
