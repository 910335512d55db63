"""`cfem animate`: the bar's run as shapes, with and without finite elements."""

import json
import xml.etree.ElementTree as ET

import meshio
import numpy as np
import pytest
import yaml
from PIL import Image
from scipy.spatial import cKDTree
from typer.testing import CliRunner

import cfem
from cfem.cli.app import app
from cfem.core.artefact.manifest import read_manifest
from cfem.core.spec import load_spec
from cfem.predict.load import load_model
from cfem.report import animate
from cfem.report.run_viewer import animation
from cfem.report.sections.tracking import read_tracking
from cfem.report.shape_history import FE, LEARNED, histories
from cfem.robot.spec import SceneSpec

LOADS = {"tip": {"force": {"N": [0.0, 0.02, -0.01]}}}
PUSH = {"push": {"at": {"mm": [48, 0, 5]}, "radius": "6 mm", "force": {"N": [0.0, 0.03, -0.01]}}}
LOOP = {
    "rate": "10 Hz",
    "command": {"kind": "displacement"},
    "controllers": {"open": {"mode": "open"}},
    "settle": {"radius": "1 mm", "hold": "0.2 s", "at_most": "1 s"},
    "goal_every": "0.3 s",
}
POINTS = {"kind": "goals", "points": {"mm": [[58.9, 0, 2], [58.7, 0, 4], [58.4, 0, 6]]}}


def controlled(bar, name, **changes):
    spec = yaml.safe_load((bar / "pipelines" / "bar" / "control.yaml").read_text())
    spec |= {"models": {"spectral": "../../models/bar/spectral"}, "fe_based": False, "mesh_error": None}
    spec |= {"out": f"../../data/bar/{name}"} | changes
    path = bar / "pipelines" / "bar" / f"control-{name}.yaml"
    path.write_text(json.dumps(spec))
    cfem.run_stage("control", path)
    return bar / "data" / "bar" / name


@pytest.fixture(scope="module")
def run(bar):
    return controlled(bar, "drawn", pictures=4)


def drawn(folder, *words):
    return CliRunner().invoke(app, ["animate", str(folder), "--json", *map(str, words)])


def series(pvd):
    return [(float(one.get("timestep")), pvd.parent / one.get("file")) for one in ET.parse(pvd).iter("DataSet")]


def test_a_run_is_drawn_as_an_animation_and_two_series(run):
    done = drawn(run)
    assert done.exit_code == 0, done.output
    made = json.loads(done.stdout)["results"]["files"]["swing"]
    assert sorted(made) == ["swing-fe.pvd", "swing-learned.pvd", "swing.gif"]
    out = run.with_name("drawn-animation")
    assert [time for time, _ in series(out / "swing-fe.pvd")] == [0, 2, 3, 5]  # 4 of 6 goals were kept
    assert [time for time, _ in series(out / "swing-learned.pvd")] == [0, 1, 2, 3, 4, 5]
    with Image.open(out / "swing.gif") as picture:
        assert picture.n_frames == 4
    shown = meshio.read(series(out / "swing-learned.pvd")[3][1])
    assert np.abs(shown.point_data["displacement"]).max() > 1
    assert {"lambda_a cable [N]", "delta_a cable [mm]", "error [mm]"} <= set(shown.field_data) or len(
        shown.field_data
    ) > 4
    assert json.loads(drawn(run).stdout)["status"] == "up to date"
    assert CliRunner().invoke(app, ["verify", str(out)]).exit_code == 0


@pytest.mark.parametrize("loads", [{}, LOADS, PUSH], ids=["free", "loaded", "pushed"])
def test_the_learned_skin_stands_where_finite_elements_do(bar, run, loads):
    folder = controlled(bar, "carrying", pictures=6, loads=loads) if loads else run
    found = {one.kind: one for one in histories(folder, read_manifest(folder), 60)}
    fe, learned = found[FE], found[LEARNED]
    apart, node = cKDTree(fe.rest).query(learned.rest)
    assert apart.max() < 1e-4  # states are kept in single precision
    at = np.searchsorted(learned.index, fe.index)
    away = np.linalg.norm(learned.x[at] - fe.x[:, node], axis=-1)
    moved = np.linalg.norm(fe.x - fe.rest, axis=-1)
    assert moved.max() > 2
    if not loads:
        assert away.max() < 0.05
        return
    deltas = np.column_stack([values for name, values in learned.facts.items() if name.startswith("delta_a")])
    without = load_model(bar / "models" / "bar" / "spectral").shape(deltas)
    assert away.max() < 0.2 * np.linalg.norm(without[at] - fe.x[:, node], axis=-1).max()


def test_a_run_without_finite_elements_is_drawn_from_the_skin_alone(bar, monkeypatch):
    folder = controlled(bar, "by-model", plant="model", trajectories={"line": POINTS})
    monkeypatch.setattr("cfem.robot.build.build_robot", None)  # nothing is built
    done = drawn(folder, "--format", "gif", "--frames", 2)
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["results"]["files"] == {"line": ["line.gif"]}
    with Image.open(folder.with_name("by-model-animation") / "line.gif") as picture:
        assert picture.n_frames == 2 and picture.info["duration"] == 1000  # so few are not rushed through


def test_a_loop_is_drawn_in_its_own_seconds(bar):
    folder = controlled(bar, "ticks", plant="model", trajectories={"line": POINTS}, loop=LOOP)
    found = animate.run(folder, None, animate.Options(), frames=5)
    assert found["results"]["files"] == {"line": ["line-learned.pvd", "line.gif"]}
    out = folder.with_name("ticks-animation")
    times = [time for time, _ in series(out / "line-learned.pvd")]
    assert len(times) == 5 and (np.diff(times) > 0).all() and times[-1] < 5
    with Image.open(out / "line.gif") as picture:
        assert picture.info["duration"] >= 100


def test_a_page_without_finite_elements_shows_the_learned_skin(bar, run):
    by_model = controlled(bar, "on-page", plant="model", trajectories={"line": POINTS})
    for folder, told in ((run, "finite-element robot"), (by_model, "learned skin")):
        manifest = read_manifest(folder)
        scene = load_spec(bar / "pipelines" / "bar" / "scene.yaml", SceneSpec)
        found = animation(folder, manifest, read_tracking(folder, manifest), scene)
        assert told in found.caption and found.takes[0].lines[0].name == "cable"
        assert found.takes[0].x.shape[1] > found.triangles.max()


def test_a_still_is_one_png_for_each_trajectory(bar, run):
    out = bar / "still"
    done = drawn(run, "--still", "--out", str(out))
    assert done.exit_code == 0 and [path.suffix for path in out.iterdir() if path.suffix != ".json"] == [".png"]


def test_bad_input_is_one_sentence(bar, run):
    other = drawn(bar / "data" / "bar" / "mesh")
    assert other.exit_code == 3 and "was made by cfem mesh" in other.stderr
    unknown = drawn(run, "--format", "mp4")
    assert unknown.exit_code == 2 and "gif, paraview and still are" in unknown.stderr


def test_a_run_without_any_shape_says_what_gives_one(bar):
    specs = bar / "pipelines" / "bar"
    overrides = ["skin=null", "out=../../data/bar/bare-samples"]
    cfem.run_stage("sample", specs / "sample.yaml", overrides=overrides, workers=1)
    train = ["dataset=../../data/bar/bare-samples", "out=../../models/bar/bare"]
    cfem.run_stage("train", specs / "train.yaml", overrides=train)
    models = {"bare": "../../models/bar/bare"}
    folder = controlled(bar, "bare", plant="model", trajectories={"line": POINTS}, models=models)
    done = drawn(folder)
    assert done.exit_code == 3 and "has no skin" in done.stderr and "skin: {}" in done.stderr
    assert not folder.with_name("bare-animation").exists()
