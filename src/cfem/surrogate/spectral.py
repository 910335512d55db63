"""The energy model: Psi, e and C_ee as Chebyshev series, fitted by linear least squares to all that the samples know.

Every FE state gives, for nothing, the value, gradient and Hessian of Psi (energy, lambda, W_aa^-1), the value and
gradient of e (delta_e, W_ea W_aa^-1) and the value of C_ee = W_ee - W_ea W_aa^-1 W_ae. Each of the three has its own
degree, chosen by cross-validation on the training states."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.condensed import pack_upper
from cfem.predict.chebyshev import basis
from cfem.surrogate.chebyshev import derivative_matrices, index_set, number_of_terms

QUANTITIES = ("energy", "effector", "locked_compliance")
MAX_TERMS = 2000
BOX_MARGIN = 0.01  # of the range of the data: a polynomial of high degree grows fast outside its box


@dataclass(frozen=True)
class Fit:
    """arrays: what SpectralPredictor evaluates; degrees: chosen, by quantity;
    held_out: one record a quantity and degree: terms and the root mean square error of states left out, relative."""

    arrays: dict[str, np.ndarray]
    degrees: dict[str, int]
    held_out: list[dict[str, Any]]


@dataclass(frozen=True)
class Observations:
    """What is known of one quantity in box coordinates z: orders[d] (m, k_d, q), its derivatives of order d."""

    orders: tuple[np.ndarray, ...]

    def scaled(self) -> tuple[np.ndarray, np.ndarray]:
        """(m, k, q) all orders, each divided by its standard deviation, and (k,) those divisors."""
        scales = [np.std(order, axis=0).max(initial=0.0) or np.abs(order).max() or 1.0 for order in self.orders]
        divisors = np.concatenate([np.full(order.shape[1], s) for order, s in zip(self.orders, scales, strict=True)])
        return np.concatenate(self.orders, axis=1) / divisors[:, None], divisors


def fit(dataset: Any, max_degree: int = 16, folds: int = 5) -> Fit:
    """Fits all states of `dataset` (cfem.dataset.reader.Dataset, training rows only); fewer folds for fewer states."""
    folds = min(folds, len(dataset.delta_a))
    delta_a = dataset.delta_a
    a = dataset.rows.a
    stiffness = np.linalg.inv(dataset.W[:, a, a])
    to_box, offset = box_coordinates(delta_a, stiffness.mean(axis=0))
    z = delta_a @ to_box.T + offset
    n_a = delta_a.shape[1]
    while max_degree > 1 and number_of_terms(n_a, max_degree) > MAX_TERMS:
        max_degree -= 1
    coefficients, degrees, held_out = {}, {}, []
    for name, observed in zip(QUANTITIES, observations(dataset, stiffness, to_box), strict=True):
        errors, coefficients[name] = fit_quantity(z, observed, max_degree, folds)
        degrees[name] = int(np.argmin(errors))
        coefficients[name] = coefficients[name][degrees[name]]
        held_out += [
            {"quantity": name, "degree": degree, "terms": number_of_terms(n_a, degree), "error": float(error)}
            for degree, error in enumerate(errors)
        ]
    indices = index_set(n_a, max(degrees.values()))
    arrays = {
        "to_box": to_box,
        "offset": offset,
        "indices": indices,
        "series": series(coefficients, indices, to_box),
    }
    return Fit(arrays, degrees, held_out)


def box_coordinates(delta_a: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """z = to_box delta_a + offset: rotated to the principal axes of the mean stiffness (n_a, n_a), which tell soft
    directions from stiff ones, then scaled so that the states (m, n_a) lie in [-1, 1]."""
    spread = np.ptp(delta_a, axis=0)
    axes = np.linalg.eigh(stiffness * np.outer(spread, spread))[1].T / spread
    y = delta_a @ axes.T
    low, high = y.min(axis=0), y.max(axis=0)
    half = (0.5 + BOX_MARGIN) * (high - low)
    return axes / half[:, None], -(low + high) / 2 / half


def observations(dataset: Any, stiffness: np.ndarray, to_box: np.ndarray) -> tuple[Observations, ...]:
    """What the samples know of Psi, e and C_ee; derivatives by z = to_box delta_a + offset."""
    e, a = dataset.rows.e, dataset.rows.a
    from_box = np.linalg.inv(to_box)
    W_ea = dataset.W[:, e, a]
    gradient_e = W_ea @ stiffness
    locked = dataset.W[:, e, e] - gradient_e @ W_ea.swapaxes(1, 2)
    hessian = from_box.T @ stiffness @ from_box
    return (
        Observations(
            (
                dataset.energy[:, None, None],
                (dataset.lambda_a @ from_box)[..., None],
                pack_upper(hessian)[..., None],
            )
        ),
        Observations((dataset.delta_e[:, None, :], (gradient_e @ from_box).swapaxes(1, 2))),
        Observations((pack_upper(locked)[:, None, :],)),
    )


def fit_quantity(
    z: np.ndarray, observed: Observations, max_degree: int, folds: int
) -> tuple[np.ndarray, list[np.ndarray]]:
    """(degrees,) held-out errors, and (M, q) coefficients fitted to all states, for every degree from 0 that the number
    of rows allows (terms at most 0.7 of the rows of a fold's fit)."""
    m, n = z.shape
    targets, divisors = observed.scaled()
    rows = (m - -(-m // folds)) * len(divisors)
    degree = max(d for d in range(max_degree + 1) if d == 0 or number_of_terms(n, d) <= 0.7 * rows)
    counts = [number_of_terms(n, d) for d in range(degree + 1)]
    design = design_rows(z, index_set(n, degree), len(observed.orders) - 1) / divisors[:, None]
    squares = np.zeros(len(counts))
    for fold in range(folds):
        out = np.arange(m) % folds == fold
        for number, solution in enumerate(nested_least_squares(design[~out], targets[~out], counts)):
            squares[number] += ((design[out][..., : len(solution)] @ solution - targets[out]) ** 2).sum()
    return np.sqrt(squares / targets.size), nested_least_squares(design, targets, counts)


def design_rows(z: np.ndarray, indices: np.ndarray, order: int) -> np.ndarray:
    """(m, k, M) value, gradient and upper triangle of the Hessian of the basis at z (m, n), up to the stated order."""
    values = basis(z, indices)
    rows = [values]
    if order >= 1:
        D = derivative_matrices(indices)
        first = [values @ D_i for D_i in D]
        rows += first
    if order == 2:
        rows += [first[i] @ D[j] for i in range(len(D)) for j in range(i, len(D))]
    return np.stack(rows, axis=1)


def nested_least_squares(design: np.ndarray, targets: np.ndarray, counts: list[int]) -> list[np.ndarray]:
    """Least squares with the first M columns of design (m, k, M_max), for every M in counts: one QR serves them all."""
    Q, R = np.linalg.qr(design.reshape(-1, design.shape[-1]))
    right = Q.T @ targets.reshape(-1, targets.shape[-1])
    return [np.linalg.solve(R[:M, :M], right[:M]) for M in counts]


def series(coefficients: dict[str, np.ndarray], indices: np.ndarray, to_box: np.ndarray) -> np.ndarray:
    """(n_out, M) coefficients of every part of `cfem.predict.spectral.layout`, derivatives by delta_a."""
    psi, e, locked = (_padded(coefficients[name], len(indices)) for name in QUANTITIES)
    D = derivative_matrices(indices)
    n_a = len(to_box)
    by_delta = [sum(to_box[j, i] * D[j] for j in range(n_a)) for i in range(n_a)]
    psi_i = [D_i @ psi for D_i in by_delta]
    psi_ij = [by_delta[j] @ psi_i[i] for i in range(n_a) for j in range(i, n_a)]
    e_i = np.stack([D_i @ e for D_i in by_delta], axis=-1)  # (M, n_e, n_a)
    return np.hstack([psi, *psi_i, *psi_ij, e, e_i.reshape(len(indices), -1), locked]).T.copy()


def _padded(coefficients: np.ndarray, terms: int) -> np.ndarray:
    return np.pad(coefficients, ((0, terms - len(coefficients)), (0, 0)))
