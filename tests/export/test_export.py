"""Exported files equal the trained model, describe themselves and take any batch."""

import json
import re
import warnings
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from support.blocked import cfem_without
from surrogate.stored import train_folder

import cfem
from cfem.core.errors import SpecError
from cfem.core.stage import Options
from cfem.export.stage import run

MODELS = {"spectral": "{kind: spectral, max_degree: 9}", "mlp": "{kind: mlp, width: 8, depth: 2, epochs: 2}"}


FEW = [("spectral", 2), ("mlp", 2)]
CASES = [("spectral", 2), ("spectral", 1), ("spectral", 3), ("mlp", 2)]


@pytest.fixture(
    scope="module",
    params=[pytest.param(model, marks=() if model in FEW else pytest.mark.slow) for model in CASES],
    ids=str,
)
def exported(request, tmp_path_factory):
    kind, n_a = request.param
    folder = tmp_path_factory.mktemp("export")
    train_folder(folder, MODELS[kind], n_a=n_a)
    (folder / "export.yaml").write_text("model: model\nout: export\n")
    return folder / "export", run(folder / "export.yaml", [], None, Options()), n_a


def test_parity_of_every_format(exported):
    _, manifest, _ = exported
    tolerance = {"spectral": 1e-10, "mlp": 1e-5}[manifest["results"]["kind"]]
    assert set(manifest["results"]["parity"]) == {"arrays", "onnx", "torchscript"}
    assert all(parity <= tolerance for parity in manifest["results"]["parity"].values())
    assert manifest["results"]["parity"]["arrays"] == 0.0


def test_the_batch_axis_is_free(exported):
    folder, _, n_a = exported
    session = onnxruntime.InferenceSession(str(folder / "model.onnx"), providers=["CPUExecutionProvider"])
    for batch in (1, 7):
        W, delta_free = session.run(["W", "delta_free"], {"delta_a": np.ones((batch, n_a))})
        assert W.shape == (batch, 3 + n_a, 3 + n_a) and delta_free.shape == (batch, 3 + n_a)
        assert W.dtype == delta_free.dtype == np.float64


def test_the_programs_that_the_site_shows_run_and_agree(exported, monkeypatch):
    folder, _, n_a = exported
    if n_a != 2:
        return
    monkeypatch.chdir(folder)
    page = (Path(__file__).parents[2] / "docs" / "reference" / "models.md").read_text()
    shown = []
    for program in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # torch calls its script format so
            exec(program, names := {})
        shown.append((np.asarray(names["W"])[0], np.asarray(names["delta_free"])[0]))
    model = cfem.load_model(folder)
    expected = model.at_displacement([5.0, 0.0])
    for W, delta_free in shown:
        np.testing.assert_allclose(W, expected.W, rtol=1e-5, atol=1e-8)
        np.testing.assert_allclose(delta_free, expected.delta_free, rtol=1e-5, atol=1e-6)
    assert len(shown) == 2


def test_onnx_carries_its_meaning(exported):
    folder, _, _ = exported
    props = {prop.key: prop.value for prop in onnx.load(folder / "model.onnx").metadata_props}
    card = json.loads((folder / "model.json").read_text())
    for key in ("rows", "units", "domain", "errors", "dataset", "rest_e"):
        assert json.loads(props[key]) == card[key]
    assert props["opset"] == "17" and len(card["dataset"]["content"]) == 64


def test_only_the_formats_asked_for(tmp_path):
    train_folder(tmp_path, MODELS["spectral"])
    (tmp_path / "export.yaml").write_text("model: model\nout: export\nformats: [arrays]\n")
    manifest = run(tmp_path / "export.yaml", [], None, Options())
    assert set(manifest["files"]) == {"weights.npz", "model.json", "test_vectors.npz"}


def test_without_pytorch_the_arrays_are_written_and_the_rest_is_named(tmp_path):
    train_folder(tmp_path, MODELS["spectral"])
    (tmp_path / "export.yaml").write_text("model: model\nout: export\n")
    ended = cfem_without({"torch", "onnx", "onnxruntime"}, ["export", "export.yaml"], tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert "onnx and torchscript: left out, they need PyTorch (pip install 'cfem[train]')" in ended.stdout
    assert {path.name for path in (tmp_path / "export").iterdir()} >= {"weights.npz", "model.json"}
    assert not (tmp_path / "export" / "model.onnx").exists()
    manifest = run(tmp_path / "export.yaml", [], None, Options())  # PyTorch has come: they are written now
    assert {"model.onnx", "model.ts"} <= set(manifest["files"])


def test_an_unknown_format_is_a_spec_error(tmp_path):
    (tmp_path / "export.yaml").write_text("model: model\nout: export\nformats: [pickle]\n")
    with pytest.raises(SpecError, match="'arrays', 'onnx', 'torchscript', 'c', 'html', 'fmu', 'arduino' or 'mjcf'"):
        run(tmp_path / "export.yaml", [], None, Options())
