"""The energy model: one scalar Psi, the effector map e and the locked compliance C_ee, as Chebyshev series.

A series can be differentiated once and for all, so the folder holds the coefficients of every derivative that W and
delta_free need, and a query is one evaluation of the basis and one product with `series`."""

import numpy as np

from cfem.condensed import Condensed
from cfem.condensed.packing import upper_indices
from cfem.core.errors import NumericalError
from cfem.predict.chebyshev import basis
from cfem.predict.protocol import Predictor


def layout(n_a: int, n_e: int) -> dict[str, slice]:
    """Rows of `series`: Psi, its gradient and Hessian, e, grad e (row-major), C_ee; matrices as upper triangle."""
    sizes = {
        "energy": 1,
        "gradient": n_a,
        "hessian": n_a * (n_a + 1) // 2,
        "effector": n_e,
        "effector_gradient": n_e * n_a,
        "locked_compliance": n_e * (n_e + 1) // 2,
    }
    ends = np.cumsum(list(sizes.values()))
    return {name: slice(int(end - size), int(end)) for (name, size), end in zip(sizes.items(), ends, strict=True)}


def unpacking(n: int) -> np.ndarray:
    """(n, n) position of each entry of a symmetric matrix in its packed upper triangle."""
    position = np.empty((n, n), dtype=np.int64)
    rows, columns = upper_indices(n)
    position[rows, columns] = position[columns, rows] = np.arange(len(rows))
    return position


class SpectralPredictor(Predictor):
    """arrays: to_box (n_a, n_a) 1/mm and offset (n_a,) with z = to_box delta_a + offset in [-1, 1] on the data;
    indices (M, n_a) degrees of the basis functions; series (n_out, M) as `layout`."""

    def __init__(self, meta: dict, arrays: dict[str, np.ndarray]):
        super().__init__(meta)
        self._to_box_T, self._offset = np.ascontiguousarray(arrays["to_box"].T), arrays["offset"]
        self._indices, self._series_T = arrays["indices"], np.ascontiguousarray(arrays["series"].T)
        self._rows_of = layout(self.rows.n_a, self.rows.n_e)
        self._unpack_a, self._unpack_e = unpacking(self.rows.n_a), unpacking(self.rows.n_e)

    def parts(self, delta_a: np.ndarray) -> dict[str, np.ndarray]:
        """(..., n_a) mm -> Psi, its gradient, ...: every part of `layout`, matrices in full."""
        out = basis(delta_a @ self._to_box_T + self._offset, self._indices) @ self._series_T
        part = {name: out[..., rows] for name, rows in self._rows_of.items()}
        part["hessian"] = part["hessian"][..., self._unpack_a]
        part["locked_compliance"] = part["locked_compliance"][..., self._unpack_e]
        part["effector_gradient"] = part["effector_gradient"].reshape(*out.shape[:-1], self.rows.n_e, self.rows.n_a)
        return part

    def evaluate(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._condense(delta_a, self.parts(delta_a))

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        delta_a = np.asarray(delta_a, float)
        part = self.parts(delta_a)
        return Condensed(self.rows, *self._condense(delta_a, part), part["gradient"])

    def at_force(self, lambda_a: np.ndarray, start: np.ndarray | None = None, tolerance: float = 1e-10) -> Condensed:
        """The condensed robot under lambda_a (n_a,) N: Newton on grad Psi(delta_a) = lambda_a, with step halving.

        start: (n_a,) mm, else the middle of the domain; tolerance: relative to the domain's largest multiplier.
        Raises NumericalError where no such displacement is found."""
        delta_a = self.domain.delta_a.mean(axis=0) if start is None else np.asarray(start, float)
        scale = np.abs(self.domain.lambda_a).max()
        part = self.parts(delta_a)
        missing = lambda_a - part["gradient"]
        for _ in range(50):
            if np.linalg.norm(missing) <= tolerance * scale:
                return Condensed(self.rows, *self._condense(delta_a, part), part["gradient"])
            step = np.linalg.solve(part["hessian"], missing)
            for share in 0.5 ** np.arange(12):
                trial = self.parts(delta_a + share * step)
                left = lambda_a - trial["gradient"]
                if np.linalg.norm(left) < np.linalg.norm(missing):
                    break
            delta_a, part, missing = delta_a + share * step, trial, left
        raise NumericalError(
            f"no displacement carries the multipliers {np.asarray(lambda_a).tolist()}: "
            f"{np.linalg.norm(missing):.2g} N are left",
            do="ask inside the model's domain",
        )

    def _condense(self, delta_a: np.ndarray, part: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """W_aa = (hess Psi)^-1, W_ea = grad e W_aa, W_ee = C_ee + grad e W_aa grad e^T,
        delta_free = delta - W[:, a] grad Psi."""
        e, a, n = self.rows.e, self.rows.a, self.rows.n
        gradient_e = part["effector_gradient"]
        W = np.empty((*delta_a.shape[:-1], n, n))
        W[..., a, a] = W_aa = np.linalg.inv(part["hessian"])
        W[..., e, a] = W_ea = gradient_e @ W_aa
        W[..., a, e] = W_ea.swapaxes(-1, -2)
        W[..., e, e] = part["locked_compliance"] + W_ea @ gradient_e.swapaxes(-1, -2)
        delta_free = np.concatenate([part["effector"], delta_a], axis=-1)
        delta_free -= (W[..., a] @ part["gradient"][..., None])[..., 0]
        return W, delta_free
