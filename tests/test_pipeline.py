"""The smallest robot through every stage by `cfem run`, as `make bar` does it."""

import json
import re
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.artefact.chain import demand_current
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError
from cfem.robot.load import load_scene_and_mesh

ROOT = Path(__file__).parents[1]
STAGES = {
    "mesh": "scene",
    "sample": "sample",
    "train": "train",
    "export": "export",
    "control": "control",
    "report": "report",
}


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    root = tmp_path_factory.mktemp("project")
    shutil.copytree(ROOT / "pipelines" / "bar", root / "pipelines" / "bar")
    return root / "pipelines" / "bar"


def cfem(folder, stage, *words):
    return CliRunner().invoke(app, [stage, str(folder / f"{STAGES[stage]}.yaml"), "--json", *words])


@pytest.fixture(scope="module")
def outcomes(bar):
    """The manifest of every stage."""
    first = CliRunner().invoke(app, ["run", str(bar), "--json"])
    assert first.exit_code == 0, first.stderr
    stages = json.loads(first.stdout)["results"]["stages"]
    assert [(one["stage"], one["status"], one["why"]) for one in stages] == [
        (stage, "done", ["not made yet"]) for stage in STAGES
    ]
    return {one["stage"]: read_manifest(Path(one["out"])) for one in stages}


def run(bar, *words):
    """Exit code, what was printed, what was said."""
    done = CliRunner().invoke(app, ["run", str(bar), *words])
    return done.exit_code, done.stdout, done.stderr


def test_the_bar_is_tracked_by_its_learned_model(outcomes):
    tracked = next(iter(outcomes["control"]["results"]["trajectories"].values()))
    learned = next(row for name, row in tracked.items() if name not in ("fe-based",) and "@" not in name)
    assert learned["reachable"] > 0
    assert learned["distance_to_fe_based"]["max"] < 0.1


@pytest.mark.slow
def test_the_bar_is_controlled_over_time_though_it_is_stiffer_than_its_model(bar, outcomes):
    loop = (
        "{rate: 10 Hz, command: {kind: force}, controllers: {open: {mode: open}, closed: {mode: closed}}, "
        "settle: {radius: 0.1 mm, hold: 0.5 s, at_most: 3 s}, real: {scene: [material.young=1.1 MPa]}, "
        "sensor: {noise: 10 um, delay: 1}}"
    )
    # Within 0.8 of the reach: forces that pull the stiffer bar to the end of it are more than the model's own reach.
    changed = ("--set", f"loop={loop}", "--set", "trajectories.swing.radii=[0.3]")
    found = cfem(bar, "control", *changed, "--out", str(bar / "over-time"))
    assert found.exit_code == 0, found.stderr
    swing = json.loads(found.stdout)["results"]["loop"]["swing"]
    assert swing["closed"]["reached"]["min"] == 6 and swing["open"]["reached"]["max"] < 6
    (bar / "loops.yaml").write_text("loops: {stiffer: over-time}\nout: page\n")
    page = CliRunner().invoke(app, ["report", str(bar / "loops.yaml"), "--json"])
    assert page.exit_code == 0 and "loop-stiffer-swing-1.svg" in json.loads(page.stdout)["results"]["pictures"]
    mistaken = cfem(bar, "report", "--set", "control=over-time", "--out", str(bar / "mistaken"))
    assert mistaken.exit_code != 0 and "under `loops`" in mistaken.stderr


def test_the_page_is_whole_and_stands_alone(bar, outcomes):
    page = (bar.parents[1] / "data" / "bar" / "report" / "report.html").read_text()
    assert page.count('<figure class="viewer">') == 2 and page.count('<figure class="chart">') >= 4
    assert "http://" not in page and "https://" not in page and ' src="data:' in page
    assert "6 of 6" in page and re.search("[nuµ]?m</strong>", page) and re.search("[uµm]s</strong>", page)


def test_nothing_is_run_again(bar, outcomes):
    for stage in STAGES:
        again = cfem(bar, stage)
        assert again.exit_code == 0 and json.loads(again.stdout)["status"] == "up to date", stage
        assert cfem(bar, stage, "--check").exit_code == 0


def test_a_second_run_does_nothing_and_ends_with_the_figures(bar, outcomes):
    code, printed, said = run(bar)
    assert code == 0 and said.count("up to date") == len(STAGES) and printed.startswith("run: up to date\n")
    assert "goals reached" in printed and printed.count("report.html") == 1
    assert run(bar, "--check")[0] == 0


def test_comments_and_spelling_make_nothing_stale(bar, outcomes):
    texts = {path: path.read_text() for path in bar.glob("*.yaml")}
    try:
        for path, text in texts.items():
            path.write_text("# mine\n" + text.replace("10 mm", "1 cm").replace("out: ../../", "out: ../bar/../../"))
        assert run(bar, "--check")[0] == 0
    finally:
        for path, text in texts.items():
            path.write_text(text)


def test_what_changed_is_said_and_what_follows_is_run_again(bar, outcomes):
    control = bar / "control.yaml"
    text = control.read_text()
    control.write_text(text.replace("goals: 6", "goals: 5"))
    try:
        code, _, said = run(bar, "--check")
        assert code == 5 and "2 of 6 stages are stale" in said
        assert "control.yaml  stale: trajectories.swing.goals: 6 -> 5\n" in said
        assert re.search(r"report.yaml  waits for \S*control.yaml\n", said)
        assert said.count("up to date") == 4
        code, printed, said = run(bar, "--until", "control")
        assert code == 0 and printed.startswith("run: done") and said.count("up to date") == 4
        assert "report.yaml  stale: its control has changed\n" in run(bar, "--check")[2]
    finally:
        control.write_text(text)
    assert run(bar)[0] == 0


def test_samples_of_another_robot_are_kept_unless_forced(bar, outcomes):
    scene = bar / "scene.yaml"
    text = scene.read_text()
    scene.write_text(text.replace("width: 10 mm", "width: 11 mm"))
    try:
        code, _, said = run(bar, "--until", "sample")
        assert code == 6 and "scene.yaml  stale: geometry.width: 10 mm -> 11 mm\n" in said
        assert "sample.yaml  stale: its mesh has changed; scene.geometry.width: 10 mm -> 11 mm\n" in said
        assert "holds results from other inputs" in said
    finally:
        scene.write_text(text)
    assert run(bar, "--only", "mesh")[0] == 0 and run(bar, "--check")[0] == 0


def test_the_demo_says_each_step_and_ends_with_three_numbers(bar, outcomes):
    found = CliRunner().invoke(app, ["demo", "bar", "--folder", str(bar.parent)])
    assert found.exit_code == 0, found.stderr
    steps = [line.split(":")[0] for line in found.stderr.splitlines() if line.startswith("step ")]
    assert steps == [f"step {number}/6" for number in range(1, 7)]
    goals, error, time, page = found.stdout.splitlines()
    assert "6 of 6" in goals and "of the robot's length)" in error and "one FE solve" in time
    assert page.endswith("report.html")


@contextmanager
def edited(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    try:
        yield
    finally:
        path.write_text(text)


def refused(bar, stage, *words):
    """What a stage says that stops because of its inputs."""
    done = cfem(bar, stage, *words)
    assert done.exit_code == 3 and not done.stdout, (stage, done.stdout, done.stderr)
    return done.stderr


def test_no_stage_accepts_a_mesh_of_another_geometry_in_silence(bar, outcomes):
    with edited(bar / "scene.yaml", "width: 10 mm", "width: 14 mm"):
        for stage in [one for one in STAGES if one != "mesh"]:
            said = refused(bar, stage)
            assert "data/bar/mesh: is stale: geometry.width: 10 mm -> 14 mm" in said, stage
            assert re.search(r"run cfem mesh \S*pipelines/bar/scene.yaml,", said)
            assert cfem(bar, stage, "--check").exit_code == 5
        done = CliRunner().invoke(app, ["stability", str(bar / "scene.yaml"), "--list"])
        assert done.exit_code == 3 and "geometry.width: 10 mm -> 14 mm" in done.stderr


@pytest.mark.parametrize(
    "spec, old, new, first, below",
    [
        ("sample", "rows: 16", "rows: 20", "data/bar/samples: is stale: splits.train.rows: 16 -> 20", 4),
        pytest.param(
            *("train", "max_degree: 8", "max_degree: 6", "models/bar/spectral: is stale: model.max_degree: 8 -> 6", 3),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            *("export", "model:", "formats: [arrays]\nmodel:", "models/bar/spectral-export: is stale: formats: ", 2),
            marks=pytest.mark.slow,
        ),
        ("control", "radii: [0.4]", "radii: [0.3]", "data/bar/control: is stale: trajectories.swing.radii.0: 0.4", 1),
    ],
)
def test_a_stale_input_is_named_with_what_changed_however_far_up_it_is(bar, outcomes, spec, old, new, first, below):
    stages = list(STAGES)
    with edited(bar / f"{spec}.yaml", old, new):
        for stage in stages[len(stages) - below :]:
            assert first in refused(bar, stage)
    for stage in stages:
        assert cfem(bar, stage, "--check").exit_code == 0


def test_an_override_of_the_robot_that_only_the_mesh_saw_is_refused(bar, outcomes):
    scene, mesh = bar / "scene.yaml", bar.parents[1] / "data" / "bar" / "mesh"
    try:
        assert cfem(bar, "mesh", "--set", "material.young=5 MPa").exit_code == 0
        with pytest.raises(InputError, match=r"young was 5 MPa, the scene has 1 MPa .*--set material.young=5 MPa"):
            load_scene_and_mesh(scene, mesh)
        said = refused(bar, "sample", "--out", str(bar / "elsewhere"))
        assert "material.young was 5 MPa, the scene has 1 MPa" in said and "edit " in said
        assert cfem(bar, "mesh", "--set", "mesh.size=9 mm").exit_code == 0  # another mesh of the same robot
        assert load_scene_and_mesh(scene, mesh)[0].mesh.size == 8
    finally:
        assert cfem(bar, "mesh").exit_code == 0


def test_a_mesh_of_another_element_or_shape_is_refused_whichever_file_says_so(bar, outcomes):
    mesh, other = bar.parents[1] / "data" / "bar" / "mesh", bar / "other.yaml"
    text = (bar / "scene.yaml").read_text()
    changes = {
        "mesh.element was tet10p0, the scene has tet4": text.replace("size: 8 mm", "size: 8 mm\n  element: tet4"),
        "geometry.height was 10 mm, the scene has 9 mm": text.replace("height: 10 mm", "height: 9 mm"),
    }
    for said, changed in changes.items():
        other.write_text(changed)
        with pytest.raises(InputError, match=said):
            load_scene_and_mesh(other, mesh)
    other.write_text(
        text.replace("name: bar", "name: stiff").replace("1 MPa", "2 MPa")
    )  # a scene of its own, same mesh
    assert load_scene_and_mesh(other, mesh)[0].material.young == 2


def test_a_model_of_another_robot_is_refused(bar, outcomes):
    (bar / "other.yaml").write_text((bar / "scene.yaml").read_text().replace("young: 1 MPa", "young: 2 MPa"))
    said = refused(bar, "control", "--set", "scene=other.yaml", "--out", str(bar / "elsewhere"))
    assert "spectral-export: is not of this robot: material.young was 1 MPa, the scene has 2 MPa" in said
    said = refused(bar, "report", "--set", "scene=other.yaml", "--out", str(bar / "elsewhere"))
    assert "samples: is not of this robot: material.young was 1 MPa, the scene has 2 MPa" in said
    assert not (bar / "elsewhere").exists()


def test_a_model_is_used_without_what_it_was_made_from(bar, outcomes, tmp_path):
    """On a robot there are neither samples nor specs: nothing is known against the model."""
    root = bar.parents[1]
    shutil.copytree(root / "models" / "bar" / "spectral-export", tmp_path / "model")
    demand_current(tmp_path / "model")
    (root / "data" / "bar" / "samples").rename(root / "gone")
    try:
        demand_current(root / "models" / "bar" / "spectral-export")
    finally:
        (root / "gone").rename(root / "data" / "bar" / "samples")


def test_a_change_upstream_makes_all_below_stale(bar, outcomes):
    changed = cfem(bar, "mesh", "--check", "--set", "mesh.size=7 mm")
    assert changed.exit_code == 5 and "stale" in changed.stderr


def test_no_column_for_what_the_scene_has_not(bar, outcomes):
    import pyarrow.parquet as pq

    names = pq.read_schema(bar.parents[1] / "data" / "bar" / "samples" / "train.parquet").names
    assert not {"delta_c", "lambda_c", "p", "dpsi_dp"} & set(names)
    assert {"delta_a", "delta_e", "lambda_a", "W", "delta_free", "energy", "residual"} <= set(names)


def test_control_from_the_exported_arrays_imports_no_torch(bar, outcomes):
    code = (
        "import sys; from pathlib import Path; import cfem.control.stage as stage; from cfem.core.stage import Options;"
        f"stage.run(Path({str(bar / 'control.yaml')!r}), [], None, Options(force=True, quiet=True));"
        "print([name for name in ('torch', 'onnxruntime', 'gmsh', 'matplotlib') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_damaged_samples_are_found_before_training(bar, outcomes):
    path = bar.parents[1] / "data" / "bar" / "samples" / "train.parquet"
    whole = path.read_bytes()
    broken = bytearray(whole)
    broken[len(broken) // 2] ^= 1
    path.write_bytes(broken)
    try:
        outcome = cfem(bar, "train", "--force")
        assert outcome.exit_code == 3 and "train.parquet" in outcome.stderr
    finally:
        path.write_bytes(whole)
