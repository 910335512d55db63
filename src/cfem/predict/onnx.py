"""Any exported model through ONNX Runtime, on one thread."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.predict.protocol import Predictor

MAX_BYTES = 2**31 - 1  # protobuf's own limit


def checked_graph(path: Path) -> bytes:
    """The file, where it is a valid graph of standard operators, whole in itself: other domains are code of others, and
    tensors outside would be read from wherever the file says. Raises InputError."""
    import onnx

    where, do = str(path), "export it anew with --force"
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"is larger than {MAX_BYTES} bytes, which no ONNX file can be", where=where)
    data = path.read_bytes()
    try:
        model = onnx.load_model_from_string(data)
        domains = {node.domain for node in model.graph.node} | {one.domain for one in model.opset_import}
        tensors = [*model.graph.initializer, *(a.t for node in model.graph.node for a in node.attribute)]
        if model.functions or domains - {"", "ai.onnx"} or any(_is_outside(tensor) for tensor in tensors):
            what = "is not of standard operators and its own numbers alone"
            raise InputError(what, where=where, do=do)
        onnx.checker.check_model(model)
    except InputError:
        raise
    except Exception as error:  # protobuf's and the checker's, which share no base class
        reason = str(error).strip().splitlines()
        raise InputError(f"is no valid ONNX graph: {reason[0] if reason else error!r}", where=where, do=do) from None
    return data


def _is_outside(tensor: Any) -> bool:
    return bool(tensor.external_data) or tensor.data_location != 0


class OnnxPredictor(Predictor):
    """Inputs and outputs of the graph: delta_a or lambda_a (B, n_a) by the form, p (B, n_p) where it has parameters ->
    W (B, n, n), delta_free (B, n), float64."""

    def __init__(self, meta: dict, path: Path):
        import onnxruntime as ort

        super().__init__(meta)
        data = checked_graph(path)
        options = ort.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            self._session = ort.InferenceSession(data, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # ONNX Runtime's own exceptions share no base class of their own
            raise InputError(
                f"ONNX Runtime cannot load it: {error}", where=str(path), do="export it anew with --force"
            ) from error
        self._inputs = tuple(one.name for one in self._session.get_inputs())
        outputs = [one.name for one in self._session.get_outputs()]
        if len(self._inputs) != 1 + bool(self.parameters) or not {"W", "delta_free"} <= set(outputs):
            what = f"has inputs {', '.join(self._inputs)} and outputs {', '.join(outputs)}, which are not the model's"
            raise InputError(what, where=str(path), do="export it anew with --force")

    def evaluate(self, s: np.ndarray, p: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        s = np.asarray(s, float)
        inputs = {self._inputs[0]: s.reshape(-1, s.shape[-1])}
        if self.parameters:
            p = np.broadcast_to(self._p(p), (*s.shape[:-1], len(self.parameters)))
            inputs[self._inputs[1]] = np.ascontiguousarray(p.reshape(-1, p.shape[-1]))
        W, delta_free = self._session.run(["W", "delta_free"], inputs)
        return W.reshape(*s.shape[:-1], *W.shape[1:]), delta_free.reshape(*s.shape[:-1], -1)
