"""The energy model as Chebyshev series: the potential, the effector map e and the effectors' compliance C.

A series can be differentiated once and for all, so the folder holds the coefficients of every derivative that W and
delta_free need, and a query is one evaluation of the basis and one product with `series`: value, gradient and Hessian
in one pass."""

from functools import cached_property

import numpy as np

from cfem.condensed import Condensed
from cfem.condensed.packing import unpacking
from cfem.core.errors import InputError
from cfem.core.reading import take
from cfem.predict.array_predictor import ArrayPredictor
from cfem.predict.series.chebyshev import Basis
from cfem.predict.series.energy import Parts, Splitter, condense, layout

LARGEST_DEGREE = 255  # what a byte of the C export holds


class SpectralPredictor(ArrayPredictor, kind="spectral"):
    """Predictor of Chebyshev series. Its arrays:

    to_box, offset: (n, n) and (n,) with z = to_box t + offset in [-1, 1] on the data, t = (s, q) the inputs of the form
    and the coordinates of the learned parameters
    indices: (M, n) degrees of the basis functions
    series: (n_out, M) as `cfem.predict.series.energy.layout`"""

    def __init__(self, meta: dict, arrays: dict[str, np.ndarray]):
        """Reads the arrays, and demands that their shapes fit the model card."""
        super().__init__(meta)
        n_a, n_e, n = self.rows.n_a, self.rows.n_e, self.n_inputs
        indices = take(arrays, "indices", (None, n), "iu")
        if indices.min() < 0 or indices.max() > LARGEST_DEGREE:
            raise InputError(f"array 'indices' holds degrees that are not between 0 and {LARGEST_DEGREE}")
        self.arrays = arrays
        outputs = layout(n_a, n_e)["effector_compliance"].stop
        self._to_box_T = np.ascontiguousarray(take(arrays, "to_box", (n, n)).T)
        self._offset = take(arrays, "offset", (n,))
        self._basis = Basis(indices)
        self._series_T = np.ascontiguousarray(take(arrays, "series", (outputs, len(indices))).T)
        self._split = Splitter(self.rows.n_a, self.rows.n_e)

    def basis(self, t: np.ndarray) -> np.ndarray:
        """Values (..., M) of the basis at inputs (..., n)."""
        return self._basis(self.box(t))

    def box(self, t: np.ndarray) -> np.ndarray:
        """Box coordinates (..., n) of inputs (..., n)."""
        return t @ self._to_box_T + self._offset

    def parts(self, s: np.ndarray, q: np.ndarray) -> Parts:
        """Every part of `layout` at inputs s (..., n_a) and parameters q (..., n_q): the potential, its gradient and so
        on, matrices in full."""
        t = np.concatenate([s, q], axis=-1) if q.shape[-1] else s
        return self._split(self.basis(t) @ self._series_T)

    def learned(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return condense(self.form, self.rows, s, self.parts(s, q), self.sizes)

    def at(self, s: np.ndarray, p: np.ndarray | None = None) -> Condensed:
        if self.parameters:
            return super().at(s, p)
        s = np.asarray(s, float)
        part = self.parts(s, s[..., :0])  # whose gradient is what the condensed model would be solved for
        W, delta_free = condense(self.form, self.rows, s, part, self.sizes)
        return Condensed(self.rows, W, delta_free, s if self.form == "force" else part["gradient"])

    def ends_at_displacement(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if self.parameters or self.form == "force":
            return super().ends_at_displacement(delta_a)
        self._demand_near(delta_a, *self.domain.delta_a, "displacements", 0)
        part = self.parts(delta_a, delta_a[:0])
        return part["effector"], part["gradient"]

    def slopes(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces lambda_a (B, n_a) and d lambda_a / d delta_a (B, n_a, n_a) at delta_a (B, n_a) mm and the scene's own
        parameters, for users who need nothing of the effectors."""
        if self.parameters or self.form == "force":
            states = [self.at_displacement(delta) for delta in delta_a]
            return np.array([state.lam for state in states]), np.array([np.linalg.inv(state.W_aa) for state in states])
        return self.gradient_and_hessian(delta_a)

    def gradient_and_hessian(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gradient (..., n_a) and Hessian (..., n_a, n_a) of the potential at s (..., n_a) and the
        scene's own parameters."""
        basis, slopes_T = self._slopes
        slopes = basis(s @ self._to_box_T + self._offset) @ slopes_T
        n = self.rows.n_a
        return slopes[..., :n], slopes[..., n:][..., self._unpack]

    @cached_property
    def _slopes(self) -> tuple[Basis, np.ndarray]:
        """The potential's terms, which are fewer than the effectors', and their columns of the gradient and of the
        Hessian, which follow each other."""
        rows = layout(self.rows.n_a, self.rows.n_e)
        slopes_T = self._series_T[:, rows["gradient"].start : rows["hessian"].stop]
        kept = slopes_T.any(axis=1)
        return Basis(self._basis.indices[kept]), np.ascontiguousarray(slopes_T[kept])

    @cached_property
    def _unpack(self) -> np.ndarray:
        return unpacking(self.rows.n_a)
