"""How inner motions move the skin: its modes, as `MotionModel.H` has the effectors."""

import numpy as np

from cfem.core.errors import InputError
from cfem.core.reading import take
from cfem.predict.chebyshev import Basis
from cfem.predict.series import input_derivatives


class InnerSkin:
    """arrays: of motion.npz: to_box (n_a, n_a) and offset (n_a,) of the model's inputs, skin_indices (L, n_a) and skin
    (k n_r, L), series of what n_r inner motions do to k modes, row by row; T (r, k): a fixed map of the modes, the
    modes themselves unless given."""

    def __init__(self, arrays: dict[str, np.ndarray], n_r: int, T: np.ndarray | None = None):
        to_box = arrays["to_box"]
        n_a = len(to_box)
        indices = take(arrays, "skin_indices", (None, n_a), "iu").astype(np.int64)
        series = take(arrays, "skin", (None, len(indices)))
        if not len(series) or len(series) % n_r:
            raise InputError(f"array 'skin' has {len(series)} rows, not so many for each of {n_r} inner motions")
        series, self._arrays = series.reshape(-1, n_r * len(indices)), arrays
        self.modes = len(series)
        series = (series if T is None else T @ series).reshape(-1, len(indices))
        slopes = [D @ series.T for D in input_derivatives(indices, to_box, n_a)]
        self._series = np.stack([series.T, *slopes], axis=1).reshape(len(indices), -1)
        self._to_box_T, self._offset, self._basis = to_box.T, arrays["offset"], Basis(indices)
        self._shape = (1 + n_a, len(series) // n_r, n_r)

    def mapped(self, T: np.ndarray) -> "InnerSkin":
        """Of a map T (r, k) of the modes."""
        return InnerSkin(self._arrays, self._shape[2], T)

    def __call__(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n_a,) mm -> motions (r, n_r) mm by the amplitudes, and their derivatives (n_a, r, n_r) by delta_a."""
        found = (self._basis(delta_a @ self._to_box_T + self._offset) @ self._series).reshape(self._shape)
        return found[0], found[1:]
