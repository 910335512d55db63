"""How inner motions move a robot's rows, effectors and modes of its skin: series of the actuators' displacements."""

import numpy as np

from cfem.core.errors import InputError
from cfem.core.reading import take
from cfem.predict.series.chebyshev import Basis
from cfem.predict.series.derivatives import input_derivatives
from cfem.predict.series.modes import joined


class InnerSkin:
    """What inner motions do to the modes of the skin: k modes, n_r inner motions.

    arrays: of motion.npz: to_box (n_a, n_a) and offset (n_a,) of the model's inputs; indices (M, n_a); skin_indices (L,
    n_a) and skin (k n_r, L), series of what the inner motions do to the modes, row by row; H (n_e n_r, M): the same of
    the effectors; T (r, n_e + k): a fixed map of effectors, then modes
    modes: k
    parts: indices, and a series for each row and each inner motion, row by row"""

    def __init__(self, arrays: dict[str, np.ndarray], H: np.ndarray, n_r: int, T: np.ndarray | None = None):
        """Reads the series of the skin beside those of the effectors, H; T: map of both."""
        to_box, n_e = arrays["to_box"], len(H) // n_r
        n_a = len(to_box)
        skin_indices = take(arrays, "skin_indices", (None, n_a), "iu").astype(np.int64)
        series = take(arrays, "skin", (None, len(skin_indices)))
        if len(series) % n_r:
            raise InputError(f"array 'skin' has {len(series)} rows, not so many for each of {n_r} inner motions")
        self.modes, self._given = len(series) // n_r, (arrays, H, n_r)
        paths = np.vstack([H, np.zeros((len(series), H.shape[1]))])
        skin = np.vstack([np.zeros((len(H), len(skin_indices))), series])
        indices, rows = joined([(arrays["indices"], paths), (skin_indices, skin)])
        series = rows.sum(axis=0)
        if T is not None:
            series = (T @ series.reshape(n_e + self.modes, -1)).reshape(-1, len(indices))
        self.parts = indices, series
        slopes = [D @ series.T for D in input_derivatives(indices, to_box, n_a)]
        self._series = np.stack([series.T, *slopes], axis=1).reshape(len(indices), -1)
        self._to_box_T, self._offset, self._basis = to_box.T.copy(), arrays["offset"], Basis(indices)
        self._shape = (1 + n_a, len(series) // n_r, n_r)

    def mapped(self, T: np.ndarray) -> "InnerSkin":
        """Skin of a map T (r, n_e + k) of effectors, then modes."""
        return InnerSkin(*self._given, T)

    def __call__(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Motions (r, n_r) mm by the amplitudes at delta_a (n_a,) mm, and their derivatives (n_a, r, n_r) by
        delta_a."""
        values = (self._basis(delta_a @ self._to_box_T + self._offset) @ self._series).reshape(self._shape)
        return values[0], values[1:]
