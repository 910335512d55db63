"""ONNX: one graph, delta_a (batch, n_a) mm or lambda_a (batch, n_a) N by the model's form, and p (batch, n_p) where the
model has parameters -> W (batch, n, n), delta_free (batch, n), float64.

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
    "form",
    "parameters",
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


def onnx_bytes(model: nn.Module, meta: dict[str, Any], outputs: tuple[str, ...] = ("W", "delta_free")) -> bytes:
    """The checked graph of a torch model, with what model.json says as metadata_props (JSON text each)."""
    buffer = io.BytesIO()
    names = [{"displacement": "delta_a", "force": "lambda_a"}[meta["form"]], "p"][: len(example(meta))]
    with warnings.catch_warnings():
        # The tracing exporter, which torch calls legacy: half the bytes of the newer one's graph, the same run time.
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.onnx.export(
            model,
            example(meta),
            buffer,
            dynamo=False,
            opset_version=OPSET,
            input_names=names,
            output_names=list(outputs),
            dynamic_axes={name: {0: "batch"} for name in (*names, *outputs)},
        )
    graph = onnx.load_from_string(buffer.getvalue())
    props = {key: meta[key] if isinstance(meta[key], str) else json.dumps(meta[key]) for key in CARD}
    onnx.helper.set_model_props(graph, {**props, "opset": str(OPSET)})
    onnx.checker.check_model(graph, full_check=True)
    return graph.SerializeToString()


def example(meta: dict[str, Any]) -> tuple[torch.Tensor, ...]:
    """Inputs inside the domain, a batch of two, for tracing: s (2, n_a), and p (2, n_p) where the model has any."""
    s = torch.tensor(meta["domain"]["delta_a" if meta["form"] == "displacement" else "lambda_a"], dtype=torch.float64)
    p = torch.tensor([[parameter["low"], parameter["high"]] for parameter in meta["parameters"]], dtype=torch.float64)
    return (s, p.T.contiguous()) if meta["parameters"] else (s,)
