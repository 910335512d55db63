"""The paper's network F: actuator displacements (or forces), and what tells one robot from another, to the entries of W
and delta_free, each learned on its own.

What tells the robots apart are their parameters, or, as in the paper, the entries of W and delta_free at rest, which
another model (the paper's G) gives of the parameters."""

import numpy as np

from cfem.condensed import entries, unpack_upper
from cfem.core.reading import take
from cfem.predict.array_predictor import ArrayPredictor, build
from cfem.predict.series.semidefinite import with_nearest


def _silu(x: np.ndarray) -> np.ndarray:
    return x / (1 + np.exp(-x))


ACTIVATIONS = {"relu": lambda x: np.maximum(x, 0), "tanh": np.tanh, "silu": _silu}


AT_REST = "at_rest."  # before the names of G's arrays


def rest_arrays(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """G's arrays, among those of a pair."""
    return {name.removeprefix(AT_REST): values for name, values in arrays.items() if name.startswith(AT_REST)}


def rest_entries(model: ArrayPredictor, q: np.ndarray) -> np.ndarray:
    """Entries (..., n (n + 3) / 2) of W (upper triangle) and delta_free by `model` at s = 0 and q (..., n_q)."""
    return entries(*model.learned(np.zeros((*q.shape[:-1], model.rows.n_a)), q))


class MlpPredictor(ArrayPredictor, kind="mlp"):
    """Predictor of the network of entries. Outputs are the packed upper triangle of W, then delta_free. meta: at_rest,
    model.json of G, where there is one. Its arrays:

    in_mean, in_scale: (n_a + k,) of s and of what is `beside` it
    out_mean, out_scale: of the outputs
    weight_i, bias_i: (outputs, inputs) and (outputs,) of layer i, float32 as trained
    those of G: behind AT_REST"""

    def __init__(self, meta: dict, arrays: dict[str, np.ndarray]):
        """Reads the layers, and demands that their shapes fit the model card."""
        super().__init__(meta)
        self._at_rest = build(meta["at_rest"], rest_arrays(arrays)) if meta.get("at_rest") else None
        self._activation = ACTIVATIONS[meta["activation"]]
        n, n_q = self.rows.n, len(self._learned)
        outputs = n * (n + 3) // 2
        beside = outputs if self._at_rest else n_q
        self._in, self._out = (
            tuple(take(arrays, f"{side}_{name}", (size,)).astype(float) for name in ("mean", "scale"))
            for side, size in (("in", self.rows.n_a + beside), ("out", outputs))
        )
        depth = max(sum(name.startswith("weight_") for name in arrays), 1)
        self._layers, inputs = [], self.rows.n_a + beside
        for i in range(depth):
            weight = take(arrays, f"weight_{i}", (outputs if i == depth - 1 else None, inputs))
            inputs = len(weight)
            # Transposed and contiguous: a row-vector product then streams each weight once.
            self._layers.append((np.ascontiguousarray(weight.T), take(arrays, f"bias_{i}", (inputs,))))

    def beside(self, q: np.ndarray) -> np.ndarray:
        """Inputs (..., k) beside s, from the coordinates (..., n_q) of the learned parameters."""
        return q if self._at_rest is None else rest_entries(self._at_rest, q)

    def learned(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """W (..., n, n) and delta_free (..., n) by the network at s (..., n_a) and q (..., n_q)."""
        mean, scale = self._in
        hidden = ((np.concatenate([s, self.beside(q)], axis=-1) - mean) / scale).astype(self._layers[0][0].dtype)
        for weight, bias in self._layers[:-1]:
            hidden = self._activation(hidden @ weight + bias)
        weight, bias = self._layers[-1]
        mean, scale = self._out
        out = (hidden @ weight + bias).astype(float) * scale + mean
        n = self.rows.n
        W = unpack_upper(out[..., :-n])
        return W if self.sizes is None else with_nearest(W, self.rows.n_e, self.sizes), out[..., -n:]
