"""The energy model as Chebyshev series: the potential, the effector map e and the effectors' compliance C.

A series can be differentiated once and for all, so the folder holds the coefficients of every derivative that W and
delta_free need, and a query is one evaluation of the basis and one product with `series`: value, gradient and Hessian
in one pass."""

import numpy as np

from cfem.predict.chebyshev import basis
from cfem.predict.energy import Parts, Splitter
from cfem.predict.potential import PotentialPredictor


class SpectralPredictor(PotentialPredictor):
    """arrays: to_box (n, n) and offset (n,) with z = to_box t + offset in [-1, 1] on the data, t = (s, q) the inputs of
    the form and the coordinates of the learned parameters; indices (M, n) degrees of the basis functions; series
    (n_out, M) as `cfem.predict.energy.layout`."""

    def __init__(self, meta: dict, arrays: dict[str, np.ndarray]):
        super().__init__(meta)
        self._to_box_T, self._offset = np.ascontiguousarray(arrays["to_box"].T), arrays["offset"]
        self._indices, self._series_T = arrays["indices"], np.ascontiguousarray(arrays["series"].T)
        self._split = Splitter(self.rows.n_a, self.rows.n_e)

    def parts(self, s: np.ndarray, q: np.ndarray) -> Parts:
        """(..., n_a), (..., n_q) -> the potential, its gradient, ...: every part of `layout`, matrices in full."""
        t = np.concatenate([s, q], axis=-1) if q.shape[-1] else s
        return self._split(basis(t @ self._to_box_T + self._offset, self._indices) @ self._series_T)
