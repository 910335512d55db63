"""3 x 3 matrices in compiled kernels. D = F - 1 is the displacement gradient, from which small strains keep digits."""

import numpy as np
from numba import njit


@njit(cache=True)
def cofactor(M: np.ndarray, out: np.ndarray) -> None:
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            out[i, j] = M[i1, j1] * M[i2, j2] - M[i1, j2] * M[i2, j1]


@njit(cache=True)
def inverse(M: np.ndarray, out: np.ndarray) -> float:
    """Writes the inverse of M, or zeros where M is singular; returns det M."""
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            out[j, i] = M[i1, j1] * M[i2, j2] - M[i1, j2] * M[i2, j1]
    det = M[0, 0] * out[0, 0] + M[0, 1] * out[1, 0] + M[0, 2] * out[2, 0]
    scale = 0.0 if det == 0.0 else 1.0 / det
    for i in range(3):
        for j in range(3):
            out[i, j] *= scale
    return det


@njit(cache=True)
def add_identity(D: np.ndarray, F: np.ndarray) -> None:
    for i in range(3):
        for j in range(3):
            F[i, j] = D[i, j] + (1.0 if i == j else 0.0)


@njit(cache=True)
def rotation(D: np.ndarray, R: np.ndarray) -> None:
    """Writes the rotation of 1 + D, by Newton's iteration R <- (R + R^-T) / 2 (Higham, SIAM J. Sci. Stat. Comput. 7,
    1986)."""
    R_inverse = np.empty((3, 3))
    add_identity(D, R)
    for _ in range(60):
        if inverse(R, R_inverse) == 0.0:
            return
        change = 0.0
        for i in range(3):
            for j in range(3):
                new = 0.5 * (R[i, j] + R_inverse[j, i])
                change = max(change, abs(new - R[i, j]))
                R_inverse[j, i] = new
        for i in range(3):
            for j in range(3):
                R[i, j] = R_inverse[j, i]
        if change < 1e-8:  # of which the square is left
            return


@njit(cache=True)
def volume_change(D: np.ndarray, cof_D: np.ndarray) -> tuple[float, float]:
    """The two parts tr D and tr cof D + det D of J - 1; fills cof D."""
    cofactor(D, cof_D)
    trace = D[0, 0] + D[1, 1] + D[2, 2]
    det = D[0, 0] * cof_D[0, 0] + D[0, 1] * cof_D[0, 1] + D[0, 2] * cof_D[0, 2]
    return trace, cof_D[0, 0] + cof_D[1, 1] + cof_D[2, 2] + det


@njit(cache=True)
def cofactor_change(D: np.ndarray, cof_D: np.ndarray, trace: float, i: int, j: int) -> float:
    """Entry (i, j) of cof F - 1 = (tr D) 1 - D^T + cof D."""
    return cof_D[i, j] - D[j, i] + (trace if i == j else 0.0)


@njit(cache=True)
def double_strain(D: np.ndarray, out: np.ndarray) -> None:
    """Writes twice the Green-Lagrange strain, 2 E = F^T F - 1 = D + D^T + D^T D."""
    for i in range(3):
        for j in range(i, 3):
            out[i, j] = D[i, j] + D[j, i] + (D[0, i] * D[0, j] + D[1, i] * D[1, j] + D[2, i] * D[2, j])
            out[j, i] = out[i, j]
