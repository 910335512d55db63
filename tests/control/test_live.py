"""Control goes on while its model is trained again: the run takes the new one up at the next tick."""

import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest

import cfem
from cfem.core.artefact.replace import replace_folder
from cfem.plant.imperfect_plant import ImperfectPlant

SPEC = """
scene: {scene}
mesh: {mesh}
models: {{spectral: model}}
out: out
mesh_error: null
trajectories:
  points: {{kind: goals, points: {{mm: {goals}}}}}
search: {{weights: [0, 0, 1]}}
loop:
  rate: 20 Hz
  live: true
  command: {{kind: displacement}}
  controllers: {{open: {{mode: open, iterations: 5}}}}
  settle: {{radius: 0.01 mm, hold: 0.4 s, at_most: 0.5 s}}
"""


def test_a_better_model_is_taken_up_during_the_run(bar, tmp_path, monkeypatch):
    specs, samples = bar / "pipelines" / "bar", bar / "data" / "bar" / "samples"
    rough = [f"dataset={samples}", "model={kind: spectral, max_degree: 2}"]
    cfem.run_stage("train", specs / "train.yaml", overrides=rough, out=tmp_path / "model")
    good = cfem.load_model(bar / "models" / "bar" / "spectral")
    goals = [(good.rest_e + good.at_displacement([d]).delta_e).tolist() for d in (6.5, 5.0)]
    text = SPEC.format(scene=specs / "scene.yaml", mesh=bar / "data" / "bar" / "mesh", goals=goals)
    (tmp_path / "control.yaml").write_text(text)
    step, count = ImperfectPlant.step, [0]

    def trained_meanwhile(self, u, kind="displacement"):
        count[0] += 1
        if count[0] == 4:
            shutil.copytree(bar / "models" / "bar" / "spectral", tmp_path / ".new")
            replace_folder(tmp_path / ".new", tmp_path / "model")
        return step(self, u, kind)

    monkeypatch.setattr(ImperfectPlant, "step", trained_meanwhile)
    cfem.run_stage("control", tmp_path / "control.yaml")
    table = pq.read_table(tmp_path / "out" / "loop.parquet").to_pylist()
    off = np.array([abs(one["x_e"][2] - one["goal"][2]) for one in table])
    taken = np.array([one["models_taken"] for one in table])
    assert taken[0] == 0 and taken[-1] == 1 and (np.diff(taken) >= 0).all()
    assert off[taken == 0][1:].min() > 5 * off[-1] and off[-1] < 1e-3


def test_what_knows_the_model_otherwise_is_refused(bar, tmp_path):
    text = SPEC.format(scene="scene.yaml", mesh="mesh", goals=[[0, 0, 0]])
    (tmp_path / "control.yaml").write_text(text.replace("iterations: 5", "shaping: {kind: zv}"))
    with pytest.raises(cfem.CfemError, match="live goes with modes open and closed"):
        cfem.run_stage("control", tmp_path / "control.yaml")
