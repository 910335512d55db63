"""`cfem calibrate` from a spec to its artefact: a model learned from FE, and FE, both given FE at a known truth."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from robot.scenes import scene

from cfem.core.errors import SpecError
from cfem.core.stage import Options
from cfem.identify.robot.stage import run
from cfem.robot.stage import run as make_mesh
from cfem.sample.stage import run as simulate_sample
from cfem.surrogate.stage import run as train

QUIET = Options(quiet=True)
PARAMETERS = """
parameters:
  E: {key: material.young, range: {kPa: [500, 4000]}}
  nu: {key: material.poisson, range: [0.30, 0.48]}
"""
SAMPLE = """
scene: scene.yaml
mesh: mesh
out: samples
splits:
  train: {rows: 40, method: scrambled-halton, seed: 1}
  test: {rows: 10, method: random, seed: 2}
"""
TRUTH = """
scene: truth.yaml
mesh: mesh
out: measured
space: displacement
splits:
  train: {rows: 3, method: grid}
"""
CALIBRATE = """
measurements: measured
out: out
model: model
find: [nu]
use: [effectors]
starts: [{nu: 0.31}, {nu: 0.45}]
truth: {nu: 0.42, E: 2.5 MPa}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A scene, its mesh, a model of it over E and nu, and FE at nu = 0.42, E = 2.5 MPa in three states."""
    folder = tmp_path_factory.mktemp("calibrate")
    scene(folder)
    text = (folder / "scene.yaml").read_text().replace("young: 1 MPa, poisson: 0.3", "young: 2.5 MPa, poisson: 0.42")
    (folder / "truth.yaml").write_text(text)
    (folder / "sample.yaml").write_text(SAMPLE + PARAMETERS)
    (folder / "sample-truth.yaml").write_text(TRUTH)
    (folder / "train.yaml").write_text("dataset: samples\nout: model\nmodel: {kind: spectral, max_degree: 5}\n")
    make_mesh(folder / "scene.yaml", [], None, QUIET)
    simulate_sample(folder / "sample.yaml", [], None, QUIET, workers=1)
    simulate_sample(folder / "sample-truth.yaml", [], None, QUIET, workers=1)
    train(folder / "train.yaml", [], None, QUIET)
    (folder / "calibrate.yaml").write_text(CALIBRATE)
    return folder


def calibrate(folder, *overrides, out=None):
    return run(folder / "calibrate.yaml", overrides, out, QUIET)


def test_poisson_from_the_model(folder, tmp_path):
    manifest = calibrate(folder, out=tmp_path / "out")
    results = manifest["results"]
    json.dumps(json.loads((tmp_path / "out" / "calibration.json").read_text()), allow_nan=False)
    assert abs(results["estimates"]["nu"]["error"]) < 1e-3 and results["outside"] == []
    assert all(one["best"] for one in results["starts"])
    assert (tmp_path / "out" / "calibration.png").read_bytes()[:4] == b"\x89PNG"
    table = pq.read_table(tmp_path / "out" / "predicted.parquet")
    assert table.num_rows == 3 and json.loads(table.schema.metadata[b"cfem"])["units"]["x_e"] == "mm"
    near = np.array(table["delta_e"].to_pylist()) - np.array(table["measured_delta_e"].to_pylist())
    assert np.abs(near).max() < 1e-3
    assert calibrate(folder, out=tmp_path / "out")["status"] == "up to date"


def test_residuals_far_above_the_stated_noise_are_judged(folder, tmp_path):
    few = ("figure=false", "starts=1", "profile=false")
    fits = calibrate(folder, *few, "noise={effectors: 0.1 mm}", out=tmp_path / "fits")["results"]
    assert "judgement" not in fits
    (judged,) = calibrate(folder, *few, "noise={effectors: 1e-9 mm}", out=tmp_path / "poor")["results"]["judgement"]
    assert "times the stated noise" in judged["what"]


def rows_of(folder):
    """Displacement, tip and force of the measured states."""
    table = pq.read_table(folder / "measured" / "train.parquet")
    rest = json.loads(table.schema.metadata[b"cfem"])["rest_e"]
    return np.hstack([np.array(table[name].to_pylist()) for name in ("delta_a", "delta_e", "lambda_a")]) + [0, *rest, 0]


TITLES = "c.displacement [mm],tip.x [mm],tip.y [mm],tip.z [mm],c.force [N]"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda rows: rows + [0, 0, 0, 30, 0], "mm of the effectors"),
        (lambda rows: rows * [1, 0.1, 0.1, 0.1, 1], "mm of the effectors"),
        (lambda rows: rows * [1, 1, 1, 1, 1e3], "N of the forces"),
        (lambda rows: rows * [1.5, 1, 1, 1, 1], "outside what the model was trained on: 3"),
        (lambda rows: rows, None),
        (lambda rows: rows[2:], None),
    ],
)
def test_measurements_of_another_frame_or_unit_are_judged(folder, tmp_path, change, words):
    rows = change(rows_of(folder))
    lines = [TITLES, *(",".join(f"{number:.9g}" for number in row) for row in rows)]
    (tmp_path / "measured.csv").write_text("\n".join(lines) + "\n")
    overrides = [f"measurements={tmp_path}/measured.csv", "use=[effectors, actuators]", "find=[nu, E]", "starts=2"]
    results = calibrate(folder, *overrides, "profile=false", "figure=false", out=tmp_path / "out")["results"]
    assert any("root mean square" in line for line in results["headline"])
    judged = [finding["what"] for finding in results.get("judgement", [])]
    assert any(words in what for what in judged) if words else judged == [], judged


def test_the_modulus_needs_the_forces(folder, tmp_path):
    blind = calibrate(folder, "find=[nu, E]", "starts=3", "figure=false", out=tmp_path / "blind")["results"]
    (judged,) = blind["judgement"]
    assert blind["unseen"] == ["E"] and judged["what"].endswith("measure a force")
    overrides = ("find=[nu, E]", "starts=3", "use=[effectors, actuators]", "figure=false")
    both = calibrate(folder, *overrides, out=tmp_path / "both")["results"]
    assert abs(both["estimates"]["nu"]["error"]) < 1e-3 and abs(both["estimates"]["E"]["error"]) < 5e-3


def test_finite_elements_find_it_to_the_solvers_tolerance(folder, tmp_path):
    overrides = ("fe=true", "scene=scene.yaml", "mesh=mesh", "use=[effectors, actuators]", "find=[nu, E]")
    overrides += ("starts=[{nu: 0.35, E: 1 MPa}]", "figure=false")
    results = calibrate(folder, *overrides, out=tmp_path / "fe")["results"]
    assert abs(results["estimates"]["nu"]["error"]) < 1e-6 and abs(results["estimates"]["E"]["error"]) < 1e-6
    assert results["estimates"]["nu"]["profile"] is None and results["solves"] == results["evaluations"] + 3


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["find=[mu]"], "find: unknown parameter 'mu'.*known are E, nu"),
        (["fixed={E: 3}"], "fixed.E: .*the bare number 3"),
        (["fixed={E: 30 MPa}"], "fixed.E: 30 is out of the range"),
        (["starts=[{E: 2 MPa}]"], r"starts: parameters \['E'\] are not among those to find"),
        (["fixed={nu: 0.4}"], r"fixed: parameters \['nu'\] are both"),
        (["fe=true"], "needs scene and mesh"),
        (["noise={effectors: 0.1 mm}", "use=[effectors, actuators]"], "noise.forces: the noise of"),
        (["starts=[]"], "needs at least one"),
        (["rows=[0, 1, 0]"], "rows: 0 stands there twice"),
        (["find=[nu, nu]"], "find: nu stands there twice"),
    ],
)
def test_a_wrong_spec_says_where(folder, tmp_path, overrides, message):
    with pytest.raises(SpecError, match=message):
        calibrate(folder, *overrides, out=tmp_path / "out")
