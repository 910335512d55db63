"""The paper's pair of networks: F takes what G gives of the robots at rest, and stands alone once trained."""

import shutil
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch
from support.fast_cases import fast_are
from surrogate.stored import store_dataset, write_model
from surrogate.synthetic import at_rest, dataset

from cfem.core.errors import GateError, InputError
from cfem.core.stage import Options
from cfem.export.stage import run as export
from cfem.predict.load import build, load_model
from cfem.surrogate.error_measures import measure
from cfem.surrogate.model_card import model_card
from cfem.surrogate.modules import module_of
from cfem.surrogate.networks.mlp import fit
from cfem.surrogate.series.spectral import fit as fit_spectral
from cfem.surrogate.spec import MlpSpec
from cfem.surrogate.stage import model_inputs, run

SMALL = MlpSpec(kind="mlp", width=48, depth=2, activation="silu", epochs=80, batch_size=32, learning_rate=3e-3)
TINY = SMALL.model_copy(update={"width": 8, "epochs": 2})
FAMILY = {"parameters": True}


@cache
def network_at_rest() -> tuple[dict, dict]:
    """G, of rows at rest."""
    training = at_rest(dataset(200, 3, **FAMILY))
    arrays, facts, _ = fit(training, SMALL)
    return model_card("mlp", training, **facts), arrays


@cache
def series() -> tuple[dict, dict]:
    """G, of rows that rest is the corner of."""
    training = dataset(100, 3, **FAMILY)
    return model_card("spectral", training), fit_spectral(training, max_degree=8).arrays


def pair(folder, model, spec=SMALL, training=None) -> tuple[dict, dict]:
    training = training or dataset(400, 1, **FAMILY)
    write_model(folder, *model)
    arrays, facts, _ = fit(training, spec.model_copy(update={"at_rest": folder}))
    return model_card("mlp", training, **facts), arrays


def loss(model, test) -> float:
    return measure(test, *model.evaluate(*model_inputs(model, test)))["loss"]


@pytest.mark.parametrize(
    ("rest", "form"),
    fast_are([(network_at_rest, "displacement")], [(network_at_rest, "displacement"), (series, "force")]),
)
def test_the_pair_learns_robots_that_it_tells_apart_by_their_rest(tmp_path, rest, form):
    test = dataset(100, 2, **FAMILY)
    meta, arrays = pair(tmp_path / "g", rest(), SMALL.model_copy(update={"form": form}))
    shutil.rmtree(tmp_path / "g")
    model = build(meta, arrays)
    assert loss(model, test) < 0.03
    assert loss(model, replace(test, p=np.random.default_rng(0).permutation(test.p))) > 0.1
    soft, stiff = (model.at_displacement(test.delta_a[0], [0.4, young]) for young in (3.0, 6.0))
    assert np.allclose(stiff.W, soft.W / 2, rtol=1e-4) and np.allclose(stiff.delta_free, soft.delta_free, atol=1e-4)


def test_a_network_at_rest_knows_its_compliance_and_rounding_says_nothing():
    test = at_rest(dataset(100, 2, **FAMILY))
    meta, arrays = network_at_rest()
    W, delta_free = build(meta, arrays).evaluate(*model_inputs(build(meta, arrays), test))
    found = measure(test, W, delta_free)
    assert found["loss"] < 3e-3 and found["constant_entries"] >= 5
    assert np.array_equal(W, W.swapaxes(1, 2))
    assert np.isinf(arrays["in_scale"][:2]).all() and np.isfinite(arrays["in_scale"][2])


def test_constant_entries_at_rest_change_nothing(tmp_path):
    meta, arrays = pair(tmp_path / "g", network_at_rest(), TINY)
    assert len(arrays["in_scale"]) == 2 + 15 + 5 and np.isinf(arrays["in_scale"][-5:]).all()
    s, p = np.array([[5.0, 6.0]]), np.array([[0.4, 3.0]])
    expected = build(meta, arrays).evaluate(s, p)
    shifted = arrays["at_rest.out_mean"] + np.where(np.arange(20) >= 15, 1.0, 0.0)
    found = build(meta, arrays | {"at_rest.out_mean": shifted}).evaluate(s, p)
    assert all(np.array_equal(one, other) for one, other in zip(found, expected, strict=True))


@pytest.mark.parametrize("rest", [network_at_rest, series])
def test_torch_gives_the_same_and_its_slopes_by_parameters(tmp_path, rest):
    meta, arrays = pair(tmp_path / "g", rest(), SMALL.model_copy(update={"epochs": 10}))
    test = dataset(6, 2, **FAMILY)
    wide = {name: a.astype(float) if a.dtype.kind == "f" else a for name, a in arrays.items()}
    model = build(meta, wide)  # in double precision, to be differenced
    s, p = model_inputs(model, test)
    at = torch.tensor(p, requires_grad=True)
    W, delta_free = module_of(meta, arrays)(torch.tensor(s), at)
    for one, other in zip((W, delta_free), model.evaluate(s, p), strict=True):
        assert np.allclose(one.detach().numpy(), other, atol=1e-5 * np.abs(other).max())
    for index, h in ((0, 1e-5), (1, 1e-4)):
        step = h * np.eye(2)[index]
        ahead, behind = (model.evaluate(s, p + sign * step)[0][:, 3, 3] for sign in (1, -1))
        (slope,) = torch.autograd.grad(W[:, 3, 3].sum(), at, retain_graph=True)
        expected = (ahead - behind) / (2 * h)
        assert np.abs(expected).min() > 1e-6
        assert np.allclose(slope[:, index], expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max())


def test_models_of_other_robots_or_without_rest_are_refused(tmp_path):
    plain = dataset(40, 1)
    one_robot = model_card("spectral", plain), fit_spectral(plain, max_degree=3).arrays
    with pytest.raises(InputError, match=r"is of parameters \[\] .* the dataset of \['material.poisson'\]"):
        pair(tmp_path / "one", one_robot, TINY)
    with pytest.raises(InputError, match=r"the dataset of \[\]"):
        pair(tmp_path / "none", series(), TINY, plain)
    training = dataset(200, 3, **FAMILY)
    bent = training.take(training.delta_a.min(axis=1) > 8)
    with pytest.raises(InputError, match="was trained on no state at rest"):
        pair(tmp_path / "bent", (model_card("spectral", bent), fit_spectral(bent, max_degree=3).arrays), TINY)


@pytest.mark.filterwarnings("ignore:.*torch.jit:DeprecationWarning")
@pytest.mark.slow
def test_a_stored_pair_is_stale_with_its_model_at_rest_and_exports_whole(tmp_path):
    store_dataset(tmp_path / "samples", **FAMILY)
    store_dataset(tmp_path / "rest", rest=True, **FAMILY)
    g, f = tmp_path / "train-g.yaml", tmp_path / "train-f.yaml"
    network = "kind: mlp, width: 8, depth: 2, epochs: 2"
    g.write_text(f"dataset: rest\nout: g\nmodel: {{{network}}}\n")
    with pytest.raises(InputError, match="its rows are all at rest, and kind spectral cannot learn"):
        run(g, ["model={kind: spectral}"], None, Options())
    f.write_text(f"dataset: samples\nout: f\nmodel: {{{network}, at_rest: g}}\n")
    run(g, [], None, Options())
    manifest = run(f, [], None, Options())
    assert manifest["inputs"] == {"dataset": "../samples", "at_rest": "../g"}
    assert run(f, [], None, Options())["status"] == "up to date"
    run(g, ["model.seed=1"], None, Options())
    with pytest.raises(GateError, match="stale"):
        run(f, [], None, Options(check=True))
    shutil.rmtree(tmp_path / "g")
    (tmp_path / "export.yaml").write_text("model: f\nout: export\nformats: [arrays, onnx, torchscript]\n")
    parity = export(tmp_path / "export.yaml", [], None, Options())["results"]["parity"]
    assert max(parity.values()) < 1e-5 and parity["arrays"] == 0
    own, onnx = (load_model(tmp_path / "export", runtime) for runtime in ("arrays", "onnx"))
    state = np.array([5.0, 6.0]), [0.45, 2.0]
    assert np.allclose(own.at(*state).W, onnx.at(*state).W, rtol=1e-4, atol=1e-5)
