"""Load cases that depend on those before them, as cables rub in their guides."""

import numpy as np
import pytest
from identify.cases.lab import CASES, QUIET, STAND_OFF, lab, write
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from cfem.core.spec import load_spec
from cfem.equilibrium.friction.sticking import Follower
from cfem.equilibrium.system.problem import Problem
from cfem.identify.cases.load import load_lab
from cfem.identify.cases.prediction.stage import run as predict
from cfem.identify.cases.spec import CasesSpec, TableColumns
from cfem.identify.cases.stage import run as calibrate
from cfem.identify.cases.table import read_cases
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import SceneSpec

HEADER = ("case", "session", "tension_N", "marker", "x_mm", "y_mm", "z_mm", "history")
LAYOUT = "  forces:\n    tendon: {column: tension_N, unit: N}\n"
FRICTION, NOISE = 0.25, 0.05


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = lab(tmp_path_factory.mktemp("lab"))
    (folder / "cases.yaml").write_text(CASES.replace(LAYOUT, "  history: history\n" + LAYOUT))
    return folder


def cycle(folder, tensions):
    _, mesh = load_scene_and_mesh(folder / "scene.yaml")
    truth = [f"actuators.0.friction={FRICTION}", "material.young=300 kPa"]
    robot = build_robot(load_spec(folder / "scene.yaml", SceneSpec, truth), mesh)
    rng, follower, rows = np.random.default_rng(1), Follower(Problem(robot)), []
    _, now = follower.rest()
    for number, tension in enumerate(tensions):
        at, now = follower.go(np.array([tension]), now)
        poses = (at.delta_e + robot.rest_e).reshape(2, 6)
        for marker, (which, off) in STAND_OFF.items():
            place = poses[which, :3] + Rotation.from_rotvec(poses[which, 3:]).as_matrix() @ off
            rows.append([f"c{number}", "a", tension, marker, *(place + NOISE * rng.standard_normal(3)), "h"])
    return rows


@pytest.mark.slow
def test_friction_is_told_by_a_cycle_and_another_cycle_is_predicted(folder, tmp_path):
    write(folder / "given.csv", cycle(folder, [0.6, 1.2, 0.8, 0.4]), HEADER)
    overrides = ["find=[young, friction]", "scatter=0.1 mm"]
    found = calibrate(folder / "cases.yaml", overrides, folder / "calibrated", QUIET)["results"]
    low, high = found["estimates"]["friction"]["interval"]
    assert low <= FRICTION <= high and high - low < 0.1
    assert found["scatter_mm"] < 2 * NOISE
    write(folder / "other.csv", cycle(folder, [1.0, 0.7, 1.0, 0.3]), HEADER)
    (folder / "cases.yaml").write_text(
        (folder / "cases.yaml").read_text().replace("[young, roll]", "[young, friction]")
    )
    assert predict(folder / "predict.yaml", [], tmp_path / "out", QUIET)["results"]["mean_mm"] < 3 * NOISE


def test_a_robot_rests_where_its_commands_have_led_it(folder):
    """The same tension after less, and after more."""
    spec = load_spec(folder / "cases.yaml", CasesSpec)
    write(folder / "given.csv", cycle(folder, [0.4, 0.8, 0.4]), HEADER)
    loaded = load_lab(spec, folder)
    cases, rig = loaded.read(folder / "given.csv"), loaded.rig(["young", "friction"], ("a",))
    z = [
        brentq(lambda z, one=one, v=v: one.value(z) - v, *one.bounds)
        for one, v in zip(rig.unknowns, (0.3, FRICTION), strict=True)
    ]
    places = rig.see(cases, np.array(z), np.zeros(0), slopes=False).y
    np.testing.assert_allclose(places, cases.places, atol=5 * NOISE)
    assert np.linalg.norm(places[0] - places[2], axis=1).max() > 20 * NOISE


def test_commands_before_stay_when_cases_are_left_out(tmp_path):
    rows = [[f"c{i}", "a", t, "m", 50, 0, i, "" if i == 2 else "h"] for i, t in enumerate([1.0, 2.0, 5.0, 3.0])]
    write(tmp_path / "given.csv", rows, HEADER)
    places, force = ["x_mm", "y_mm", "z_mm"], {"column": "tension_N", "unit": "N"}
    layout = TableColumns(case=["case"], position=places, forces={"c": force}, history="history")
    cases = read_cases(tmp_path / "given.csv", layout, ["m"], ["c"], ["N"], 100.0).only(np.array([0, 2, 3]))
    assert cases.before[1] is None and len(cases.before[0]) == 0
    np.testing.assert_array_equal(cases.before[2], [[1.0], [2.0]])
