"""The paper's network F: actuator displacements (or forces) and parameters to the entries of W and delta_free, each
learned on its own."""

import numpy as np

from cfem.condensed import unpack_upper
from cfem.predict.protocol import ArrayPredictor


def _silu(x: np.ndarray) -> np.ndarray:
    return x / (1 + np.exp(-x))


ACTIVATIONS = {"relu": lambda x: np.maximum(x, 0), "tanh": np.tanh, "silu": _silu}


class MlpPredictor(ArrayPredictor):
    """arrays: in_mean, in_scale (n_a + n_q,) of s and the learned parameters' coordinates; out_mean, out_scale (k,);
    weight_i (outputs, inputs) and bias_i of layer i, float32 as trained. Outputs are the packed upper triangle of W,
    then delta_free."""

    def __init__(self, meta: dict, arrays: dict[str, np.ndarray]):
        super().__init__(meta)
        self._activation = ACTIVATIONS[meta["activation"]]
        self._in, self._out = (
            (arrays[f"{side}_mean"].astype(float), arrays[f"{side}_scale"].astype(float)) for side in ("in", "out")
        )
        depth = sum(name.startswith("weight_") for name in arrays)
        # Transposed and contiguous: a row-vector product then streams each weight once.
        self._layers = [(np.ascontiguousarray(arrays[f"weight_{i}"].T), arrays[f"bias_{i}"]) for i in range(depth)]

    def learned(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        mean, scale = self._in
        hidden = ((np.concatenate([s, q], axis=-1) - mean) / scale).astype(self._layers[0][0].dtype)
        for weight, bias in self._layers[:-1]:
            hidden = self._activation(hidden @ weight + bias)
        weight, bias = self._layers[-1]
        mean, scale = self._out
        out = (hidden @ weight + bias).astype(float) * scale + mean
        n = self.rows.n
        return unpack_upper(out[..., :-n]), out[..., -n:]
