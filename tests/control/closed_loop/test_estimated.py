"""Controllers that see markers alone, in the finite-element bar: what is estimated, and what control makes of it."""

import numpy as np
import pyarrow.parquet as pq
import pytest

import cfem
from cfem.plant.marker_noise import MarkerNoise
from cfem.plant.protocol import Measurement
from cfem.predict.estimation.markers import markers_near
from cfem.predict.load import load_model

SPEC = """
scene: {scene}
mesh: {mesh}
models: {{spectral: {model}}}
out: out
mesh_error: null
trajectories:
  points: {{kind: goals, points: {{mm: {goals}}}}}
search: {{weights: [0, 0, 1]}}
loop:
  rate: 20 Hz
  command: {{kind: {kind}}}
  controllers:
    closed: {{mode: closed}}
    {more}
  settle: {{radius: 0.3 mm, hold: 0.5 s, at_most: 1.25 s}}
  sensor: {{delay: 1}}
  real: {{scene: ["{real}"]}}
  disturbance: {{tick: 10, force: {{mN: [0, 8, 0]}}}}
  estimate:
    markers: {markers}
    noise: 0.05 mm
    lost: 0.1
    wrong: 0.1
    loads: {{rows: [tip.y, tip.z], largest: 10 mN, lasts: 0.5 s}}
    {sensors}
"""


def written(folder, bar, model_folder, kind, real, more="", sensors=""):
    model = load_model(model_folder)
    goals = [(model.rest_e + model.at_displacement([d]).delta_e).tolist() for d in (2.0, 3.0)]
    places = markers_near(model, 6)
    markers = "{" + ", ".join(f"m{n}: {{mm: {place.tolist()}}}" for n, place in enumerate(places)) + "}"
    names = {"scene": bar / "pipelines" / "bar" / "scene.yaml", "mesh": bar / "data" / "bar" / "mesh"}
    text = SPEC.format(
        **names, model=model_folder, goals=goals, kind=kind, real=real, more=more, markers=markers, sensors=sensors
    )
    (folder / "control.yaml").write_text(text)
    return folder / "control.yaml"


@pytest.fixture(scope="module")
def told(bar, tmp_path_factory):
    """Displacements are commanded, a load cell and a sensor measure."""
    folder = tmp_path_factory.mktemp("told")
    sensors = "actuators: {displacement: 0.05 mm, force: 10 mN}"
    path = written(folder, bar, bar / "models" / "bar" / "spectral", "displacement", "mesh.size=5 mm", sensors=sensors)
    return folder, cfem.run_stage("control", path)["results"]


def test_the_shape_and_the_push_are_known_to_a_controller_that_sees_markers(told):
    folder, results = told
    found = results["loop"]["points"]["closed"]
    estimate = found["estimate"]
    assert found["reached"]["min"] == 2 and estimate["estimated"] >= estimate["samples"] - 2
    assert estimate["shape"]["median"] < 0.06 and estimate["left_out"] > 3
    assert estimate["covered"] > 0.85 and set(estimate["unknowns"]) == {"cable", "tip.y", "tip.z"}
    assert "95 % intervals hold" in results["headline"][0] and "mm rms" in results["headline"][0]
    table = pq.read_table(folder / "out" / "loop.parquet").to_pylist()
    last = table[-1]
    assert last["true_loads"] == [0.008, 0.0] and abs(last["loads"][0] - 0.008) < 4 * last["loads_sd"][0] < 0.02
    assert [one["estimate_of"] for one in table[:4]] == [0, 0, 1, 2]  # a tick late
    apart = np.array([np.subtract(one["estimated_e"], table[one["estimate_of"] - 1]["x_e"]) for one in table[2:]])
    assert np.sqrt(np.mean(apart**2)) < 0.1


def test_the_report_shows_forces_with_their_intervals(told, bar):
    folder, _ = told
    (folder / "report.yaml").write_text("loops: {markers: out}\nout: report\n")
    cfem.run_stage("report", folder / "report.yaml")
    page = (folder / "report" / "report.html").read_text()
    assert "95 % intervals that hold" in page and "tip.y (mN)" in page and "error of the shape (mm rms)" in page


@pytest.mark.slow
def test_a_push_is_not_taken_for_another_material(bar, bar_of_any_material, tmp_path):
    """Forces are commanded to a bar a fifth softer: adaptation finds its Young's modulus from the same markers."""
    adapt = "adaptive: {mode: closed, adapt: {noise: 0.05 mm, find: [young]}}"
    path = written(tmp_path, bar, bar_of_any_material, "force", "material.young=0.8 MPa", more=adapt)
    found = cfem.run_stage("control", path)["results"]["loop"]["points"]["adaptive"]
    assert found["parameters"]["young"] == pytest.approx(0.8, rel=0.05)
    assert found["reached"]["min"] == 2 and found["estimate"]["covered"] > 0.85


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("plant=device", "a device loses markers as it does"),
        ("loop.sensor.noise=0.1 mm", "leave out sensor.noise"),
        ("loop.moving={substeps: 4}", "leave actuators.force out"),
        ("loop.real.wall={point: {mm: [0, 0, 0]}, normal: [0, 0, 1]}", "leave out real.wall"),
        ("loop.estimate.loads.rows=[top.x]", "no row 'top.x'"),
    ],
)
def test_a_wrong_spec_gets_one_sentence(told, override, said):
    folder, _ = told
    more = ["loop.device={kind: program, command: [x]}", "loop.real.scene=[]"] if "device" in override else []
    with pytest.raises(cfem.CfemError, match=said):
        cfem.run_stage("control", folder / "control.yaml", overrides=[override, *more], out=folder / "wrong")


def test_a_camera_loses_and_mistakes_as_many_markers_as_stated():
    camera = MarkerNoise(0.1, lost=0.2, wrong=0.1, astray=50.0, sensors=(0.05, None))
    true = Measurement(np.zeros(3), np.array([2.0]), np.array([3.0]), 1, "converged", np.zeros((4000, 3)), np.ones(3))
    seen = camera.seen(true)
    known = np.isfinite(seen.markers).all(axis=1)
    assert seen.lambda_a is None and seen.surface is None and 0 < abs(seen.delta_a[0] - 2.0) < 0.3
    assert known.mean() == pytest.approx(0.8, abs=0.02)
    far = np.abs(seen.markers[known]).max(axis=1) > 1.0
    assert far.mean() == pytest.approx(0.1, abs=0.02)
    assert seen.markers[known][~far].std() == pytest.approx(0.1, rel=0.03)
