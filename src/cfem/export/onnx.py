"""ONNX: one graph, delta_a (batch, n_a) mm -> W (batch, n, n), delta_free (batch, n), float64.

Units, rows, domain, errors and hashes travel in its metadata."""

import io
import json
import warnings
from typing import Any

import onnx
import torch
from torch import nn

OPSET = 17
CARD = (
    "scene",
    "kind",
    "rows",
    "units",
    "rest_e",
    "reach",
    "length",
    "domain",
    "errors",
    "dataset",
    "versions",
)


def onnx_bytes(model: nn.Module, meta: dict[str, Any]) -> bytes:
    """The checked graph of a torch model, with what model.json says as metadata_props (JSON text each)."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # The tracing exporter, which torch calls legacy: half the bytes of the newer one's graph, the same run time.
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.onnx.export(
            model,
            (example(meta),),
            buffer,
            dynamo=False,
            opset_version=OPSET,
            input_names=["delta_a"],
            output_names=["W", "delta_free"],
            dynamic_axes={"delta_a": {0: "batch"}, "W": {0: "batch"}, "delta_free": {0: "batch"}},
        )
    graph = onnx.load_from_string(buffer.getvalue())
    props = {key: meta[key] if isinstance(meta[key], str) else json.dumps(meta[key]) for key in CARD}
    onnx.helper.set_model_props(graph, {**props, "opset": str(OPSET)})
    onnx.checker.check_model(graph, full_check=True)
    return graph.SerializeToString()


def example(meta: dict[str, Any]) -> torch.Tensor:
    """(2, n_a) mm a batch inside the domain, for tracing."""
    return torch.tensor(meta["domain"]["delta_a"], dtype=torch.float64)
