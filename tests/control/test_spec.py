from pathlib import Path

import pytest

from cfem.control.spec import ControlSpec
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec

PIPELINES = Path(__file__).parents[2] / "pipelines"


@pytest.mark.parametrize("scene", ["bar", "soft-finger", "diamond", "trunk"])
def test_pipelines_are_valid(scene):
    assert load_spec(PIPELINES / scene / "control.yaml", ControlSpec).trajectories


@pytest.mark.parametrize(
    "overrides, words",
    [
        (["trajectories.lift.rotation={deg: [[0, 0, 1]]}"], "6 points, but 1 rows of rotation: give one per goal"),
        (["trajectories.lift.rotation={deg: [[0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 1]]}",
          "object.turns=false"], "rotation: only an object has one, with object.turns: true"),
    ],
)  # fmt: skip
def test_mistakes_of_orientations_are_named(overrides, words):
    with pytest.raises(SpecError, match=words):
        load_spec(PIPELINES / "soft-gripper" / "control-lift.yaml", ControlSpec, overrides)


def test_an_orientation_is_controlled_where_a_goal_states_it_or_a_weight_asks_for_it():
    gripper = PIPELINES / "soft-gripper"
    assert load_spec(gripper / "control-place.yaml", ControlSpec).oriented
    assert not load_spec(gripper / "control-lift.yaml", ControlSpec).oriented
    assert load_spec(gripper / "control-lift.yaml", ControlSpec, ["search.weights=[1, 1, 1, 0, 0, 1]"]).oriented


@pytest.mark.parametrize(
    "override, words",
    [
        ("trajectories.swing.radii=[0.6]", "leaves the range"),
        ("trajectories.swing.radii=[0.1, 0.1]", "one number for all actuators, or one per actuator"),
        ("trajectories.swing.kind=ark", "arc"),
        ("search.step=5", "such as '1 mm'; got the bare number 5 .of a chamber: in mm.3"),
        ("plant=model", "fe_based: needs plant: fem"),
        ("search.itterations=3", "iterations"),
        ("search.weights=[0, 0, 0]", "weights are all 0, so that nothing would be controlled"),
    ],
)
def test_mistakes_are_named(override, words):
    with pytest.raises(SpecError, match=words):
        load_spec(PIPELINES / "bar" / "control.yaml", ControlSpec, [override])
