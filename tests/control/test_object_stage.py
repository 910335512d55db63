"""`cfem control` of two robots that hold an object: from the scene to the judged trajectory, on bars of 48 cells."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from support.cut_short import cut_short, demand_equal

import cfem
from cfem.core.errors import CfemError, InputError

# The cable ends half way: along the whole length it would only load the clamped ends, and the object would not move.
SCENE = """
name: holder
out: mesh
length: 60 mm
geometry: {kind: bar, length: 60 mm, width: 10 mm, height: 10 mm}
mesh: {size: 5 mm, element: hex8}
material: {young: 1 MPa, poisson: 0.45}
fixed:
  - {kind: plane, point: {mm: [0, 0, 0]}, normal: [-1, 0, 0]}
actuators:
  - kind: cable
    name: cable
    pull_point: {mm: [0, 0, 4]}
    points: {mm: [[15, 0, 4], [30, 0, 4]]}
    reach: {mm: [0, 3]}
contacts:
  - {name: p1, point: {mm: [60, 3, 3]}}
  - {name: p2, point: {mm: [60, -3, 3]}}
  - {name: p3, point: {mm: [60, 0, -3]}}
effectors:
  - name: tip
    point: {mm: [59, 0, 0]}
"""
SAMPLE = """
scene: scene.yaml
mesh: mesh
out: samples
contact:
  translation: {mm: [[-0.5, 0.5], [-0.3, 0.3], [-0.3, 1.5]]}
  force: 1 N
splits:
  train: {rows: 40, method: scrambled-halton, seed: 1}
  test: {rows: 8, method: random, seed: 2}
"""
TRAIN = "dataset: samples\nout: model\nmodel: {kind: spectral}\n"
CONTROL = """
scene: scene.yaml
mesh: mesh
models: {spectral: model}
out: control
object:
  centre: {mm: [65, 0, 0]}
  half_size: {mm: [5, 5, 5]}
  turns: false
robots:
  - {name: left}
  - {name: right, rotate: {axis: [0, 0, 1], angle: 180 deg}, translate: {mm: [130, 0, 0]}}
trajectories:
  up: {kind: goals, points: {mm: [[65, 0, 0.3], [65, 0, 0.6]]}}
search: {weights: [0, 0, 1], regularisation: 1e-8}
reached: 0.02 mm
fewer_iterations: [1]
fe_based: true
"""


@pytest.fixture(scope="module")
def held(tmp_path_factory):
    """A folder with the mesh, the samples and the model of one bar whose end is held."""
    folder = tmp_path_factory.mktemp("held")
    for name, text in {"scene": SCENE, "sample": SAMPLE, "train": TRAIN, "control": CONTROL}.items():
        (folder / f"{name}.yaml").write_text(text)
    cfem.run_stage("mesh", folder / "scene.yaml")
    cfem.run_stage("sample", folder / "sample.yaml", workers=1)
    cfem.run_stage("train", folder / "train.yaml")
    return folder


def test_two_bars_raise_what_they_hold(held):
    results = cfem.run_stage("control", held / "control.yaml")["results"]
    up = results["trajectories"]["up"]
    assert set(up) == {"spectral", "spectral@1", "fe-based"}
    for name in ("spectral", "fe-based"):
        assert (up[name]["reached"], up[name]["plant_converged"], up[name]["inside"]) == (2, 2, 2), name
        assert up[name]["distance_to_reachable_goals"]["max"] < 1e-3
    assert results["object"]["imbalance"] < 1e-8 and results["object"]["softest"] > 0
    assert any(line.startswith("object: forces and moments balance") for line in results["headline"])
    table = pq.read_table(held / "control" / "trajectories.parquet")
    meta = json.loads(table.schema.metadata[b"cfem"])
    assert meta["rows"][:5] == ["object.x", "object.y", "object.z", "left.cable", "right.cable"]
    assert meta["units"]["delta_a"] == ["mm", "mm"] and meta["units"]["lambda_a"] == ["N", "N"]
    # by symmetry both pull alike, and the object goes straight up
    for row in table.to_pylist():
        if row["controller"] == "spectral":
            assert row["lambda_a"][0] == pytest.approx(row["lambda_a"][1], rel=1e-3) and row["lambda_a"][0] > 0
            np.testing.assert_allclose(row["x_e"], [65, 0, [0.3, 0.6][row["goal_index"]]], atol=2e-3)
    with np.load(held / "control" / "states.npz") as states:
        assert states["object_points"] == 8
        corners = states["up/x"][:, -8:] - states["X"][-8:]
    np.testing.assert_allclose(corners[:, :, 2], [[0.3] * 8, [0.6] * 8], atol=2e-3)
    assert cfem.run_stage("control", held / "control.yaml")["status"] == "up to date"


TOUCHED = [
    "models={spectral: turning-model}",
    "object={centre: {mm: [65, 0, 0]}, half_size: {mm: [5, 5, 5]}, turns: false, force: {mN: [-100, 0, 0]}, "
    "law: coulomb, friction: 0.8, margin: 1.2}",
    "robots=[{name: robot}]",
    "trajectories={up: {kind: goals, points: {mm: [[65, 0, 0.05], [65, 0, 0.1]]}}}",
    "fe_based=false",
    "fewer_iterations=[]",
]


@pytest.fixture(scope="module")
def turning(held):
    """The folder with a model of a bar whose end turns too."""
    turns = [
        "contact.rotation={deg: [[-0.5, 0.5], [-2, 2], [-0.5, 0.5]]}",
        "contact.force=0.3 N",
        "splits.train.rows=24",
        "splits.test.rows=2",
    ]
    cfem.run_stage("sample", held / "sample.yaml", overrides=turns, out=held / "turning", workers=1)
    cfem.run_stage("train", held / "train.yaml", overrides=["dataset=turning"], out=held / "turning-model")
    return held


def test_one_bar_moves_by_friction_what_is_pressed_against_it(turning):
    results = cfem.run_stage("control", turning / "control.yaml", overrides=TOUCHED, out=turning / "touched")["results"]
    account = results["object"]
    assert (account["commands"], account["failures"]) == (2, 0)
    assert account["law_residual"] < 1e-8
    # plans know which points open, stick and slip, and keep the margin; finite elements agree
    assert results["trajectories"]["up"]["spectral"]["distance_to_reachable_goals"]["max"] < 0.002
    assert account["margin_planned"] >= 1.2 - 1e-3 and account["margin"] == pytest.approx(
        account["margin_planned"], rel=0.05
    )
    assert account["holds"] > 1
    meta = json.loads(pq.read_table(turning / "touched" / "trajectories.parquet").schema.metadata[b"cfem"])
    assert meta["rows"] == ["object.x", "object.y", "object.z", "robot.grip", "cable"] and len(meta["rest_e"]) == 4
    assert any(line.startswith("grip: the margin to slip is") for line in results["headline"])
    assert any(line.startswith("contact: 2 of 2 commands carried out") for line in results["headline"])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("object.centre={mm: [66, 0, 0]}", r"contact point 'p\d' of robot 'robot' does not reach the object: 1 mm"),
        ("object.centre={mm: [64, 0, 0]}", r"contact point 'p\d' of robot 'robot' is 1 mm inside the object"),
        ("object.friction=-0.1", r"object.friction: must be at least 0, got -0.1"),
        (
            "object.force={mN: [-100, 0, -100]}",
            r"the grip cannot hold the object: (no combination|open, sticking)",
        ),
        (
            "models={spectral: model}",
            r"points that open one by one turn their patch.*add contact.rotation to sample.yaml",
        ),
        (
            "object={centre: {mm: [65, 0, 0]}, half_size: {mm: [5, 5, 5]}, table: true}",
            r"table: robots lift an object from it by friction: give law: coulomb and force",
        ),
        (
            "trajectories={up: {kind: goals, points: {mm: [[65, 0, 0.05]]}, let_go: true}}",
            r"trajectories.up.let_go: robots let an object go on its table: give object.table",
        ),
        ("fe_based=true", r"object.law: coulomb takes one model, fe_based: false"),
    ],
)
def test_what_cannot_be_gripped_is_refused_before_anything_moves(turning, change, said):
    with pytest.raises(CfemError, match=said):
        cfem.run_stage("control", turning / "control.yaml", overrides=[*TOUCHED, change], out=turning / "refused")


def test_an_object_that_turns_needs_samples_that_turn(held):
    with pytest.raises(InputError, match=r"patch that cannot turn, but the object can turn.*set object.turns: false"):
        cfem.run_stage("control", held / "control.yaml", overrides=["object.turns=true"], out=held / "turned")


@pytest.mark.parametrize(
    "asked", [pytest.param([], marks=pytest.mark.slow, id="glued"), pytest.param(TOUCHED, id="by friction")]
)
def test_an_interrupted_run_goes_on_with_the_object_as_it_was_held(turning, tmp_path, asked):
    for out in ("whole", "cut"):
        if out == "cut":
            cut_short(turning / "control.yaml", 1, overrides=asked, out=tmp_path / out)
        cfem.run_stage("control", turning / "control.yaml", overrides=asked, out=tmp_path / out)
    demand_equal(tmp_path / "whole", tmp_path / "cut")
