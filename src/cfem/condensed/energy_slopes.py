"""Derivatives of the condensed energy's Hessian and of the effectors' map, from those of W."""

import numpy as np


def by_displacement(
    dW: np.ndarray, e: slice, a: slice, K: np.ndarray, G: np.ndarray, W_ea: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives (m, k, ...) by delta_k of K = W_aa^-1, G = W_ea K, C = W_ee - G W_ae, from those of W by lambda: dK =
    -K dW_aa K, dG = (dW_ea - G dW_aa) K, dC = dW_ee - dG W_ae - G dW_ae; d/ddelta_l = sum_k K_kl d/dlambda_k."""
    K_, G_ = K[:, None], G[:, None]
    d_K = -K_ @ dW[:, :, a, a] @ K_
    d_G = (dW[:, :, e, a] - G_ @ dW[:, :, a, a]) @ K_
    d_C = dW[:, :, e, e] - d_G @ W_ea[:, None].swapaxes(2, 3) - G_ @ dW[:, :, a, e]
    return tuple(np.einsum("mkl,mkij->mlij", K, slope) for slope in (d_K, d_G, d_C))
