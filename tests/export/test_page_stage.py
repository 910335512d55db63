"""`cfem export` with format html, of a trained model with the skin of its finite elements."""

import shutil

import numpy as np
import pytest
from export.pages import browser, opened

import cfem
from cfem.core.errors import CfemError, InputError
from cfem.core.stage import Options
from cfem.export.stage import run, stage
from cfem.predict.load import load_model

COMMANDS = 100


@pytest.fixture(scope="module")
def made(bar):
    """The bar's export, and its manifest."""
    spec = bar / "pipelines" / "bar" / "export.yaml"
    return spec, run(spec, ["formats=[html]"], bar / "models" / "bar" / "page", Options())


def test_the_page_of_a_trained_model_is_its_shape(made, bar):
    """Tip and every surface node, for 100 commands, to 1e-6 mm; what is drawn inside moves too."""
    manifest = made[1]
    path = bar / "models" / "bar" / "page" / "page.html"
    assert manifest["results"]["bytes"]["html"] == path.stat().st_size < 1e6
    assert "page.html" in manifest["results"]["headline"][-1]
    model = load_model(bar / "models" / "bar" / "spectral")
    commands = np.linspace(*model.reach[0], COMMANDS)
    with browser() as chromium:
        tab = opened(chromium, path)
        there = tab.evaluate(
            "commands => commands.map(d => { const r = cfem.robot; r.set([d]); r.shape(); "
            "return [[...r.x_e], [...r.x]]; })",
            commands.tolist(),
        )
        assert tab.faults == []
    shape = model.shape(commands[:, None])
    n = shape[0].size
    for command, expected, (x_e, x) in zip(commands, shape, there, strict=True):
        assert np.abs(np.array(x[:n]) - expected.ravel()).max() < 1e-6
        assert np.abs(np.array(x_e) - model.rest_e - model.at_displacement([command]).delta_e).max() < 1e-6
    cable = np.array([x[n:] for _, x in there]).reshape(COMMANDS, -1, 3)
    assert (cable[:, 0] == cable[0, 0]).all() and np.ptp(cable[:, -1], axis=0).max() > 1  # pull point, last point


def test_an_export_that_is_there_is_not_made_again(made, bar):
    spec, _ = made
    again = run(spec, ["formats=[html]"], bar / "models" / "bar" / "page", Options())
    assert again["results"] == made[1]["results"] and again["seconds"] == made[1]["seconds"]
    inputs = stage(spec, ["formats=[html]"]).extra()
    assert {"cfem.wasm", "app.js", "page.html"} <= set(inputs["html"])


def test_a_model_without_a_skin_says_what_makes_one(bar, tmp_path):
    specs = bar / "pipelines" / "bar"
    cfem.run_stage("train", specs / "train.yaml", overrides=["skin=false"], out=tmp_path / "bare")
    with pytest.raises(InputError, match="has no skin") as error:
        run(specs / "export.yaml", ["formats=[html]", f"model={tmp_path / 'bare'}"], tmp_path / "page", Options())
    assert "skin: {}" in error.value.do
    # the skin of another model of the robot serves
    skin = f"skin={bar / 'models' / 'bar' / 'spectral'}"
    run(specs / "export.yaml", ["formats=[html]", f"model={tmp_path / 'bare'}", skin], tmp_path / "page", Options())
    assert (tmp_path / "page" / "page.html").exists()


def test_loads_are_refused(bar, tmp_path):
    spec = bar / "pipelines" / "bar" / "export.yaml"
    with pytest.raises(CfemError, match="draws no loads"):
        run(spec, ["formats=[html]", "loads={tip: {force: {uN: [0, 0, -1]}}}"], tmp_path / "page", Options())
    shutil.rmtree(tmp_path / "page", ignore_errors=True)
