"""W is semidefinite wherever W_aa is, whatever a model says of the locked compliance: every kind, form and runtime, at
random states, within the domain and beyond it."""

import numpy as np
import onnxruntime
import pytest
import torch
from export.embedded import compiler, export, network, serial, spectral, states
from export.test_graphs import network_of_forces
from support.fast_cases import fast_are

from cfem.condensed.packing import unpacking
from cfem.export.compiled.controller import CompiledController
from cfem.export.onnx import onnx_bytes
from cfem.predict.load import build
from cfem.predict.series.energy import layout
from cfem.predict.series.semidefinite import FLOOR, nearest
from cfem.surrogate.definiteness import smallest_eigenvalue
from cfem.surrogate.modules import module_of

SIZES = [4.0, 6.0, 0.7]


def spoiled(meta, arrays, sizes):
    """The same model, its compliance far from semidefinite in one direction that no axis is along."""
    n_e = len(sizes)
    rng = np.random.default_rng(0)
    direction = rng.standard_normal(n_e)
    less = 4 * np.outer(direction * sizes, direction * sizes)[np.triu_indices(n_e)]
    arrays = {name: values.copy() for name, values in arrays.items()}
    card = meta["modules"][0] if "modules" in meta else meta
    start = "0." if "modules" in meta else ""
    if card["kind"] == "mlp":
        n = n_e + len(card["rows"]["actuators"])
        arrays["out_mean"][unpacking(n)[:n_e, :n_e][np.triu_indices(n_e)]] -= less
    else:
        C = layout(len(card["rows"]["actuators"]), n_e)["effector_compliance"]
        arrays[start + "series"][C, (arrays[start + "indices"] == 0).all(axis=1).argmax()] -= less
    flagged = {**card, "semidefinite": list(sizes)}
    return ({**meta, "modules": [flagged]} if "modules" in meta else flagged), arrays


MODELS = {
    "spectral": (lambda: spectral("displacement"), SIZES),
    "spectral, force": (lambda: spectral("force"), SIZES),
    "spectral, robots": (lambda: spectral("displacement", 2, True), SIZES),
    "mlp": (network, SIZES),
    "mlp, force": (network_of_forces, SIZES),
    "serial": (serial, [3.0, 5.0, 5.0, 0.1, 0.1, 0.1]),
}


@pytest.fixture(scope="module", params=fast_are({"spectral", "spectral, force", "mlp"}, MODELS), ids=str)
def model(request):
    """meta, arrays of the spoiled model; the same without what mends it; s and p."""
    made, sizes = MODELS[request.param]
    meta, arrays = spoiled(*({"errors": {}, "dataset": {}} | one if "kind" in one else one for one in made()), sizes)
    n_a, robots = len(meta["rows"]["actuators"]), bool(meta["parameters"])
    s = states(meta["form"], n_a, 200, parameters=robots)
    s = np.vstack([s, np.random.default_rng(1).uniform(-0.2, 1.2, (200, n_a)) * s.max(axis=0)])
    p = np.tile([[0.44, 2.0]], (len(s), 1)) if robots else None
    plain = {**meta, "modules": [{**meta["modules"][0], "semidefinite": None}]} if "modules" in meta else meta
    return meta, arrays, {**plain, "semidefinite": None}, s, p


def check(W, n_e):
    """Semidefinite to rounding, where the actuators' own compliance is definite."""
    sound = np.linalg.eigvalsh(W[:, n_e:, n_e:])[:, 0] > 0
    assert sound.sum() > 0.4 * len(W)
    assert smallest_eigenvalue(W[sound]).min() > -1e-11
    return sound


def test_arrays(model):
    meta, arrays, plain, s, p = model
    n_e = len(meta["rows"]["effectors"])
    W, free = build(meta, arrays).evaluate(s, p)
    before, same = build(plain, arrays).evaluate(s, p)
    sound = check(W, n_e)
    assert smallest_eigenvalue(before[sound]).min() < -1e-3
    np.testing.assert_array_equal(W[:, n_e:], before[:, n_e:])  # nothing else changes
    np.testing.assert_array_equal(free, same)


def test_torch_and_onnx(model):
    meta, arrays, _, s, p = model
    inputs = {{"displacement": "delta_a", "force": "lambda_a"}[meta["form"]]: s} | ({} if p is None else {"p": p})
    module = module_of(meta, arrays)
    with torch.no_grad():
        by_torch = module(*map(torch.as_tensor, inputs.values()))[0].numpy()
    session = onnxruntime.InferenceSession(onnx_bytes(module, {"errors": {}, "dataset": {}} | meta))
    expected, _ = build(meta, arrays).evaluate(s, p)
    for W in (by_torch, session.run(["W"], inputs)[0]):
        sound = check(W, len(meta["rows"]["effectors"]))
        tolerance = 1e-5 if meta["kind"] == "mlp" else 1e-9  # float32 within; 1e-11 of the spoiled C is undecided
        size = max(np.abs(expected[sound]).max(), np.square(meta.get("modules", [meta])[0]["semidefinite"]).sum())
        np.testing.assert_allclose(W[sound], expected[sound], rtol=0, atol=tolerance * size)


@pytest.mark.skipif(compiler() is None, reason="there is no C compiler on the PATH")
@pytest.mark.parametrize("kind", fast_are({"spectral, force"}, ["spectral", "spectral, force", "mlp", "mlp, force"]))
def test_compiled(kind, tmp_path):
    made, sizes = MODELS[kind]
    meta, arrays = spoiled(*made(), sizes)
    export(tmp_path, (meta, arrays), scalar="double", full=True)
    controller, model = CompiledController(tmp_path), build(meta, arrays)
    s = states(meta["form"], 2, 50)
    W_ee = np.array([np.reshape(controller.model(one)["W_ee"], (3, 3)) for one in s])
    expected = model.evaluate(s)[0][:, :3, :3]
    tolerance = 1e-6 if meta["kind"] == "mlp" else 1e-12
    np.testing.assert_allclose(W_ee, expected, rtol=0, atol=tolerance * np.abs(expected).max())


def test_gradients_exist_where_eigenvalues_coincide():
    """Where a decomposition into eigenvectors has none."""
    meta, arrays = spoiled(*spectral("displacement"), SIZES)
    s = torch.as_tensor(states("displacement", 2, 5)).requires_grad_()
    module_of(meta, arrays)(s)[0].sum().backward()
    assert torch.isfinite(s.grad).all()


@pytest.mark.parametrize("k", [1, 3, 9])
def test_nearest_is_higham_s(k):
    """Among semidefinite matrices none is nearer: C's negative part alone goes (Higham 1988, theorem 2.1)."""
    rng = np.random.default_rng(k)
    A = rng.standard_normal((20, k, k))
    A = A + A.swapaxes(1, 2)
    found = nearest(A, np.ones(k))
    values = np.linalg.eigvalsh(A)
    np.testing.assert_allclose(
        np.linalg.norm(found - A, axis=(1, 2)), np.linalg.norm(np.minimum(values, 0), axis=1), atol=1e-9
    )
    assert np.linalg.eigvalsh(found).min() >= FLOOR - 1e-13 * k
    definite = A @ A + np.eye(k)
    assert nearest(definite, np.ones(k)) is definite
