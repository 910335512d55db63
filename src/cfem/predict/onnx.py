"""Any exported model through ONNX Runtime, on one thread."""

from pathlib import Path

import numpy as np

from cfem.core.errors import InputError
from cfem.predict.protocol import Predictor


class OnnxPredictor(Predictor):
    """Inputs and outputs of the graph: delta_a (B, n_a) -> W (B, n, n), delta_free (B, n), float64."""

    def __init__(self, meta: dict, path: Path):
        import onnxruntime as ort

        super().__init__(meta)
        options = ort.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            self._session = ort.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        except Exception as error:  # ONNX Runtime's own exceptions share no base class of their own
            raise InputError(
                f"ONNX Runtime cannot load it: {error}", where=str(path), do="export it anew with --force"
            ) from error

    def evaluate(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        W, delta_free = self._session.run(["W", "delta_free"], {"delta_a": delta_a})
        return W, delta_free
