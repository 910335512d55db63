"""The energy model as networks of sines: the potential, the effector map e and the effectors' compliance C.

A network's derivatives by its inputs go through its layers beside its value: for h = sin a, h_i = cos a a_i and
h_ij = cos a a_ij - sin a a_i a_j. What the output layers make of the inputs alone is a polynomial of degree 2, whose
derivatives are polynomials as well: one product with `polynomial` gives those of all quantities."""

import numpy as np

from cfem.core.reading import take
from cfem.predict.kinds.potential import PotentialPredictor
from cfem.predict.series.energy import Parts, Splitter, layout

# quantity: highest order of its derivatives by s in `cfem.predict.series.energy.layout`
ORDERS = {"potential": 2, "effector": 1, "effector_compliance": 0}


class EnergyNetPredictor(PotentialPredictor, kind="energy_net"):
    """Predictor of networks of sines. Its arrays:

    to_box, offset: (n, n) and (n,) with z = to_box t + offset in [-1, 1] on the data, t = (s, q) the inputs of the form
    and the coordinates of the learned parameters
    polynomial: (1 + n + n (n + 1) / 2, n_out) coefficients of 1, z_i and z_i z_j, i <= j, in the order of `layout`
    quantity_weight_i, quantity_bias_i: (width, inputs) and (width,) of hidden layer i of each quantity
    quantity_output: (width, outputs)"""

    def __init__(self, meta: dict, arrays: dict[str, np.ndarray]):
        """Reads the arrays, and demands that their shapes fit the model card."""
        super().__init__(meta)
        n_a, n_e, n = self.rows.n_a, self.rows.n_e, self.n_inputs
        outputs = layout(n_a, n_e)["effector_compliance"].stop
        self._to_box_T = np.ascontiguousarray(take(arrays, "to_box", (n, n)).T)
        self._offset = take(arrays, "offset", (n,))
        self._polynomial = take(arrays, "polynomial", (1 + n + n * (n + 1) // 2, outputs))
        self._products = np.triu_indices(len(self._offset))
        sizes = {"potential": 1, "effector": n_e, "effector_compliance": n_e * (n_e + 1) // 2}
        self._networks = [SineNetwork(name, arrays, order, n_a, sizes[name]) for name, order in ORDERS.items()]
        self._split = Splitter(n_a, self.rows.n_e)

    def parts(self, s: np.ndarray, q: np.ndarray) -> Parts:
        """Every part of `layout` at inputs s (..., n_a) and parameters q (..., n_q): the potential, its gradient and so
        on, matrices in full."""
        t = np.concatenate([s, q], axis=-1) if q.shape[-1] else s
        z = t @ self._to_box_T + self._offset
        first, second = self._products
        terms = np.concatenate([np.ones_like(z[..., :1]), z, z[..., first] * z[..., second]], axis=-1)
        sines = np.concatenate([network(z) for network in self._networks], axis=-1)
        return self._split(terms @ self._polynomial + sines)


class SineNetwork:
    """The part of one quantity that its hidden units make, with its derivatives by s up to an order."""

    def __init__(self, name: str, arrays: dict[str, np.ndarray], order: int, n_a: int, outputs: int):
        """Reads the layers of one quantity. order: of the derivatives by s that are wanted, 0 to 2."""
        self._n, self._order = (n_a if order else 0), order
        self._first, self._second = np.triu_indices(n_a if order == 2 else 0)
        depth = max(sum(key.startswith(f"{name}_weight_") for key in arrays), 1)
        weights, width = [], len(arrays["to_box"])
        for i in range(depth):
            weights.append(take(arrays, f"{name}_weight_{i}", (None, width)))
            width = len(weights[-1])
        self._biases = [take(arrays, f"{name}_bias_{i}", (len(weight),)) for i, weight in enumerate(weights)]
        self._inner_T = [np.ascontiguousarray(weight.T) for weight in weights]
        self._output = take(arrays, f"{name}_output", (width, outputs))
        self._slopes = (weights[0] @ arrays["to_box"][:, : self._n]).T.copy()  # (n, width) d a_1 / d s_i
        self._slope_products = self._slopes[self._first] * self._slopes[self._second]

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Values and derivatives (..., outputs) at inputs (..., n), the value first; grad e row by row."""
        a = z @ self._inner_T[0] + self._biases[0]
        sine, cosine = np.sin(a)[..., None, :], np.cos(a)[..., None, :]
        rows = np.concatenate([sine, cosine * self._slopes, -sine * self._slope_products], axis=-2)
        n = 1 + self._n
        for inner, bias in zip(self._inner_T[1:], self._biases[1:], strict=True):
            rows = rows @ inner
            a = rows[..., :1, :] + bias
            sine, cosine = np.sin(a), np.cos(a)
            by_s = rows[..., 1:n, :]
            curved = cosine * rows[..., n:, :] - sine * by_s[..., self._first, :] * by_s[..., self._second, :]
            rows = np.concatenate([sine, cosine * by_s, curved], axis=-2)
        out = rows @ self._output  # (..., derivatives, outputs)
        by_s = out[..., 1:n, :].swapaxes(-1, -2)
        parts = (out[..., 0, :], by_s.reshape(*out.shape[:-2], -1), out[..., n:, :].reshape(*out.shape[:-2], -1))
        return np.concatenate(parts, axis=-1)
