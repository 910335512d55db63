"""A control spec that does not fit its scene ends before anything is solved."""

from pathlib import Path

import pytest
import yaml

from cfem.control.spec import ControlSpec
from cfem.control.stage import COMMAND
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec

PIPELINES = Path(__file__).parents[2] / "pipelines"

POINTS = "trajectories={points: {kind: goals, points: {mm: ["


def agrees(path, *overrides):
    COMMAND.agrees(load_spec(PIPELINES / path, ControlSpec, list(overrides)), (PIPELINES / path).parent)


def test_a_curve_has_a_number_for_each_actuator_of_the_scene():
    path, name = "soft-finger/control.yaml", "closed-curve"
    agrees(path)
    thirds = [f"trajectories.{name}.{key}=[0.3, 0.3, 0.3]" for key in ("centre", "radii")]
    with pytest.raises(SpecError, match="centre has 3 numbers, the robot 2 actuators"):
        agrees(path, *thirds)


def test_a_point_has_a_number_for_each_effector_row():
    points = f"{POINTS}[0, 1]]}}}}}}"
    with pytest.raises(SpecError, match="a goal has 2 numbers, the robot 3 effector rows"):
        agrees("soft-finger/control.yaml", points)


def test_no_goal_is_set_for_a_centre_of_mass_unless_all_rows_have_numbers(tmp_path):
    """Of a scene with two points and the centre of mass a goal has 6 numbers, or 9."""
    scene = yaml.safe_load((PIPELINES / "soft-finger/scene.yaml").read_text())
    scene["effectors"] += [scene["effectors"][0] | {"name": "other"}, {"name": "body", "at": "centre-of-mass"}]
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene))
    for numbers in ([0.0] * 6, [0.0] * 9):
        agrees("soft-finger/control.yaml", f"scene={tmp_path}/scene.yaml", f"{POINTS}{numbers}]}}}}}}")
    with pytest.raises(SpecError, match="a goal has 3 numbers, the robot 9 effector rows"):
        agrees("soft-finger/control.yaml", f"scene={tmp_path}/scene.yaml", f"{POINTS}[0, 1, 2]]}}}}}}")


def test_goals_of_a_held_object_are_not_rows_of_one_robot():
    agrees("soft-gripper/control-place.yaml")


def test_a_gait_has_no_curves_to_compare():
    agrees("crawler/control.yaml")


def test_a_scene_that_nothing_drives_has_nothing_to_control(tmp_path):
    scene = yaml.safe_load((PIPELINES / "soft-finger/scene.yaml").read_text())
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene | {"actuators": []}))
    with pytest.raises(SpecError, match="nothing drives the robot yet"):
        agrees("soft-finger/control.yaml", f"scene={tmp_path}/scene.yaml")
