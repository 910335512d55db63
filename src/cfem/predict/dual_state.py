"""Newton's method for states of a learned model at given values of the dual of its input.

A model of form 'displacement' is a function of delta_a and is searched for lambda_a; one of form 'force' the other way
round. The derivative is at hand: d delta_a / d lambda_a = W_aa (Legendre's transform of the condensed energy)."""

from collections.abc import Callable

import numpy as np

from cfem.condensed import Condensed
from cfem.predict.energy import Form

ITERATIONS, HALVINGS = 60, 12

# The condensed robots at inputs (k, n_a), those of the given numbers (k,) in the batch.
Evaluate = Callable[[np.ndarray, np.ndarray], Condensed]


def dual_states(
    evaluate: Evaluate, form: Form, start: np.ndarray, wanted: np.ndarray, tolerance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Inputs (m, n_a) of the form whose duals are `wanted` (m, n_a), and what is missing (m,), largest entry.

    start: (m, n_a) inputs; tolerance: (m,) at which a state's search ends. Each search halves steps that do not bring
    it nearer and ends where none does."""
    state, everything = start.copy(), np.arange(len(wanted))
    now = evaluate(state, everything)
    compliance, residual = now.W_aa.copy(), wanted - _dual(now, form)
    active = np.abs(residual).max(axis=1) > tolerance
    for _ in range(ITERATIONS):
        pending = everything[active]
        if not len(pending):
            break
        step, share = _step(compliance[pending], residual[pending], form), 1.0
        for _ in range(HALVINGS):
            trial = state[pending] + share * step
            now = evaluate(trial, pending)
            left = wanted[pending] - _dual(now, form)
            nearer = np.linalg.norm(left, axis=1) < np.linalg.norm(residual[pending], axis=1)
            moved = pending[nearer]
            state[moved], residual[moved], compliance[moved] = trial[nearer], left[nearer], now.W_aa[nearer]
            pending, step, share = pending[~nearer], step[~nearer], share / 2
            if not len(pending):
                break
        active = np.abs(residual).max(axis=1) > tolerance
        active[pending] = False
    return state, np.abs(residual).max(axis=1)


def _dual(condensed: Condensed, form: Form) -> np.ndarray:
    return condensed.lambda_a if form == "displacement" else condensed.delta_a


def _step(compliance: np.ndarray, residual: np.ndarray, form: Form) -> np.ndarray:
    column = residual[..., None]
    return (compliance @ column if form == "displacement" else np.linalg.solve(compliance, column))[..., 0]
