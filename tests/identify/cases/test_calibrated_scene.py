"""The scene that a calibration writes: its robot is where the calibration predicts the markers, and can be learned."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from identify.cases.lab import CASES, QUIET, lab, rows, write
from scipy.spatial.transform import Rotation

from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.identify.cases.stage import run as calibrate
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import SceneSpec
from cfem.robot.stage import run as make_mesh
from cfem.sample.stage import run as sample

TENSIONS, SCALE = (0.3, 0.6, 0.9, 1.2), 1.25


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A lab whose drive pulls by a quarter more than it is told, and whose markers lie beside by 4 mm f - 3 mm f^2."""
    folder = lab(tmp_path_factory.mktemp("lab"))
    measured = rows(folder, [SCALE * tension for tension in TENSIONS], np.random.default_rng(3))
    for number, row in enumerate(measured):
        told = TENSIONS[number // 3]
        row[2], row[5] = told, row[5] + 4.0 * told - 3.0 * told**2
    write(folder / "given.csv", measured)
    text = CASES.replace("find: [young, roll]", "find: [stronger]\ndiscrepancy: true").replace(
        "parameters:\n",
        "parameters:\n  stronger: {key: drive.tendon.scale, range: [0.5, 2]}\n",
    )
    (folder / "cases.yaml").write_text(text)
    scene = (folder / "scene.yaml").read_text().replace("young: 400 kPa", "young: 300 kPa")
    (folder / "scene.yaml").write_text(scene)
    make_mesh(folder / "scene.yaml", [], None, QUIET)
    return folder


def test_its_robot_is_where_the_calibration_predicts_the_markers(folder):
    results = calibrate(folder / "cases.yaml", [], None, QUIET)["results"]
    assert any("drive.tendon.scale is 1.2" in line and "belongs to the drive" in line for line in results["headline"])
    path = folder / "calibrated" / "scene.yaml"
    (folder / "turning.yaml").write_text(path.read_text().replace("[100, 0, 0]}", "[100, 0, 0]}, orientation: true"))
    robot = build_robot(*load_scene_and_mesh(folder / "turning.yaml", folder / "mesh"))
    assert robot.discrepancy.largest == pytest.approx(results["estimates"]["stronger"]["value"] * TENSIONS[-1])
    with open(folder / "calibrated" / "predicted.csv", newline="") as file:
        predicted = [row for row in csv.DictReader(file) if row["marker"] == "t"]
    plain, gained = Problem(replace(robot, discrepancy=None)), []
    for told, row in zip(TENSIONS, predicted, strict=True):
        at = force(np.array([told * results["estimates"]["stronger"]["value"]]))
        place = np.array([float(row[f"place_{axis}_mm"]) for axis in "xyz"])
        for problem, beside in ((Problem(robot), 1e-3), (plain, None)):
            tip = (solve(problem, at, wanted=Wanted(condense=False)).delta_e + robot.rest_e)[3:]
            off = np.linalg.norm(tip[:3] + Rotation.from_rotvec(tip[3:]).as_matrix() @ [5, 0, 0] - place)
            assert beside is None or off < beside
            gained.append(off)
    assert max(gained[1::2]) > 0.5


def test_a_drive_that_is_no_multiple_leaves_the_discrepancy_out(folder, tmp_path):
    overrides = ["find=[slack]", "parameters.slack={key: drive.tendon.offset, range: {N: [-0.2, 0.2]}}"]
    results = calibrate(folder / "cases.yaml", overrides, tmp_path / "out", QUIET)["results"]
    assert any("scene.yaml has no discrepancy: it goes with the commands" in line for line in results["headline"])
    assert load_spec(tmp_path / "out" / "scene.yaml", SceneSpec).discrepancy is None


def test_samples_beyond_the_calibration_are_poor(folder, tmp_path):
    """The reach that the calibration has ended is opened again."""
    calibrate(folder / "cases.yaml", [], None, QUIET)
    path = folder / "calibrated" / "scene.yaml"
    scene = load_spec(path, SceneSpec)
    low, high = scene.actuators[0].reach
    assert low == 0 and 5 < high < 15
    (folder / "far.yaml").write_text(
        path.read_text().replace(f"reach: {{mm: [0.0, {high:g}]}}", "reach: {mm: [0, 25]}")
    )
    plan = f"mesh: {folder}/mesh\nskin: null\nsplits:\n  train: {{rows: 6, method: scrambled-halton, seed: 1}}\n"
    told = {}
    for name, file in (("within", path), ("far", folder / "far.yaml")):
        (tmp_path / f"sample-{name}.yaml").write_text(f"scene: {file}\nout: {name}\nskeleton: 3\n{plan}")
        told[name] = str(sample(tmp_path / f"sample-{name}.yaml", [], None, QUIET)["results"].get("judgement"))
    with pytest.raises(SpecError, match="loads: the scene's discrepancy, of a calibration"):
        sample(tmp_path / "sample-within.yaml", ["loads=true"], tmp_path / "loaded", QUIET)
    assert "have forces beyond the calibration's largest (tendon" in told["far"] and "beyond" not in told["within"]
