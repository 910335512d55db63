"""The series of an energy model: every derivative that W and delta_free need, from the three that are independent."""

import numpy as np
from scipy.sparse import csr_array


def differentiated(
    indices: np.ndarray, to_box: np.ndarray, n_a: int, psi: np.ndarray, e: np.ndarray, compliance: np.ndarray
) -> np.ndarray:
    """Coefficients (n_out, M) of every part of `cfem.predict.series.energy.layout`, derivatives by the first n_a
    inputs, from those of the potential psi (M, 1), the effectors e (M, n_e) and the packed compliance (M, n_e (n_e + 1)
    / 2); indices (M, n); to_box (n, n) as in `cfem.predict.kinds.spectral`."""
    by_s = input_derivatives(indices, to_box, n_a)
    psi_i = [D_i @ psi for D_i in by_s]
    psi_ij = [by_s[j] @ psi_i[i] for i in range(n_a) for j in range(i, n_a)]
    e_i = np.stack([D_i @ e for D_i in by_s], axis=-1)  # (M, n_e, n_a)
    return np.hstack([psi, *psi_i, *psi_ij, e, e_i.reshape(len(indices), -1), compliance]).T.copy()


def input_derivatives(indices: np.ndarray, to_box: np.ndarray, n_a: int) -> list[csr_array]:
    """Matrices (M, M) of d/ds_i of a series, i < n_a: s_i moves the box coordinates by column i of to_box."""
    D = derivative_matrices(indices)
    return [sum(to_box[j, i] * D[j] for j in range(n_a)) for i in range(n_a)]


def derivative_matrices(indices: np.ndarray) -> list[csr_array]:
    """One (M, M) matrix an axis, with d/dz_i basis(z) = basis(z) @ D_i: column k holds the series of d T_k / dz_i.

    T_k' = 2 k (T_{k-1} + T_{k-3} + ...), the term T_0 halved. `indices` holds with every k all smaller ones."""
    position = {tuple(k): number for number, k in enumerate(indices.tolist())}
    matrices = []
    for axis in range(indices.shape[1]):
        entries, at_rows, at_columns = [], [], []
        for k, column in position.items():
            for lower in range(k[axis] - 1, -1, -2):
                at_rows.append(position[(*k[:axis], lower, *k[axis + 1 :])])
                at_columns.append(column)
                entries.append((2.0 if lower else 1.0) * k[axis])
        matrices.append(csr_array((entries, (at_rows, at_columns)), shape=(len(indices), len(indices))))
    return matrices
