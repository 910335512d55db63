"""From one scalar energy to (W, delta_free), whatever represents it.

Form 'displacement': the condensed energy Psi(delta_a), with grad Psi = lambda_a and hess Psi = W_aa^-1. Form 'force':
its dual Psi*(lambda_a) = lambda_a . delta_a - Psi (Legendre), with grad Psi* = delta_a and hess Psi* = W_aa. Beside it
the effectors' displacements e and a compliance C of theirs:

    form          W_aa           W_ea             W_ee
    displacement  (hess Psi)^-1  (grad e) W_aa    C + (grad e) W_aa (grad e)^T     C: the actuators locked
    force         hess Psi*      grad e           C                                C: the actuators' forces held

and delta_free = delta - W[:, a] lambda_a. W is symmetric by construction."""

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.model import Form
from cfem.condensed.packing import unpacking
from cfem.predict.series.semidefinite import nearest, with_nearest

FORMS: tuple[Form, ...] = ("displacement", "force")
Parts = dict[str, np.ndarray]


def layout(n_a: int, n_e: int) -> dict[str, slice]:
    """Slices of a flat vector of outputs: the potential, its gradient and Hessian by s (delta_a or lambda_a), e, grad e
    (row-major), C; symmetric matrices as their upper triangle."""
    sizes = {
        "energy": 1,
        "gradient": n_a,
        "hessian": n_a * (n_a + 1) // 2,
        "effector": n_e,
        "effector_gradient": n_e * n_a,
        "effector_compliance": n_e * (n_e + 1) // 2,
    }
    ends = np.cumsum(list(sizes.values()))
    return {name: slice(int(end - size), int(end)) for (name, size), end in zip(sizes.items(), ends, strict=True)}


THIRD = "third"  # array (n_e (n_e + 1) (n_e + 2) / 6, M): series of D, entries i <= j <= k

# array (n_e (n_e + 1) (n_e + 2) (n_e + 3) / 24, M): series of d2C/dw2, entries i <= j <= k <= l, of a basis of its own,
# whose degrees are the other array (M, n)
FOURTH, FOURTH_INDICES = "fourth", "fourth_indices"


class Splitter:
    """Takes flat outputs (..., k) in the order of `layout` apart."""

    def __init__(self, n_a: int, n_e: int):
        self._n_a, self._n_e, self._rows = n_a, n_e, layout(n_a, n_e)
        self._unpack_a, self._unpack_e = unpacking(n_a), unpacking(n_e)

    def __call__(self, out: np.ndarray) -> Parts:
        part = {name: out[..., rows] for name, rows in self._rows.items()}
        part["hessian"] = part["hessian"][..., self._unpack_a]
        part["effector_compliance"] = part["effector_compliance"][..., self._unpack_e]
        part["effector_gradient"] = part["effector_gradient"].reshape(*out.shape[:-1], self._n_e, self._n_a)
        return part


def condense(
    form: Form, rows: Rows, s: np.ndarray, part: Parts, sizes: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """W (..., n, n) and delta_free (..., n) at inputs s (..., n_a) of the form, from the parts there; sizes (n_e,) of a
    model whose locked compliance is made semidefinite (semidefinite.py)."""
    e, a, n = rows.e, rows.a, rows.n
    gradient, gradient_e = part["gradient"], part["effector_gradient"]
    W = np.empty((*s.shape[:-1], n, n))
    if form == "displacement":
        delta_a, lam = s, gradient
        W_aa = np.linalg.inv(part["hessian"])
        W_ea = gradient_e @ W_aa
        C = part["effector_compliance"] if sizes is None else nearest(part["effector_compliance"], sizes)
        W[..., e, e] = C + W_ea @ gradient_e.swapaxes(-1, -2)
    else:
        delta_a, lam = gradient, s
        W_aa, W_ea = part["hessian"], gradient_e
        W[..., e, e] = part["effector_compliance"]
    W[..., a, a] = W_aa
    W[..., e, a] = W_ea
    W[..., a, e] = W_ea.swapaxes(-1, -2)
    if form == "force" and sizes is not None:
        W = with_nearest(W, rows.n_e, sizes)
    delta_free = np.concatenate([part["effector"], delta_a], axis=-1)
    delta_free -= (W[..., a] @ lam[..., None])[..., 0]
    return W, delta_free
