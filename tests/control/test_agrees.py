"""A control spec that does not fit its scene ends before anything is solved."""

from pathlib import Path

import pytest

from cfem.control.spec import ControlSpec
from cfem.control.stage import COMMAND
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec

PIPELINES = Path(__file__).parents[2] / "pipelines"


def agrees(path, *overrides):
    COMMAND.agrees(load_spec(PIPELINES / path, ControlSpec, list(overrides)), (PIPELINES / path).parent)


def test_a_curve_has_a_number_for_each_actuator_of_the_scene():
    path, name = "soft-finger/control.yaml", "closed-curve"
    agrees(path)
    thirds = [f"trajectories.{name}.{key}=[0.3, 0.3, 0.3]" for key in ("centre", "radii")]
    with pytest.raises(SpecError, match="centre has 3 numbers, the robot 2 actuators"):
        agrees(path, *thirds)


def test_a_point_has_a_number_for_each_effector_row():
    points = "trajectories={points: {kind: goals, points: {mm: [[0, 1]]}}}"
    with pytest.raises(SpecError, match="a goal has 2 numbers, the robot 3 effector rows"):
        agrees("soft-finger/control.yaml", points)


def test_goals_of_a_held_object_are_not_rows_of_one_robot():
    agrees("soft-gripper/control-place.yaml")
