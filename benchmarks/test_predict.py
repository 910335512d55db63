"""Time of one query (W and delta_free at one displacement) by kind and runtime, side by side in one run.

`python -m pytest benchmarks/test_predict.py`; the networks have the paper's size and random weights."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from surrogate.stored import train_folder  # noqa: E402

from cfem.core.stage import Options  # noqa: E402
from cfem.export.stage import run  # noqa: E402
from cfem.predict.load import load_model, read_arrays, read_meta  # noqa: E402
from cfem.surrogate.modules import module_of  # noqa: E402

MODELS = {"spectral": "{kind: spectral, max_degree: 12}", "mlp": "{kind: mlp, epochs: 1}"}
QUERY = np.array([8.0, 9.0])  # mm


@pytest.fixture(scope="module", params=MODELS)
def exported(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    train_folder(folder, MODELS[request.param], train=40)
    (folder / "export.yaml").write_text("model: model\nout: export\nformats: [arrays, onnx]\n")
    run(folder / "export.yaml", [], None, Options())
    return request.param, folder / "export"


@pytest.mark.parametrize("runtime", ["arrays", "onnx"])
def test_predictor(benchmark, exported, runtime):
    kind, folder = exported
    benchmark.group = kind
    benchmark(load_model(folder, runtime).at_displacement, QUERY)


def test_torch_eager(benchmark, exported):
    kind, folder = exported
    benchmark.group = kind
    model, query = module_of(read_meta(folder), read_arrays(folder)), torch.as_tensor(QUERY[None])
    with torch.inference_mode():
        benchmark(model, query)


@pytest.mark.parametrize("exported", ["spectral"], indirect=True)
def test_observer_by_equilibrium(benchmark, exported):
    kind, folder = exported
    benchmark.group = kind
    model = load_model(folder)
    lambda_a = model.at_displacement(QUERY).lambda_a
    benchmark(model.at_force, lambda_a)
