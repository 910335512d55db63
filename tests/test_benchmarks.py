"""Every benchmark that a page names runs, at the smallest size that takes all its lines."""

import json
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BAR = "pipelines/bar/scene.yaml"
QUICK = {
    "antagonists.py": ["--quick"],
    "arm_baselines.py": [],
    "cable_reach.py": ["--quick"],
    "calibrated_commands.py": ["--quick"],
    "contact_meshes.py": ["--quick"],
    "convergence.py": ["--quick"],
    "design_gradients.py": ["--quick"],
    "many_inputs.py bar": ["--quick"],
    "hysteresis.py": [BAR, "--set", "mesh.size=20 mm", "--steps", "2", "--largest", "0.5"],
    "measured.py coverage": ["--quick"],
    "measured.py cylinder": ["--quick"],
    "measured.py rods": ["--quick"],
    "measured_motion.py": ["--quick"],
    "motion.py": ["bar", "--quick"],
    "stiff_flop.py rest": ["--quick"],
    "stiff_flop.py bending": ["--quick"],
    "stiff_flop.py solid": ["--quick"],
    "tour.py": [BAR, "8", "mesh.size=10 mm"],
    "verification.py": [BAR, "mesh.size=10 mm"],
}

# What needs artefacts of pipelines that take minutes: by hand, after the `make` target that its help names.
LONG = {
    "soft_places.py": "nothing: places for contact_anywhere.py",
    "adaptation.py": "cfem run pipelines/soft-finger/train-material.yaml",
    "contact_anywhere.py": "make soft-finger",
    "contact_patches.py": "make soft-finger",
    "contact_resolution.py": "make demo, and minutes of finite elements",
    "friction_steps.py": "make demo, and a control run with friction",
    "contact_random.py": "nothing: it takes minutes",
    "control_process.py": "an exported model",
    "control_ratio.py": "a model, and a second checkout",
    "designs.py": "make parametric-finger",
    "embedded.py": "make embedded",
    "embedded_qp.py": "make embedded",
    "estimate.py": "make soft-finger",
    "gripping_force.py": "cfem run pipelines/pneunet/train-blocked.yaml, see its help",
    "holding.py": "make soft-finger",
    "gym_series.py": "an exported model, and a C compiler",
    "figure_eight.py": "an hour of finite elements that move, see its help",
    "front_nsga.py": "make finger-shapes",
    "gaits.py": "cfem run pipelines/crawler/train.yaml",
    "mujoco_hand.py": "make soft-finger, and minutes of finite elements",
    "mpc.py": "a model that has learned to move, see its help",
    "remeshing.py": "make finger-shapes",
    "shape_distance.py": "a trained model, see its help",
    "skin.py": "a trained model, see its help",
    "shape_gain.py": "make finger-shapes",
    "stiff_flop_experiments.py": "make stiff-flop-experiments",
    "stiff_flop_stability.py": "make stiff-flop",
    "gym.py": "make soft-finger",
    "lift.py": "examples/train_lift.py",
    "loads.py": "minutes of finite elements: see its help",
    "meeting.py": "minutes of finite elements: see its help",
    "mesh_error.py": "minutes of finite elements: see its help",
    "self_contact.py": "minutes of finite elements: see its help",
    "pneunet_bending.py": "minutes of finite elements: see its help",
    "model_error.py": "minutes of finite elements: see its help",
    "ringing.py": "cfem run pipelines/moving-finger/train.yaml",
    "rows.py": "minutes of finite elements: see its help",
    "one_policy.py": "make finger-shapes, and an hour: see its help",
    "page.py": "make pages",
    "throughput.py": "make soft-finger",
}


ALWAYS = ("tour.py", "convergence.py")  # the others run in the slow suite


@pytest.mark.parametrize(
    "named", [pytest.param(name, marks=[] if name in ALWAYS else pytest.mark.slow) for name in QUICK]
)
def test_a_benchmark_runs(named, monkeypatch, capsys):
    script, *words = named.split()
    monkeypatch.chdir(ROOT)
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    monkeypatch.setattr(sys, "argv", [script, *words, *QUICK[named]])
    try:  # here: a process of its own takes seconds to start
        runpy.run_path(str(ROOT / "benchmarks" / script), run_name="__main__")
    except SystemExit as end:
        assert not end.code
    printed = capsys.readouterr().out
    assert "nan" not in printed.lower()
    assert printed if script == "stiff_flop.py" else json.loads(printed)


@pytest.mark.slow
def test_the_timed_benchmarks_run():
    command = [sys.executable, "-m", "pytest", "-q", "benchmarks", "--benchmark-disable"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_every_benchmark_has_a_small_size_or_a_reason():
    scripts = {path.name for path in (ROOT / "benchmarks").glob("*.py") if not path.name.startswith("test_")}
    assert scripts == {one.split()[0] for one in QUICK} | set(LONG)
