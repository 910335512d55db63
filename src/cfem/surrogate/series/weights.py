"""Weights of coordinates, by which an anisotropic total degree counts: found by search, by how fast the coefficients of
a series fall along each, and by how much the effectors' map bends along each."""

import numpy as np

from cfem.surrogate.series.chebyshev import index_set
from cfem.surrogate.series.least_squares import residual_square, solve_nested, triangular
from cfem.surrogate.series.nested_fit import blocks
from cfem.surrogate.series.observations import Derivative

SEARCH_ROWS = 12  # of the fits that judge weights or neighbours, a term
HARDLY = 0.1  # of the largest second derivative of the effectors' map


def searched_weights(
    z: np.ndarray,
    derivatives: tuple[Derivative, ...],
    targets: np.ndarray,
    divisors: np.ndarray,
    terms: int,
    max_degree: int,
) -> np.ndarray:
    """Weights (n,) >= 1, the smallest 1, by which at most `terms` terms come closest to a fifth of the states that is
    left out: from equal ones on, each in turn is multiplied or divided by a step, 1.5 at first, while that helps."""
    states = np.arange(min(len(z), max(5, SEARCH_ROWS * terms // len(derivatives))))
    fitted, left_out = states[states % 5 != 0], states[states % 5 == 0]

    def error(weights: np.ndarray) -> float:
        indices, _ = index_set(weights, terms, max_degree)
        R, judge = (
            triangular(blocks(z[rows], derivatives, targets[rows], divisors, indices)) for rows in (fitted, left_out)
        )
        (solution,) = solve_nested(R, targets.shape[2], [len(indices)])
        return np.inf if solution is None else residual_square(judge, targets.shape[2], solution)

    best, step = np.ones(z.shape[1]), 1.5
    least = error(best)
    while step > 1.05:
        helped = False
        for axis in range(len(best)):
            for factor in (step, 1 / step):
                trial = best * np.where(np.arange(len(best)) == axis, factor, 1.0)
                trial /= trial.min()
                if trial.max() <= 8 and (reached := error(trial)) < 0.98 * least:
                    best, least, helped = trial, reached, True
                    break
        step = step if helped else np.sqrt(step)
    return best


def decay_weights(indices: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Weights (n,) >= 1 by how fast the coefficients fall with the degree in each coordinate: the rate of a geometric
    fall from degree 1 on, that of the slowest coordinate being 1."""
    size = np.linalg.norm(coefficients / np.abs(coefficients).max(axis=0, initial=1e-300), axis=1)
    rates = np.full(indices.shape[1], np.inf)
    for axis, degrees in enumerate(indices.T):
        falls = np.array([np.sqrt((size[degrees == k] ** 2).sum()) for k in range(1, degrees.max() + 1)])
        # odd or even degrees may lack: what counts is what is left from each degree on
        beyond = np.maximum.accumulate(falls[::-1])[::-1]
        if len(beyond) > 1:
            log = np.log(np.maximum(beyond, 1e-17))
            rates[axis] = (log[0] - log[-1]) / (len(log) - 1)
    slowest = rates.min()
    if not np.isfinite(slowest) or slowest <= 0:
        return np.ones(len(rates))
    return np.clip(rates / slowest, 1.0, 4.0)


def active_weights(metric: np.ndarray, s: np.ndarray, n_q: int) -> np.ndarray | None:
    """Weights (n,): 2 for the coordinates along which the effectors' map hardly bends, by the metric that the
    coordinates of `box_coordinates` come from, 1 for the others and for parameters; None for one or two inputs."""
    if s.shape[1] <= 2:
        return None
    spread = np.ptp(s, axis=0)
    bend = np.sqrt(np.maximum(np.linalg.eigvalsh(metric * np.outer(spread, spread)), 0.0))
    return np.concatenate([np.where(bend < HARDLY * bend[-1], 2.0, 1.0), np.ones(n_q)])
