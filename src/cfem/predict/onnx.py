"""Any exported model through ONNX Runtime, on one thread."""

from pathlib import Path

import numpy as np

from cfem.core.errors import InputError
from cfem.predict.protocol import Predictor


class OnnxPredictor(Predictor):
    """Inputs and outputs of the graph: delta_a or lambda_a (B, n_a) by the form, p (B, n_p) where it has parameters ->
    W (B, n, n), delta_free (B, n), float64."""

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
        self._inputs = tuple(one.name for one in self._session.get_inputs())

    def evaluate(self, s: np.ndarray, p: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        s = np.asarray(s, float)
        inputs = {self._inputs[0]: s.reshape(-1, s.shape[-1])}
        if self.parameters:
            p = np.broadcast_to(self._p(p), (*s.shape[:-1], len(self.parameters)))
            inputs[self._inputs[1]] = np.ascontiguousarray(p.reshape(-1, p.shape[-1]))
        W, delta_free = self._session.run(["W", "delta_free"], inputs)
        return W.reshape(*s.shape[:-1], *W.shape[1:]), delta_free.reshape(*s.shape[:-1], -1)
