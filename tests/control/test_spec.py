from pathlib import Path

import pytest

from cfem.control.closed_loop.run_spec import ClosedLoopSpec
from cfem.control.crawling.spec import CrawlingSpec
from cfem.control.holding.spec import HoldingSpec
from cfem.control.open_loop.spec import OpenLoopSpec
from cfem.control.spec import ControlSpec
from cfem.control.task.obstacles.spec import ObstaclesSpec
from cfem.core.errors import SpecError
from cfem.core.spec import json_schema, load_spec

PIPELINES = Path(__file__).parents[2] / "pipelines"
KINDS = {
    "bar/control": OpenLoopSpec,
    "soft-finger/control-patch-load": OpenLoopSpec,
    "stiff-flop/control-closed-loop": ClosedLoopSpec,
    "soft-finger/control-live": ClosedLoopSpec,
    "pincer/control": ObstaclesSpec,
    "soft-gripper/control-place": HoldingSpec,
    "crawler/control": CrawlingSpec,
}
WALL = "obstacles={wall: {kind: plane, point: {mm: [0, 0, 9]}, normal: [0, 0, -1]}}"
OBJECT = "object={centre: {mm: [0, 0, 0]}, half_size: {mm: [1, 1, 1]}}"


def test_all_pipelines_are_valid():
    paths = sorted(PIPELINES.glob("*/control*.yaml"))
    assert len(paths) > 30
    for path in paths:
        load_spec(path, ControlSpec)


@pytest.mark.parametrize("name, kind", KINDS.items())
def test_a_key_tells_the_kind_of_run(name, kind):
    assert type(load_spec(PIPELINES / f"{name}.yaml", ControlSpec)) is kind


def test_a_mark_that_is_empty_makes_no_other_run():
    spec = load_spec(PIPELINES / "bar" / "control.yaml", ControlSpec, ["loop=null", "obstacles={}", "object=null"])
    assert type(spec) is OpenLoopSpec
    assert type(load_spec(PIPELINES / "pincer" / "control.yaml", ControlSpec, ["gait=null"])) is ObstaclesSpec


@pytest.mark.parametrize(
    ("more", "at_nodes"),
    [
        (["contact={friction: 0.3}"], True),
        (["contact={resolution: mesh}"], True),
        (["contact={resolution: patches}"], False),
        (["contact={patches: 4 mm}"], False),
        (["contact={sharp_edges: true}"], False),
        (["contact={}", "obstacles={me: {kind: itself}}"], True),
        (["contact={patches: 4 mm}", "obstacles={me: {kind: itself}}"], False),
    ],
)
def test_obstacles_are_touched_at_the_nodes_of_the_mesh_unless_patches_are_asked_for(more, at_nodes):
    spec = load_spec(PIPELINES / "soft-finger" / "control-press.yaml", ControlSpec, more)
    assert spec.at_nodes == at_nodes


def test_the_schema_says_what_goes_with_what():
    schema = json_schema(ControlSpec)
    kinds = [one["$ref"].rpartition("/")[2] for one in schema["oneOf"]]
    assert {*kinds} == {kind.__name__ for kind in KINDS.values()}
    keys = {name: set(schema["definitions"][name]["properties"]) for name in kinds}
    having = {
        key: {name for name in kinds if key in keys[name]} for key in ("loop", "design", "robots", "trajectories")
    }
    assert having["loop"] == {"ClosedLoopSpec"} and having["design"] == {"OpenLoopSpec", "ClosedLoopSpec"}
    assert having["robots"] == {"HoldingSpec", "CrawlingSpec"} and having["trajectories"] == {*kinds} - {"CrawlingSpec"}
    assert all(schema["definitions"][name]["additionalProperties"] is False for name in kinds)
    assert "gait" in schema["definitions"]["CrawlingSpec"]["required"]


@pytest.mark.parametrize(
    "name, override, words",
    [
        ("bar/control", "updates=3", r"'updates' does not go with goals of a free robot$"),
        ("bar/control", "robots=[{name: left}]", r"'robots' does not go with goals of a free robot$"),
        ("stiff-flop/control-closed-loop", "pictures=3", r"'pictures' does not go with a loop$"),
        ("stiff-flop/control-closed-loop", WALL, r"'loop' does not go with an obstacle"),
        ("stiff-flop/control-closed-loop", OBJECT, r"'loop' does not go with an object"),
        ("pincer/control", "design={E: 1}", r"'design' does not go with an obstacle$"),
        ("pincer/control", "runtime=onnx", r"runtime: expected 'arrays', got 'onnx'$"),
        ("pincer/control", "plant=device", r"plant: expected 'fem' or 'model', got 'device'$"),
        ("pincer/control", "fe_based=true", r"obstacles need fe_based: false$"),
        ("soft-gripper/control-place", "loads={tip: {force: {N: [0, 0, 1]}}}", r"'loads' does not go with an object$"),
        ("soft-gripper/control-place", "plant=model", r"plant: expected 'fem', got 'model'$"),
        ("soft-gripper/control-place", "trajectories.a={kind: image, goals: 3}", r"an object needs goals other than"),
        ("crawler/control", "models.second=here", r"models: a gait takes one model, got 2$"),
        ("crawler/control", "trajectories={a: {kind: image}}", r"'trajectories' does not go with a gait$"),
        ("crawler/control", "gait.mirrored=[nobody]", r"gait.mirrored: \['nobody'\] are not among the robots$"),
        ("bar/control", "reeched=1 mm", r"unknown key 'reeched', did you mean 'reached'\?$"),
    ],
)  # fmt: skip
def test_keys_that_do_not_go_together_get_one_sentence(name, override, words):
    with pytest.raises(SpecError, match=words):
        load_spec(PIPELINES / f"{name}.yaml", ControlSpec, [override])


def test_a_run_without_goals_says_what_is_missing(tmp_path):
    path = tmp_path / "control.yaml"
    path.write_text("scene: s.yaml\nmesh: mesh\nmodels: {a: b}\nout: out\n")
    with pytest.raises(SpecError, match="missing key 'trajectories'"):
        load_spec(path, ControlSpec)


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
        ("plant=model", "an image trajectory needs plant: fem"),
        ("search.itterations=3", "iterations"),
        ("search.weights=[0, 0, 0]", "weights are all 0, so that nothing would be controlled"),
    ],
)
def test_mistakes_are_named(override, words):
    with pytest.raises(SpecError, match=words):
        load_spec(PIPELINES / "bar" / "control.yaml", ControlSpec, [override])


def test_a_device_without_a_loop_is_told_what_it_lacks():
    with pytest.raises(SpecError, match="plant: device needs `loop`"):
        load_spec(PIPELINES / "bar" / "control.yaml", ControlSpec, ["plant=device"])


def test_a_model_for_plant_has_no_fe_based_control():
    goals = "trajectories={a: {kind: goals, points: {mm: [[55, 0, 5]]}}}"
    with pytest.raises(SpecError, match="fe_based: needs plant: fem; set it to false with plant: model"):
        load_spec(PIPELINES / "bar" / "control.yaml", ControlSpec, [goals, "plant=model"])
