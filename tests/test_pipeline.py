"""The smallest robot through every stage by `cfem run`, as `make bar` does it."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.stage import read_manifest

ROOT = Path(__file__).parents[1]
STAGES = {
    "mesh": "scene",
    "simulate-sample": "sample",
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
    stages = json.loads(first.stdout)["stages"]
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
    assert "6 of 6" in page and " mm</strong>" in page and " ms</strong>" in page


def test_nothing_is_run_again(bar, outcomes):
    for stage in STAGES:
        again = cfem(bar, stage)
        assert again.exit_code == 0 and json.loads(again.stdout)["status"] == "up to date", stage
        assert cfem(bar, stage, "--check").exit_code == 0


def test_a_second_run_does_nothing_and_ends_with_the_figures(bar, outcomes):
    code, printed, said = run(bar)
    assert code == 0 and said.count("up to date") == len(STAGES) and "nothing to run" in printed
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
        assert code == 0 and "1 of 5 stages run" in printed and "report" not in said
        assert "report.yaml  stale: its control has changed\n" in run(bar, "--check")[2]
    finally:
        control.write_text(text)
    assert run(bar)[0] == 0


def test_samples_of_another_robot_are_kept_unless_forced(bar, outcomes):
    scene = bar / "scene.yaml"
    text = scene.read_text()
    scene.write_text(text.replace("width: 10 mm", "width: 11 mm"))
    try:
        code, _, said = run(bar, "--until", "simulate-sample")
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
    assert steps == [f"step {number}/7" for number in range(1, 8)]
    goals, error, time, page = found.stdout.splitlines()
    assert "6 of 6" in goals and "of the length) uncertain" in error and "one FE solve" in time
    assert page.endswith("report.html")


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
