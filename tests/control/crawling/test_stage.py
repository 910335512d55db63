"""`cfem control` of a crawler: from the scene of a leg to the judged walk, on bars of 24 cells."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.spatial.transform import Rotation

import cfem
from cfem.control.crawling.course import judged
from cfem.control.crawling.gait import Gait, commands_of
from cfem.control.crawling.spec import CrawlingSpec
from cfem.control.crawling.stage import _records, setting_of
from cfem.core.artefact.judgement import KEY
from cfem.core.errors import CfemError
from cfem.core.spec import load_spec
from cfem.equilibrium.quasi_static import CONVERGED

SCENE = """
name: leg
out: mesh
length: 30 mm
geometry: {kind: bar, length: 30 mm, width: 10 mm, height: 10 mm}
mesh: {size: 5 mm, element: hex8}
material: {young: 1 MPa, poisson: 0.4, density: 1070 kg/m^3}
fixed:
  - {kind: plane, point: {mm: [0, 0, 0]}, normal: [-1, 0, 0]}
actuators:
  - {kind: cable, name: left, pull_point: {mm: [0, 3, -4]},
     points: {mm: [[10, 3, -4], [28, 3, -4]]}, reach: {mm: [0, 2]}}
  - {kind: cable, name: right, pull_point: {mm: [0, -3, -4]},
     points: {mm: [[10, -3, -4], [28, -3, -4]]}, reach: {mm: [0, 2]}}
effectors:
  - {name: foot, point: {mm: [28, 0, -5]}, radius: 3 mm}
  - {name: body, at: centre-of-mass}
"""
SAMPLE = """
scene: scene.yaml
mesh: mesh
out: samples
loads: true
splits:
  train: {rows: 12, method: scrambled-halton, seed: 1}
  test: {rows: 3, method: random, seed: 2}
"""
TRAIN = "dataset: samples\nout: model\nmodel: {kind: spectral}\n"
CONTROL = """
scene: scene.yaml
mesh: mesh
models: {spectral: model}
out: control
robots:
  - {name: one}
  - {name: two, rotate: {axis: [0, 0, 1], angle: 180 deg}, translate: {mm: [-10, 0, 0]}}
gait:
  base: {centre: {mm: [-5, 0, -0.2]}, half_size: {mm: [5, 8, 5]}, weight: 0.2 N, pads: 0.2}
  ground: {point: {mm: [0, 0, -5.2]}, normal: [0, 0, 1], friction: 0.6}
  direction: [0, 1, 0]
  mirrored: [two]
  pulls: {mm: [0, 0.5]}
  gravity: 9.81 m/s^2
  steps: 4
  cycles: 2
  evaluations: 1
  frictions: [0.5]
  planned_frictions: [0.6]
"""
CENTRE = np.array([-5.0, 0.0, -0.2])
BACK = np.diag([-1.0, -1.0, 1.0])  # turn of the second leg


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crawling")
    for name, text in {"scene": SCENE, "sample": SAMPLE, "train": TRAIN, "control": CONTROL}.items():
        (folder / f"{name}.yaml").write_text(text)
    cfem.run_stage("mesh", folder / "scene.yaml")
    cfem.run_stage("sample", folder / "sample.yaml", workers=1)
    cfem.run_stage("train", folder / "train.yaml")
    return folder


@pytest.fixture(scope="module")
def walked(folder):
    """Results of a walk of 8 commands in steps of half of their range, and its folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cfem.control.crawling.crawler.STEP", 1 / 2)
        return cfem.run_stage("control", folder / "control.yaml")["results"], folder / "control"


def test_the_walk_of_the_model_is_that_of_finite_elements(walked):
    found, _ = walked
    planned, halved, fe = (found["per_cycle"][name] for name in ("planned", "half_steps", "fe"))
    assert planned > 0.5 and fe == pytest.approx(planned, rel=0.01)
    assert halved == pytest.approx(planned, rel=2e-3) and halved != planned
    assert found["distance"]["fe"] == pytest.approx(found["distance"]["planned"], rel=0.01)
    assert KEY not in found
    contact = found["contact"]
    assert contact["commands"] == 8 and contact["law_residual"] <= 1e-8 and contact["status"] == CONVERGED
    assert sum(contact["points"].values()) == 8 * (2 + 4)  # the feet, and the base's corners
    (sweep,), (alone,) = found["frictions"], found["planned_frictions"]
    assert sweep["friction"] == 0.5 and sweep["fe"] == pytest.approx(sweep["planned"], rel=0.02)
    assert sweep["planned"] != pytest.approx(planned, rel=1e-3)
    assert alone["planned"] == pytest.approx(planned, rel=1e-9)  # the friction of the walk
    assert (found["plant"], found["length"]) == ("fem", 30.0)


def test_a_walk_that_long_steps_make_is_poor_and_short_ones_show_that_there_is_none(folder):
    """Feet that slip in one step to each command row along; with steps of a tenth of it they slip back."""
    asked = ["gait.pulls={mm: [0, 0.2]}", "gait.steps=3", "gait.base.pads=5", "gait.ground.friction=0.3"]
    spec = load_spec(folder / "control.yaml", CrawlingSpec, asked)
    setting = setting_of(spec, folder, folder / "mesh", {"spectral": folder / "model"})
    course, gait = setting.on, Gait(np.array([0.03, 0.56]), np.array([0.98, 0.74]), np.array([0.0, 0.37]))

    def distances(longest):
        learned = replace(setting.learned, longest=longest)
        planned = course.plan(learned, gait)
        far = {
            "planned": course.distance(planned),
            "half_steps": course.distance(course.in_half_steps(learned, planned)),
        }
        return far | {"fe": far["planned"]}

    long = distances(0.2)
    assert long["planned"] > 0.1 and "the plan depends on its steps" in judged(long, course.unit)[0]["what"]
    assert abs(course.distance(course.plan(setting.learned, gait))) < 0.01
    assert setting.learned.longest == pytest.approx(0.2 / 16)


def test_the_table_of_a_walk_has_a_row_for_each_command(walked):
    found, out = walked
    table = pq.read_table(out / "trajectories.parquet")
    rows = table.to_pylist()
    gait = Gait(**{name: np.array(numbers) for name, numbers in found["gait"].items()})
    np.testing.assert_array_equal([row["delta_a"] for row in rows], commands_of(gait, [False, True], (0, 0.5), 4, 2))
    goal, x = (np.array(table[name].to_pylist()) for name in ("goal", "x_e"))
    np.testing.assert_allclose(table["error"], np.linalg.norm(x - goal, axis=1), rtol=1e-12)
    np.testing.assert_allclose([row["predicted_e"] for row in rows], goal - CENTRE, atol=1e-12)
    assert (goal[-1] - CENTRE)[1] == pytest.approx(found["distance"]["planned"])
    assert (x[-1] - CENTRE)[1] == pytest.approx(found["distance"]["fe"])
    assert table["goal_index"].to_pylist() == list(range(8)) and all(table["reached"].to_pylist())
    np.testing.assert_allclose(table["step_us"], 1e6 * np.array(table["seconds"]))
    meta = json.loads(table.schema.metadata[b"cfem"])
    legs = [f"{leg}.{name}" for leg in ("one", "two") for name in ("left", "right")]
    assert meta["rows"] == ["base.x", "base.y", "base.z", *legs] and meta["rest_e"] == CENTRE.tolist()
    assert meta["units"]["delta_a"] == ["mm"] * 4 and meta["units"]["lambda_a"] == ["N"] * 4
    assert meta["units"]["seconds"] == "s" and meta["units"]["step_us"] == "us" and meta["units"]["x_e"] == "mm"


def test_the_pictures_of_a_walk_have_the_legs_at_their_base(walked):
    """What is fixed to the base goes with it as a rigid body, and its pads stand on the ground."""
    _, out = walked
    shown = np.load(out / "states.npz")
    X, x, n = shown["X"], shown["gait/x"], int(shown["object_points"])
    assert n == 8 and len(x) == 8 and shown["gait/index"].tolist() == list(range(8))
    leg = (len(X) - n) // 2
    np.testing.assert_allclose(X[leg : 2 * leg], X[:leg] @ BACK.T + [-10.0, 0.0, 0.0], atol=1e-12)
    assert X[:leg, 0].min() == pytest.approx(0.0, abs=1e-12) and X[:leg, 0].max() == pytest.approx(30.0)
    np.testing.assert_allclose(np.sort(X[-n:], axis=0)[[0, -1]], CENTRE + [[-5, -8, -5], [5, 8, 5]], atol=1e-12)
    rows = pq.read_table(out / "trajectories.parquet").to_pylist()
    np.testing.assert_allclose(x[:, -n:].mean(axis=1), [row["x_e"] for row in rows], atol=1e-5)
    fixed = np.concatenate([X[:leg, 0] < 1e-9, X[leg : 2 * leg, 0] > -10 - 1e-9, np.ones(n, bool)])
    for now in x:
        turn, _ = Rotation.align_vectors(now[fixed] - now[fixed].mean(axis=0), X[fixed] - X[fixed].mean(axis=0))
        rigid = turn.apply(X - X[fixed].mean(axis=0)) + now[fixed].mean(axis=0)
        np.testing.assert_allclose(now[fixed], rigid[fixed], atol=1e-4)
        moved = np.linalg.norm(now - rigid, axis=1)[: 2 * leg]
        assert moved.max() < 1.5 and moved.reshape(2, leg).max(axis=1).min() > 0.01  # both legs bend
    part = np.repeat([0, 1, 2], [leg, leg, n])[shown["facets"]]
    np.testing.assert_array_equal(part, part[:, :1].repeat(part.shape[1], axis=1))  # no facet joins two bodies
    np.testing.assert_array_equal(np.unique(shown["facets"]), np.arange(len(X)))
    cells = X[shown["facets"][part[:, 0] < 2]]
    assert np.ptp(cells, axis=1).max() < 5.1  # a side of a cell


@pytest.mark.slow
def test_a_longer_walk_of_the_model_is_that_of_finite_elements(folder):
    gait = {"pulls": {"mm": [0, 0.5]}, "steps": 4, "evaluations": 12, "base.pads": 0.01, "frictions": []}
    asked = [f"gait.{key}={json.dumps(value)}" for key, value in gait.items()]
    found = cfem.run_stage("control", folder / "control.yaml", out=folder / "longer", overrides=asked)["results"]
    planned, fe = (found["per_cycle"][name] for name in ("planned", "fe"))
    assert planned > 0 and fe == pytest.approx(planned, rel=0.05)
    assert found["contact"]["commands"] == 8 and found["contact"]["law_residual"] <= 1e-8


def test_a_model_without_displacements_is_refused(folder):
    (folder / "force.yaml").write_text(
        TRAIN.replace("out: model", "out: force").replace("{kind: spectral}", "{kind: spectral, form: force}")
    )
    cfem.run_stage("train", folder / "force.yaml")
    with pytest.raises(CfemError, match="form displacement"):
        cfem.run_stage("control", folder / "control.yaml", overrides=["models.spectral=force"])


def test_commands_that_the_fe_crawler_did_not_come_to_have_no_place():
    leg = SimpleNamespace(delta_a=np.ones(2), lambda_a=np.ones(2))
    touch = SimpleNamespace(solved=[leg, None], iterations=3, check=SimpleNamespace(largest=1e-9))
    base, commands = np.arange(9.0).reshape(3, 3), [np.ones(2)] * 2
    planned = SimpleNamespace(commands=commands, base=base, touches=[touch] * 2, seconds=[0.1] * 2, status=CONVERGED)
    fe = SimpleNamespace(commands=commands[:1], base=base[:2] + 0.3, status="no balance found")
    model = SimpleNamespace(at_displacement=lambda u: u, inside=lambda state: True, distance=lambda state: 0.5)
    first, second = _records("spectral", planned, fe, 1.0, model)
    assert first["error"] == pytest.approx(np.sqrt(3) * 0.3) and first["reached"]
    assert first["plant_status"] == CONVERGED
    assert np.isnan(second["x_e"]).all() and not second["reached"]
    assert second["plant_status"] == "no balance found"
