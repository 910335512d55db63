"""Polynomials in the displacements of the actuators through finite elements at few states, and the choice of these."""

from itertools import combinations_with_replacement

import numpy as np
from scipy.linalg import qr

from cfem.predict.series.chebyshev import basis
from cfem.predict.series.domain import Domain

TERMS, MOST = 10, 3  # of the polynomials, and their highest degree


def degrees(n_a: int) -> np.ndarray:
    """Degrees (terms, n_a) of the polynomial through L, the lower ones first: of the highest total degree, MOST at
    most, that has no more than TERMS."""
    rows = [np.zeros(n_a, dtype=np.int64)]
    for degree in range(1, MOST + 1):
        more = [np.bincount(axes, minlength=n_a) for axes in combinations_with_replacement(range(n_a), degree)]
        if degree > 1 and len(rows) + len(more) > TERMS:
            break
        rows += more
    return np.array(rows)


def patch_states(domain: Domain, n_a: int) -> np.ndarray:
    """Displacements (J, n_a) mm: of the training states those at which finite elements say most of a polynomial in
    delta_a (pivots of a QR factorisation: Sommariva and Vianello, *Computing approximate Fekete points*, 2009)."""
    states = domain.states[:, :n_a]
    low, high = domain.delta_a
    values = basis(2 * (states - low) / (high - low) - 1, degrees(n_a))
    chosen = qr(values.T, mode="r", pivoting=True)[1][: min(values.shape)]
    return states[np.sort(chosen)]


def linear_states(domain: Domain, states: np.ndarray) -> np.ndarray:
    """Numbers of those of the states (J, n_a) mm that say most of what is linear in delta_a, as `patch_states`."""
    low, high = domain.delta_a
    values = np.column_stack([np.ones(len(states)), 2 * (states - low) / (high - low) - 1])
    return np.sort(qr(values.T, mode="r", pivoting=True)[1][: min(values.shape)])
