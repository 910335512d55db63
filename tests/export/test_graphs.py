"""ONNX and TorchScript of every kind and form: the function of NumPy, in the runtimes that others have."""

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from export.embedded import network, serial, spectral, states
from surrogate.synthetic import dataset

from cfem.export.onnx import OPSET, example, onnx_bytes
from cfem.export.torchscript import torchscript_bytes
from cfem.predict.load import build
from cfem.surrogate.model_card import model_card
from cfem.surrogate.modules import module_of


def network_of_forces() -> tuple[dict, dict]:
    _, arrays = network("silu")
    return model_card("mlp", dataset(60, 1), "force", activation="silu"), arrays


MODELS = {
    "spectral, displacement": lambda: spectral("displacement"),
    "spectral, force": lambda: spectral("force"),
    "spectral, robots": lambda: spectral("displacement", 2, True),
    "mlp, displacement": network,
    "mlp, force": network_of_forces,
    "serial": serial,
}


@pytest.fixture(scope="module", params=MODELS, ids=str)
def model(request):
    meta, arrays = MODELS[request.param]()
    meta = {"errors": {}, "dataset": {}} | meta
    module = module_of(meta, arrays)
    names = meta["rows"]["actuators"]
    s = states(meta["form"], len(names), 7, parameters=bool(meta["parameters"]))
    inputs = {{"displacement": "delta_a", "force": "lambda_a"}[meta["form"]]: s}
    if meta["parameters"]:
        inputs["p"] = np.tile([[0.44, 2.0]], (len(s), 1))
    expected = build(meta, arrays).evaluate(s, inputs.get("p"))
    return meta, module, inputs, expected


def difference(found, expected) -> float:
    """Relative to the largest entry."""
    return max(np.abs(one - other).max() / np.abs(other).max() for one, other in zip(found, expected, strict=True))


def tolerance(meta: dict) -> float:
    return 1e-5 if meta["kind"] == "mlp" else 1e-10  # float32 within


def test_onnx_runtime_runs_it_as_it_comes(model):
    """No option set, batches of any size, the opset as stated, operators of the standard alone."""
    meta, module, inputs, expected = model
    data = onnx_bytes(module, meta)
    graph = onnx.load_model_from_string(data)
    assert {one.domain: one.version for one in graph.opset_import} == {"": OPSET}
    session = onnxruntime.InferenceSession(data)
    assert difference(session.run(["W", "delta_free"], inputs), expected) <= tolerance(meta)
    one = session.run(["W", "delta_free"], {name: values[:1] for name, values in inputs.items()})
    assert difference(one, [values[:1] for values in expected]) <= tolerance(meta)


@pytest.mark.filterwarnings("ignore:.*torch.jit:DeprecationWarning")
def test_torchscript_is_the_same_function(model, tmp_path):
    meta, module, inputs, expected = model
    (tmp_path / "model.ts").write_bytes(torchscript_bytes(module, example(meta)))
    found = torch.jit.load(tmp_path / "model.ts")(*map(torch.as_tensor, inputs.values()))
    assert difference([one.detach().numpy() for one in found], expected) <= tolerance(meta)
