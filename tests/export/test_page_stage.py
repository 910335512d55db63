"""`cfem export` with format html, of a trained model with the skin of its finite elements."""

import numpy as np
import pytest
from export.pages import browser, opened, until

import cfem
from cfem.core.errors import InputError
from cfem.core.stage import Options
from cfem.export.stage import run, stage
from cfem.predict.load import load_model
from cfem.predict.loads.loaded import loaded

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


@pytest.mark.slow
def test_a_weight_at_the_tip_is_that_of_the_loaded_model(made, bar):
    """Tip, tension and every surface node, to 1e-6 mm and 1e-9 N; without weight again, what was before."""
    model = load_model(bar / "models" / "bar" / "spectral")
    lengths = np.linspace(*model.reach[0], 6)[1:]
    with browser() as chromium:
        tab = opened(chromium, bar / "models" / "bar" / "page" / "page.html")
        largest = tab.evaluate("() => cfem.robot.said.weight")
        there = {
            share: tab.evaluate(
                "([share, lengths]) => lengths.map(d => { const r = cfem.robot; r.weigh(share); r.set([d]); r.shape(); "
                "return [[...r.x_e], [...r.lambda_a], [...r.x]]; })",
                [share, lengths.tolist()],
            )
            for share in (0.37, 1.0, 0.0)
        }
        tab.evaluate(
            "() => { const w = document.getElementById('weight'); w.value = 0.5; "
            "w.dispatchEvent(new Event('input')); w.dispatchEvent(new Event('change')); }"
        )
        assert tab.inner_text("#grams").endswith(f"{500 * largest:.1f} mN")
        until(tab, "!cfem.state.moving && cfem.state.weight === 0.5")
        assert tab.faults == []
    assert 0.01 < largest < 1  # N
    for share, found in there.items():
        weighed = loaded(model, [0.0, 0.0, -share * largest])
        for length, (x_e, tension, x) in zip(lengths, found, strict=True):
            at, shape = weighed.at_displacement([length]), weighed.shape([length])
            assert np.abs(np.array(x_e) - model.rest_e - at.delta_e).max() < 1e-6
            assert np.abs(np.array(tension) - at.lambda_a).max() < 1e-9
            assert np.abs(np.array(x[: shape.size]) - shape.ravel()).max() < 1e-6
    assert there[1.0][0][0][2] < there[0.0][0][0][2] - 0.1  # it sags


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


@pytest.mark.slow
def test_a_page_under_loads_is_the_loaded_model(bar, tmp_path):
    """A page of a stated load has that load, and no slider for another one."""
    spec = bar / "pipelines" / "bar" / "export.yaml"
    run(spec, ["formats=[html]", "loads={tip: {force: {mN: [0, 30, 0]}}}"], tmp_path / "page", Options())
    weighed = loaded(load_model(bar / "models" / "bar" / "spectral"), [0.0, 0.03, 0.0])
    with browser() as chromium:
        tab = opened(chromium, tmp_path / "page" / "page.html")
        x_e, x = tab.evaluate("() => { const r = cfem.robot; r.set([3]); r.shape(); return [[...r.x_e], [...r.x]]; }")
        assert tab.locator("#load").is_hidden()
    at, shape = weighed.at_displacement([3.0]), weighed.shape([3.0])
    assert np.abs(np.array(x_e) - weighed.rest_e - at.delta_e).max() < 1e-6 and abs(at.delta_e[1]) > 0.1
    assert np.abs(np.array(x[: shape.size]) - shape.ravel()).max() < 1e-6
