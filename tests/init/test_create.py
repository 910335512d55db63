"""`cfem init` as a user types it: files that load, a robot that can be built, guesses said, nothing overwritten."""

import io
import json
import re
import subprocess
import sys
from pathlib import Path

import jsonschema
import meshio
import numpy as np
import pytest
from init.bodies import chambered, frame, twin, write_cells, write_stl
from support.blocks import block
from support.fast_cases import fast_are
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.cli.init import is_terminal
from cfem.cli.schemas import schema_of
from cfem.core.console import progress
from cfem.core.errors import SpecError
from cfem.core.kinds import model_of
from cfem.core.spec import load_spec
from cfem.core.yaml import read_yaml
from cfem.export.page.layout import robot_layout
from cfem.init import create
from cfem.init.texts import ON_PAGE
from cfem.robot.build import build_robot
from cfem.robot.checks.plausible import doubts
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

MADE = (
    "scene",
    "sample",
    "train",
    "export",
    "export-page",
    "control",
    "report",
)  # calibration and design need parameters
STEP = Path(__file__).parents[2] / "docs" / "tutorial" / "s-arm.step"


def init(folder, source, *words, typed=None):
    words = ["init", "own", "--from", str(source), "--folder", str(folder / "pipelines"), *words]
    return CliRunner().invoke(app, words, input=typed)


def specs(folder):
    """Every file as its stage reads it, and as an editor checks it."""
    own = folder / "pipelines" / "own"
    for stage in MADE:
        kind = stage.split("-")[0]
        jsonschema.Draft7Validator(json.loads(schema_of(kind))).validate(read_yaml(own / f"{stage}.yaml")[0])
        yield stage, load_spec(own / f"{stage}.yaml", model_of(kind))


def built(folder):
    own = folder / "pipelines" / "own"
    scene = load_spec(own / "scene.yaml", SceneSpec)
    return scene, build_robot(scene, make_mesh(scene, own)[0])


@pytest.mark.slow
def test_a_step_file_becomes_a_scene(tmp_path):
    done = init(tmp_path, STEP)
    assert done.exit_code == 0, done.stderr
    own = tmp_path / "pipelines" / "own"
    assert (own / "own.step").read_bytes() == STEP.read_bytes()
    found = dict(specs(tmp_path))
    assert [found["control"].trajectories["closed-curve"].radii, found["train"].model.kind] == [0.3, "spectral"]
    assert found["report"].page.resolve() == found["export-page"].out.resolve()
    assert {found[stage].scene.name for stage in ("sample", "control", "report")} == {"scene.yaml"}
    scene, robot = built(tmp_path)
    assert robot.rows.n_a == 3 and scene.length == 120
    drawn_out = -robot.reach[:, 0] / robot.reach[:, 1]  # by the other cables
    assert (drawn_out > 0).all() and (drawn_out < 0.5).all()
    np.testing.assert_array_equal(robot.fixed, np.flatnonzero(robot.body.mesh.X[:, 2] == 0))
    np.testing.assert_allclose(robot.rest_e, [0, 0, 120], atol=0.5)
    for flag in ("cells", "fixed", "young", "poisson", "cables", "through-air", "reach", "effector", "also"):
        assert f'--{flag} "' in done.stderr, flag
    text = (own / "scene.yaml").read_text()
    assert text.count("guessed: ") == 7
    assert "fixed:    # guessed: the face at one end of the longest axis (thicker)" in text
    assert f"then cfem run {own}" in done.stdout and "guessed" not in done.stdout


@pytest.mark.slow
def test_a_robot_of_more_cables_than_a_page_has_room_for_has_none(tmp_path):
    assert init(tmp_path, STEP, "--cables", "9", "--reach", "3 mm").exit_code == 0
    own = tmp_path / "pipelines" / "own"
    assert not (own / "export-page.yaml").exists() and "page" not in read_yaml(own / "report.yaml")[0]
    assert robot_layout().room["CFEM_MOST_NA"] == ON_PAGE


def test_a_closed_surface_in_another_unit_with_all_answers_given(tmp_path):
    write_stl(tmp_path / "Body.STL", (6.0, 1.0, 1.0))
    answers = [
        "--also",
        "none",
        "--through-air",
        "no",
        "--unit",
        "cm",
        "--cells",
        "600",
        "--fixed",
        "x >= 58 mm",
        "--young",
        "1 MPa",
        "--poisson",
        "0.3",
    ]
    cables = ["--cable", "up: 60, 5, 8; 40, 5, 8; 10, 5, 8", "--cable", "down: 60, 5, 2; 40, 5, 2; 10, 5, 2"]
    done = init(tmp_path, tmp_path / "Body.STL", *answers, *cables, "--reach", "4 mm", "--effector", "0, 5, 5")
    assert done.exit_code == 0 and done.stderr == ""
    scene, robot = built(tmp_path)
    assert [scene.material.young, scene.material.poisson, scene.mesh.cells] == [1.0, 0.3, 600]
    assert robot.reach[:, 1].tolist() == [4, 4] and (robot.reach[:, 0] < 0).all()  # each is let out by the other
    assert robot.rows.actuators == ("up", "down") and robot.rest_e.tolist() == [0, 5, 5]
    text = (tmp_path / "pipelines" / "own" / "scene.yaml").read_text()
    assert "guessed:" not in text and "path: own.stl" in text


@pytest.mark.parametrize("stated", [[], ["--unit", "inch"]], ids=["guessed", "stated"])
def test_an_uncertain_unit_is_said_on_screen_and_in_the_scene_unless_it_is_stated(tmp_path, stated):
    write_stl(tmp_path / "own.stl", (3.15, 0.8, 0.8))
    words = ["--cable", "up: 80, 10, 15; 50, 10, 15; 20, 10, 15", "--reach", "1 mm", "--cells", "600", "--quiet"]
    done = init(tmp_path, tmp_path / "own.stl", *words, *stated)
    assert done.exit_code == 0, done.stderr
    text = (tmp_path / "pipelines" / "own" / "scene.yaml").read_text()
    assert "unit: 25.4 mm" in text and ("UNCERTAIN: in mm it would be 3.15 mm long" in text) == (not stated)
    said = "the unit of own.stl is uncertain, as in mm it would be 3.15 mm long and in cm it would be 31.5 mm long"
    assert (f"{said}: state --unit\n" in done.stdout) == (not stated)


L = """
import gmsh

gmsh.initialize()
occ = gmsh.model.occ
occ.fuse([(3, occ.addBox(0, 0, 0, 60, 10, 10))], [(3, occ.addBox(0, 0, 0, 10, 60, 10))])
occ.synchronize()
gmsh.write("l.step")
"""


@pytest.mark.slow
def test_an_l_is_held_at_the_end_of_a_leg_and_says_why(tmp_path):
    subprocess.run([sys.executable, "-c", L], cwd=tmp_path, check=True, capture_output=True)
    done = init(tmp_path, tmp_path / "l.step", "--cells", "1000", "--cables", "1", "--reach", "3 mm")
    assert done.exit_code == 0, done.stderr
    said = next(line for line in done.stderr.splitlines() if line.startswith("--fixed"))
    assert re.fullmatch(r'--fixed "[xy] >= 60 mm"    # guessed: the longest way through the body begins here', said)
    text = (tmp_path / "pipelines" / "own" / "scene.yaml").read_text()
    assert "within it, along the middle of the body" in text
    robot = built(tmp_path)[1]
    axis = "xy".index(said[9])
    assert (robot.body.mesh.X[robot.fixed][:, axis] > 60 - 1e-6).all() and robot.rows.n_a == 1


@pytest.fixture(autouse=True)
def without_progress(monkeypatch):
    """On a slow machine there would be lines of it."""
    monkeypatch.setattr(progress, "FIRST", 1e9)


@pytest.fixture
def rooms(tmp_path):
    """The file of a body with two closed inner surfaces."""
    mesh = chambered().mesh
    meshio.write(tmp_path / "rooms.vtu", meshio.Mesh(mesh.X, [("tetra", mesh.cells)]))
    return tmp_path / "rooms.vtu"


def test_a_body_with_closed_inner_surfaces_is_driven_by_chambers(tmp_path, rooms):
    done = init(tmp_path, rooms, "--unit", "mm", "--growth", "50 mm^3", "--json")
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["chambers"] == ["chamber-1", "chamber-2"]
    assert '--chambers "all"    # guessed: the 2 closed inner surfaces of the body' in done.stderr
    robot = built(tmp_path)[1]
    np.testing.assert_array_equal(robot.reach, [[0, 50], [0, 50]])
    assert sorted(actuator.rest_volume for actuator in robot.actuators) == pytest.approx([12 * 36, 14 * 36])


def test_a_chamber_beside_another_keeps_a_fifth_of_what_it_holds_however_far_that_grows(tmp_path):
    mesh = twin().mesh
    meshio.write(tmp_path / "rooms.vtu", meshio.Mesh(mesh.X, [("tetra", mesh.cells)]))
    done = init(tmp_path, tmp_path / "rooms.vtu", "--unit", "mm", "--growth", "20000 mm^3", "--self-contact", "no")
    assert done.exit_code == 0, done.stderr
    np.testing.assert_allclose(built(tmp_path)[1].reach, [[-0.8 * 640, 20000]] * 2, rtol=0.01)


@pytest.mark.slow
def test_closed_inner_surfaces_are_no_chambers_or_some_of_them_are_where_asked(tmp_path, rooms):
    cables = ("--chambers", "none", "--cables", "2", "--reach", "1 mm")
    assert init(tmp_path, rooms, "--unit", "mm", *cables).exit_code == 0
    assert [item.kind for item in built(tmp_path)[0].actuators] == ["cable", "cable"]
    own = ["--chamber", "left: 10, 6, 6", "--growth", "20 mm^3"]
    assert init(tmp_path, rooms, "--unit", "mm", *own, "--force").exit_code == 0
    assert built(tmp_path)[1].rows.actuators == ("left",)


def test_what_cannot_be_suggested_is_left_open_in_a_scene_that_meshes(tmp_path, mesh_file, monkeypatch):
    def refuse(*arguments):
        raise SpecError("the body is in the way")

    monkeypatch.setattr("cfem.init.drive.place", refuse)
    done = init(tmp_path, mesh_file, "--unit", "mm", "--fixed", "left", "--quiet")
    assert done.exit_code == 0 and "open: what drives the robot? the body is in the way" in done.stdout
    text = (tmp_path / "pipelines" / "own" / "scene.yaml").read_text()
    assert "# OPEN: what drives the robot? the body is in the way." in text and "\nactuators: []\n" in text
    meshed = CliRunner().invoke(app, ["mesh", str(tmp_path / "pipelines" / "own" / "scene.yaml"), "--quiet"])
    assert meshed.exit_code == 0, meshed.stderr
    ran = CliRunner().invoke(app, ["run", str(tmp_path / "pipelines" / "own"), "--quiet"])
    assert ran.exit_code == 2 and "actuators: nothing drives the robot yet" in ran.stderr
    # the comment is an answer but for its numbers
    answer = text.replace("actuators: []\n", "").replace("# actuators:", "actuators:").replace("#   ", "  ")
    (tmp_path / "pipelines" / "own" / "scene.yaml").write_text(answer)
    assert [item.kind for item in load_spec(tmp_path / "pipelines" / "own" / "scene.yaml", SceneSpec).actuators] == [
        "cable",
        "cavity",
    ]


def test_a_poor_surface_is_mended_and_that_is_said(tmp_path):
    write_stl(tmp_path / "body.stl", (60.0, 10.0, 10.0), facets=slice(1, None))
    cables = ["--cable", "a: 0, 5, 8; 20, 5, 8; 50, 5, 8", "--reach", "2 mm", "--through-air", "no"]
    done = init(tmp_path, tmp_path / "body.stl", "--unit", "mm", "--cells", "600", *cables)
    assert done.exit_code == 0, done.stderr
    assert "mended body.stl: closed a hole" in done.stdout
    assert "# own.stl was mended: closed a hole" in (tmp_path / "pipelines" / "own" / "scene.yaml").read_text()


@pytest.mark.slow
def test_of_several_bodies_in_a_file_one_is_taken_which_is_said_and_can_be_chosen(tmp_path):
    large, small = block((60.0, 10.0, 10.0), (6, 1, 1)), block((40.0, 10.0, 10.0), (4, 1, 1))
    X = np.vstack([large.X, small.X + [0, 100, 0]])
    facets = np.vstack([large.facets, small.facets + len(large.X)])
    meshio.write(tmp_path / "two.stl", meshio.Mesh(X, [("triangle", facets)]), binary=False)
    words = ["--unit", "mm", "--cells", "600", "--fixed", "left", "--reach", "2 mm", "--force"]
    for body, y in (("1", 5), ("2", 105)):
        cable = f"a: 0, {y}, 8; 20, {y}, 8; 35, {y}, 8"
        done = init(tmp_path, tmp_path / "two.stl", *words, "--body", body, "--cable", cable)
        assert done.exit_code == 0, done.stderr
        assert f"took body {body} of 2, which hold 60, 40 % of the volume" in done.stdout
        scene, robot = built(tmp_path)
        assert scene.geometry.body == int(body)
        assert robot.body.mesh.volumes.sum() == pytest.approx(6000 if body == "1" else 4000, rel=1e-6)
    done = init(tmp_path, tmp_path / "two.stl", *words, "--body", "3")
    assert done.exit_code == 2 and "--body: expected a whole number from 1 to 2, got '3'" in done.stderr


@pytest.mark.slow
def test_the_inside_of_a_mesh_file_is_meshed_anew_where_asked(tmp_path, mesh_file):
    words = ["--unit", "mm", "--remesh", "yes", "--cells", "600", "--fixed", "left", "--cables", "1", "--reach", "2 mm"]
    assert init(tmp_path, mesh_file, *words).exit_code == 0
    scene, robot = built(tmp_path)
    assert scene.geometry.remesh and scene.mesh.cells == 600
    assert robot.body.mesh.volumes.sum() == pytest.approx(6000, rel=1e-6)


@pytest.mark.parametrize("element, expected", fast_are([("tet4", "tet10p0")], [("tet4", "tet10p0"), ("hex8", "hex8")]))
def test_a_mesh_file_keeps_its_cells_and_sets(tmp_path, element, expected):
    write_cells(tmp_path / "own.vtu", element)
    done = init(tmp_path, tmp_path / "own.vtu", "--fixed", "wall", "--cables", "2", "--reach", "3 mm", "--json")
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["cables"] == ["cable-1", "cable-2"]
    scene, robot = built(tmp_path)
    assert (scene.mesh.element, scene.mesh.cells) == (expected, None)
    assert (robot.body.mesh.X[robot.fixed][:, 0] == 0).all() and len(dict(specs(tmp_path))) == len(MADE)


def test_a_scene_that_is_there_stays_unless_forced(tmp_path):
    write_cells(tmp_path / "own.vtu")
    assert init(tmp_path, tmp_path / "own.vtu", "--reach", "3 mm").exit_code == 0
    own = tmp_path / "pipelines" / "own"
    (own / "scene.yaml").write_text("mine")
    (own / "sample-large.yaml").write_text("mine too")
    again = init(tmp_path, tmp_path / "own.vtu")
    assert again.exit_code == 6 and "--force" in again.stderr and (own / "scene.yaml").read_text() == "mine"
    # the shape may lie where its copy would
    assert init(tmp_path, own / "own.vtu", "--force", "--reach", "3 mm").exit_code == 0
    assert (own / "scene.yaml").read_text() != "mine" and (own / "sample-large.yaml").read_text() == "mine too"


def test_a_shape_that_waits_in_its_folder_is_no_scene(tmp_path):
    own = tmp_path / "pipelines" / "own"
    own.mkdir(parents=True)
    write_cells(own / "own.vtu")
    assert init(tmp_path, own / "own.vtu", "--reach", "3 mm").exit_code == 0


@pytest.fixture
def mesh_file(tmp_path):
    write_cells(tmp_path / "own.vtu")
    return tmp_path / "own.vtu"


BAD = {
    "no file": (["--from", "none.step"], 3, "no such file"),
    "no shape": (["--from", __file__], 3, "cannot be read as a shape"),
    "wrong unit": (["--young", "3 mm"], 2, "--young: 'mm' is not a unit of stress"),
    "bare number": (["--reach", "3"], 2, "--reach: expected a length with its unit"),
    "incompressible": (["--poisson", "0.5"], 2, "--poisson: expected a number from 0 to 0.4999"),
    "no place": (["--fixed", "x <= 99 mm"], 2, "the body's x goes from 0 to 60 mm"),
    "many cables": (["--cables", "three"], 2, "from 0 to 12, got 'three' (write it as in '3')"),
    "no chamber": (["--chamber", "c: 30, 5, 5"], 2, "around (30, 5, 5) mm; the body has none"),
    "far": (
        ["--fixed", "Left", "--effector", "70, 5, 500"],
        2,
        "--effector: the point (70, 5, 500) is 490 mm from the",
    ),
    "cable in the air": (
        ["--cable", "a: 0, 5, 5; 20, 5, 5; 30, 5, 20; 40, 5, 5"],
        2,
        "--cable: point 1 of cable 'a' at (30, 5, 20) mm lies outside",
    ),
    "reach": (["--cable", "a: 0, 5, 5; 20, 5, 5", "--reach", "30 mm"], 2, "--reach: cable 'a' is 20 mm long"),
    "cable outside": (["--cable", "a: 0, 5, 5; 20, 5, 5; 40, 5, 50"], 2, "point 1 of cable 'a' at (40, 5, 50) mm lies"),
    "two ways": (["--cable", "a: 0, 5, 5; 20, 5, 5", "--cables", "2"], 2, "exclude each other"),
    "of no effect": (["--cells", "500"], 2, "--cells: the mesh in the file is taken as it is"),
    "same name": (["--cable", "a: 0, 5, 5; 20, 5, 5"] * 2, 2, "--cable: names must differ"),
}


@pytest.mark.parametrize("words, code, part", BAD.values(), ids=BAD.keys())
def test_bad_input_is_one_sentence_and_writes_nothing(tmp_path, mesh_file, words, code, part):
    done = init(tmp_path, mesh_file, "--quiet", *words)
    assert (done.exit_code, done.stdout) == (code, "")
    assert len(done.stderr.strip().splitlines()) == 1 and part in done.stderr
    assert not (tmp_path / "pipelines").exists()


@pytest.mark.parametrize("unit, part", [("0.001 mm", "0.06 x 0.01 x 0.01 mm"), ("1 km", "6e+07 x 1e+07 x 1e+07 mm")])
def test_an_implausible_unit_is_refused(tmp_path, mesh_file, unit, part):
    done = init(tmp_path, mesh_file, "--quiet", "--unit", unit)
    assert done.exit_code == 2 and "--unit: the body measures" in done.stderr and part in done.stderr
    assert "say --unit mm, and the body measures 60 x 10 x 10 mm" in done.stderr


def test_a_file_in_metres_told_to_be_in_millimetres_says_what_to_type(tmp_path):
    write_cells(tmp_path / "own.vtu", size=(0.06, 0.01, 0.01))
    done = init(tmp_path, tmp_path / "own.vtu", "--unit", "mm", "--quiet")
    assert done.exit_code == 2 and "say --unit m, and the body measures 60 x 10 x 10 mm" in done.stderr


def corner_to_corner(path):
    """A bar with a flat cell, and on it another bar that shares but an edge with it: a surface that nobody meshes."""
    mesh = block((60.0, 10.0, 10.0), (12, 2, 2))
    X = mesh.X.copy()
    X[(X == [5.0, 5.0, 5.0]).all(axis=1)] = [9.9, 5.0, 5.0]
    on_edge = np.flatnonzero((mesh.X[:, 1:] == 10.0).all(axis=1))
    turned = np.flatnonzero((mesh.X[:, 1:] == 0.0).all(axis=1))
    number = np.arange(len(X)) + len(X)
    number[turned] = on_edge[np.argsort(mesh.X[on_edge, 0])][np.argsort(np.argsort(mesh.X[turned, 0]))]
    cells = np.vstack([mesh.cells, number[mesh.cells]])
    meshio.write(path, meshio.Mesh(np.vstack([X, mesh.X + [0, 10, 10]]), [("tetra", cells)]))


def test_poor_cells_are_kept_where_their_surface_cannot_be_meshed(tmp_path):
    corner_to_corner(tmp_path / "own.vtu")
    words = ["--unit", "mm", "--fixed", "left", "--cables", "1", "--reach", "2 mm"]
    done = init(tmp_path, tmp_path / "own.vtu", *words)
    assert done.exit_code == 0, done.stderr
    assert re.search(r'--remesh "no" .*its angles .* its surface cannot be meshed: .* branches', done.stderr)
    assert not built(tmp_path)[0].geometry.remesh
    asked = init(tmp_path, tmp_path / "own.vtu", *words, "--remesh", "yes", "--force")
    assert asked.exit_code == 2 and "--remesh: its surface cannot be meshed" in asked.stderr
    cells = init(tmp_path, tmp_path / "own.vtu", *words, "--cells", "500", "--force")
    assert cells.exit_code == 2 and "--cells: the mesh in the file is taken as it is, as its surface" in cells.stderr


def test_fewer_cables_than_asked_for_are_said_on_screen_and_in_the_scene(tmp_path):
    shape = frame()
    meshio.write(tmp_path / "ring.vtu", meshio.Mesh(shape.mesh.X, [("tetra", shape.mesh.cells)]))
    done = init(tmp_path, tmp_path / "ring.vtu", "--unit", "mm", "--fixed", "left", "--reach", "1 mm, 2 mm", "--quiet")
    assert done.exit_code == 0, done.stderr
    said, do = "2 cables where 3 are usual: 2 ways around the body lead to the tip", "for more, hold another part"
    assert f"{said}; {do}" in done.stdout
    text = (tmp_path / "pipelines" / "own" / "scene.yaml").read_text()
    assert f"# {said}\n# {do}" in text
    np.testing.assert_array_equal(built(tmp_path)[1].reach[:, 1], [1, 2])
    again = ["--cables", "2", "--reach", "1 mm", "--force", "--quiet"]
    enough = init(tmp_path, tmp_path / "ring.vtu", "--unit", "mm", "--fixed", "left", *again)
    assert "2 cables where" not in enough.stdout
    asked = init(tmp_path, tmp_path / "ring.vtu", "--unit", "mm", "--fixed", "left", "--cables", "4", *again[2:])
    assert "2 cables where 4 were asked for: 2 ways" in asked.stdout


def test_a_mesh_with_a_cell_without_volume_is_meshed_anew_from_its_surface(tmp_path):
    mesh = block((60.0, 10.0, 10.0), (12, 2, 2))
    X = mesh.X.copy()
    inner = np.flatnonzero((X == [5.0, 5.0, 5.0]).all(axis=1))[0]
    cell = mesh.cells[(mesh.cells == inner).any(axis=1)][0]
    X[inner] = X[cell[cell != inner]].mean(axis=0)
    meshio.write(tmp_path / "own.vtu", meshio.Mesh(X, [("tetra", mesh.cells)]))
    words = ["--unit", "mm", "--cells", "500", "--fixed", "left", "--cables", "1", "--reach", "2 mm"]
    done = init(tmp_path, tmp_path / "own.vtu", *words)
    assert done.exit_code == 0, done.stderr
    assert '--remesh "yes"    # guessed: has flat cells without volume' in done.stderr
    assert built(tmp_path)[0].geometry.remesh


def test_what_takes_its_time_is_said(tmp_path, mesh_file, monkeypatch):
    shown, true = [], create.tried

    def tried(*args):
        shown.append(progress.what_is_done())
        return true(*args)

    monkeypatch.setattr(create, "tried", tried)
    assert init(tmp_path, mesh_file, "--unit", "mm", "--cables", "1", "--reach", "1 mm").exit_code == 0
    assert shown == ["building the robot on a coarse mesh"]


def test_without_stdin_the_defaults_are_taken(tmp_path, mesh_file, monkeypatch):
    for stdin in (None, io.StringIO()):
        monkeypatch.setattr("sys.stdin", stdin)
        assert not is_terminal()
    stdin.close()
    assert not is_terminal()


def test_a_flat_body_that_is_held_by_its_large_side_has_a_length_that_nobody_doubts(tmp_path):
    write_cells(tmp_path / "own.vtu", size=(60.0, 40.0, 10.0))
    words = ["--unit", "mm", "--fixed", "bottom", "--cables", "1", "--reach", "0.5 mm"]
    done = init(tmp_path, tmp_path / "own.vtu", *words)
    assert done.exit_code == 0, done.stderr
    scene, robot = built(tmp_path)
    assert scene.length == 60 and not [what for what in doubts(scene, robot) if what.startswith("length")]


def test_a_name_that_cannot_be(tmp_path, mesh_file):
    done = CliRunner().invoke(app, ["init", "My Robot", "--from", str(mesh_file), "--folder", str(tmp_path)])
    assert done.exit_code == 2 and "small letters" in done.stderr


def test_damaged_files_are_one_sentence(tmp_path, capfd):
    for suffix in ("step", "stl", "vtu", "vtk", "msh"):
        path = tmp_path / f"damaged.{suffix}"
        path.write_bytes(b"\x00\xffnot a shape")
        done = init(tmp_path, path)
        assert done.exit_code == 3 and len(done.stderr.strip().splitlines()) == 1 and path.name in done.stderr


class TestAtATerminal:
    @pytest.fixture(autouse=True)
    def terminal(self, monkeypatch):
        monkeypatch.setattr("cfem.cli.init.is_terminal", lambda: True)

    def test_questions_show_defaults_take_answers_and_ask_again(self, tmp_path, mesh_file):
        typed = ["", "", "here", "right", "2 MPa", "", "2", "", "", "", "-1 mm", "5 mm"]
        done = init(tmp_path, mesh_file, typed="\n".join(typed) + "\n")
        assert done.exit_code == 0, done.stderr
        assert "[1 mm: " in done.stderr and "cannot make sense of 'here'" in done.stderr
        assert "must be above zero, got '-1 mm'" in done.stderr and done.stdout.startswith("made")
        scene, robot = built(tmp_path)
        assert (robot.body.mesh.X[robot.fixed][:, 0] == 60).all()
        assert (scene.material.young, scene.material.poisson) == (2.0, 0.45)
        assert robot.reach[:, 1].tolist() == [5, 5] and (robot.reach[:, 0] < 0).all()
        np.testing.assert_allclose(robot.rest_e, [0, 5, 5])

    @pytest.mark.slow
    def test_what_an_option_says_is_not_asked(self, tmp_path, mesh_file):
        words = ["--unit", "mm", "--fixed", "left", "--young", "1 MPa", "--poisson", "0.3", "--cables", "1"]
        words += ["--remesh", "no", "--through-air", "auto", "--also", "none"]
        done = init(tmp_path, mesh_file, *words, "--reach", "3 mm", "--effector", "60, 5, 5")
        assert done.exit_code == 0 and done.stderr == ""

    def test_the_end_of_input_is_an_interruption_and_what_was_typed_is_not_lost(self, tmp_path, mesh_file):
        done = init(tmp_path, mesh_file, typed="\ncm\n\n3 MPa\n")
        assert done.exit_code == 130
        said = f"your answers, to go on with: cfem init own --from {mesh_file} --folder {tmp_path / 'pipelines'} "
        assert f"{said}--unit cm --young '3 MPa'\n" in done.stderr
        assert done.stderr.endswith("cfem: interrupted; no scene was written\n")
        assert not (tmp_path / "pipelines").exists()


@pytest.mark.slow
def test_a_forced_scene_takes_the_new_shape(tmp_path, mesh_file):
    assert init(tmp_path, mesh_file, "--reach", "3 mm").exit_code == 0
    other = tmp_path / "other.vtu"
    write_cells(other, size=(80.0, 10.0, 10.0))
    assert init(tmp_path, other, "--force", "--reach", "3 mm").exit_code == 0
    assert built(tmp_path)[0].length == 80


@pytest.mark.slow
def test_the_tutorial_shows_what_is_said_and_written(tmp_path):
    text = (STEP.parents[1] / "tutorial.md").read_text()
    assert (STEP.parent / "s-arm.py").read_text() in text
    done = init(tmp_path, STEP)
    shown = text.split("```\nwhat is suggested")[1].split("```")[0].splitlines()
    said = done.stderr.splitlines()
    assert shown[0].startswith(", to look at: ") and Path(said[0].rpartition(": ")[2]).is_file()
    assert [words(line) for line in shown[1:-1]] == [words(line) for line in said[1:]]
    written = (tmp_path / "pipelines" / "own" / "scene.yaml").read_text().replace("own.step", "s-arm.step")
    shown = text.split("```yaml\n")[1].split("```")[0]
    assert words(shown) in words(written)


def words(text):
    """Without the numbers, which another version of the mesher may change in their last digits."""
    return re.sub(r"-?\d+(\.\d+)?", "0", text)


def test_what_else_belongs_to_a_robot_is_in_its_scene(tmp_path, mesh_file):
    words = ["--push", "poke: 40, 5, 10; 0, 0, -1", "--travel", "2 mm", "--gravity", "-z", "--density", "1000 kg/m^3"]
    words += ["--region", "x >= 45 mm: 2 MPa, 0.3", "--contact", "side: 60, 5, 0", "--cables", "0", "--quiet"]
    done = init(tmp_path, mesh_file, "--fixed", "left", *words)
    assert done.exit_code == 0, done.stderr
    scene, robot = built(tmp_path)
    assert [item.kind for item in scene.actuators] == ["push"] and robot.reach.tolist() == [[0, 2]]
    np.testing.assert_allclose(robot.loads.sum(axis=0), [0, 0, -6000e-12 * 1000 * 9810], rtol=1e-9, atol=1e-12)
    assert scene.materials[0].material.young == 2.0 and scene.contacts[0].name == "side"
    refused = init(tmp_path, mesh_file, "--fixed", "left", "--symmetry", "y", "--quiet", "--force")
    assert refused.exit_code == 2 and "--symmetry: a .vtu file is not meshed half by half" in refused.stderr
