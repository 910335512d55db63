"""The energy model as Chebyshev series, fitted by linear least squares to all that the samples know.

The potential, e and C each have their own index set, of anisotropic total degree, chosen by the error of states left
out: among weights of the coordinates that are all 1, weights found by search, weights by how fast the coefficients fall
along each, and weights by how much the effectors' map bends along each, and among degrees."""

from dataclasses import dataclass
from itertools import combinations_with_replacement, pairwise
from typing import Any

import numpy as np

from cfem.condensed.pose import COORDINATES
from cfem.condensed.resting import resting
from cfem.predict.chebyshev import basis
from cfem.predict.energy import THIRD, Form
from cfem.predict.series import derivative_matrices, differentiated
from cfem.surrogate.chebyshev import index_set
from cfem.surrogate.coordinates import box_coordinates, held_coordinates, mean_square
from cfem.surrogate.least_squares import residual_square, solve_nested, triangular
from cfem.surrogate.observations import Derivative, Observations, in_box, inputs, observations

ROWS_A_TERM = 1 / 0.9
BLOCK = 4_000_000  # entries of a block of the least-squares matrix
SEARCH_TERMS, SEARCH_ROWS = 300, 12  # of the fits that judge weights, and rows of theirs a term
HARDLY = 0.1  # of the largest second derivative of the effectors' map
PILOT_TERMS = 600  # whole degrees that are tried first, of three or more coordinates


@dataclass(frozen=True)
class Series:
    """indices (M, n), coefficients (M, q) of one quantity in box coordinates."""

    indices: np.ndarray
    coefficients: np.ndarray


@dataclass(frozen=True)
class Fit:
    """arrays: what SpectralPredictor evaluates; terms: chosen, by quantity; weights: of the coordinates, by quantity;
    held_out: one record a quantity, weighting and degree: terms and the root mean square error of states left out,
    relative."""

    arrays: dict[str, np.ndarray]
    terms: dict[str, int]
    weights: dict[str, list[float]]
    held_out: list[dict[str, Any]]


def fit(dataset: Any, form: Form = "displacement", max_degree: int = 16, max_terms: int = 2000, folds: int = 5) -> Fit:
    """Fits all states of `dataset` (cfem.dataset.reader.Dataset, training rows only); fewer folds for fewer states."""
    s, q = inputs(dataset, form)
    known = observations(dataset, form)
    if dataset.n_c:
        to_box, offset = held_coordinates(s, q, _mean_hessian(known, s.shape[1]), dataset.n_c, _rests(dataset))
        active = None
    else:
        metric = _metric(s, q, known)
        to_box, offset = box_coordinates(s, q, metric)
        active = active_weights(metric, s, q.shape[1])
    z = np.hstack([s, q]) @ to_box.T + offset
    chosen, weights, held_out = {}, {}, []
    for name, observed in known.items():
        chosen[name], weights[name], records = fit_quantity(
            z, in_box(observed, to_box), max_degree, max_terms, folds, active
        )
        held_out += [{"quantity": name, **record} for record in records]
    return Fit(
        {"to_box": to_box, "offset": offset, **series(chosen, to_box, s.shape[1])},
        {name: len(one.indices) for name, one in chosen.items()},
        {name: one.tolist() for name, one in weights.items()},
        held_out,
    )


def _metric(s: np.ndarray, q: np.ndarray, known: dict[str, Observations]) -> np.ndarray:
    """The form whose principal axes become coordinates: the mean Hessian of the potential for one or two inputs, the
    mean squared second derivative of the effectors' map for more (active directions of its gradient, Constantine
    2015)."""
    n_a = s.shape[1]
    if n_a <= 2:
        return _mean_hessian(known, n_a)
    effector = known["effector"]
    pairs = tuple(combinations_with_replacement(range(n_a), 2))
    if pairs[0] in effector.derivatives:
        return mean_square(effector.values[:, 1 + n_a :], n_a)
    to_box, offset = box_coordinates(s, q, np.eye(n_a))
    z = np.hstack([s, q]) @ to_box.T + offset
    pilot, _, _ = fit_quantity(z, in_box(effector, to_box), max_degree=6, max_terms=PILOT_TERMS, folds=5)
    second = design_rows(z, pilot.indices, pairs) @ pilot.coefficients
    return mean_square(in_box(Observations(pairs, second, n_a), np.linalg.inv(to_box)).values, n_a)


def _rests(dataset: Any) -> np.ndarray | None:
    """(n_c, n_a) where the coordinates that were drawn about their rest have it; None where none were."""
    free = dataset.meta["plan"]["contact"].get("about_rest")
    if not free:
        return None
    compliance = np.array(dataset.meta["compliance"])
    return resting(compliance, len(compliance) - dataset.n_c, [COORDINATES.index(axis) for axis in free])


def _mean_hessian(known: dict[str, Observations], n_a: int) -> np.ndarray:
    """(n_a, n_a) of the potential by s."""
    mean = known["potential"].values[:, 1 + n_a : 1 + n_a + n_a * (n_a + 1) // 2, 0].mean(axis=0)
    hessian = np.zeros((n_a, n_a))
    hessian[np.triu_indices(n_a)] = mean
    return hessian + np.triu(hessian, 1).T


def fit_quantity(
    z: np.ndarray,
    observed: Observations,
    max_degree: int,
    max_terms: int,
    folds: int,
    active: np.ndarray | None = None,
) -> tuple[Series, np.ndarray, list[dict[str, Any]]]:
    """The series with the least error on states left out, the weights of its coordinates, and one record a trial.
    active: weights to try besides equal ones, those that a search finds and those of the coefficients' decay."""
    n = z.shape[1]
    targets, divisors = observed.scaled()
    folds = min(folds, len(z))
    most = int(len(divisors) * (len(z) - -(-len(z) // folds)) / ROWS_A_TERM)
    most = max(1, min(max_terms, most))
    found, records = [], []

    def attempt(name: str, weights: np.ndarray, limit: int) -> Series:
        indices, order = index_set(weights, limit, max_degree)
        counts = level_counts(order, smooth=name != "equal")
        trials = try_counts(z, observed.derivatives, targets, divisors, indices, counts, folds)
        records.extend(
            {"weights": name, "degree": float(order[count - 1]), "terms": count, "error": error}
            for count, (error, _) in zip(counts, trials, strict=True)
            if np.isfinite(error)
        )
        at = int(np.argmin([error for error, _ in trials]))
        series = Series(indices[: counts[at]], trials[at][1])
        found.append((trials[at][0], series, weights))
        return series

    pilot = attempt("equal", np.ones(n), min(most, PILOT_TERMS) if n > 2 else most)
    others = {}
    if n > 1:
        limit = min(most // 2, SEARCH_TERMS)
        searched = searched_weights(z, observed.derivatives, targets, divisors, limit, max_degree)
        others = {"searched": searched, "decay": decay_weights(pilot), "active": active}
    for name, weights in others.items():
        if weights is not None and not np.allclose(weights, 1.0, atol=0.1):
            attempt(name, weights, most)
    _, series, weights = min(found, key=lambda one: one[0])
    return series, weights, records


def level_counts(order: np.ndarray, smooth: bool) -> list[int]:
    """Sizes of the nested sets to try, of indices sorted by `order` (M,): whole degrees, or, for weighted ones, steps
    of a quarter in number."""
    ends = [i + 1 for i, (one, other) in enumerate(pairwise(order)) if other > one + 1e-9] + [len(order)]
    if not smooth:
        return ends
    counts = [ends[0]]
    for end in ends[1:]:
        if end >= 1.25 * counts[-1] or end == ends[-1]:
            counts.append(end)
    return counts


def try_counts(
    z: np.ndarray,
    derivatives: tuple[Derivative, ...],
    targets: np.ndarray,
    divisors: np.ndarray,
    indices: np.ndarray,
    counts: list[int],
    folds: int,
) -> list[tuple[float, np.ndarray]]:
    """(relative root mean square error of states left out, coefficients fitted to all states) for every count."""
    m, k, outputs = targets.shape
    members = [np.arange(m)[np.arange(m) % folds == fold] for fold in range(folds)]
    left_out = [triangular(blocks(z[rows], derivatives, targets[rows], divisors, indices)) for rows in members]
    everything = triangular(left_out)
    solutions = solve_nested(everything, outputs, counts)
    # many columns make the factors of all but one fold the dearest part: one fold then has to do
    judged = range(folds) if len(indices) <= PILOT_TERMS else range(1)
    squares, count = np.zeros(len(counts)), 0
    for fold in judged:
        others = triangular(left_out[:fold] + left_out[fold + 1 :])
        for number, solution in enumerate(solve_nested(others, outputs, counts)):
            squares[number] += np.inf if solution is None else residual_square(left_out[fold], outputs, solution)
        count += len(members[fold]) * k * outputs
    errors = np.sqrt(squares / count)
    return [
        (np.inf if solution is None else float(error), solution)
        for error, solution in zip(errors, solutions, strict=True)
    ]


def blocks(
    z: np.ndarray, derivatives: tuple[Derivative, ...], targets: np.ndarray, divisors: np.ndarray, indices: np.ndarray
):
    """Rows [A b] of the least-squares problem, some states at a time."""
    D = derivative_matrices(indices)
    at_once = max(1, BLOCK // (len(derivatives) * len(indices)))
    for first in range(0, len(z), at_once):
        part = slice(first, first + at_once)
        design = design_rows(z[part], indices, derivatives, D) / divisors[:, None]
        rows = np.concatenate([design, targets[part]], axis=2)
        yield rows.reshape(-1, rows.shape[2])


def design_rows(
    z: np.ndarray, indices: np.ndarray, derivatives: tuple[Derivative, ...], D: list | None = None
) -> np.ndarray:
    """(m, k, M) the stated derivatives of the basis at z (m, n)."""
    D = D or derivative_matrices(indices)
    known = {(): basis(z, indices)}
    for one in sorted(derivatives, key=len):
        for end in range(1, len(one) + 1):
            if one[:end] not in known:
                known[one[:end]] = known[one[: end - 1]] @ D[one[end - 1]]
    return np.stack([known[one] for one in derivatives], axis=1)


def searched_weights(
    z: np.ndarray,
    derivatives: tuple[Derivative, ...],
    targets: np.ndarray,
    divisors: np.ndarray,
    terms: int,
    max_degree: int,
    largest: float = 8.0,
) -> np.ndarray:
    """(n,) weights >= 1, the smallest 1, by which at most `terms` terms come closest to a fifth of the states that is
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
                if trial.max() <= largest and (found := error(trial)) < 0.98 * least:
                    best, least, helped = trial, found, True
                    break
        step = step if helped else np.sqrt(step)
    return best


def decay_weights(series: Series, largest: float = 4.0) -> np.ndarray:
    """(n,) weights >= 1 by how fast the coefficients fall with the degree in each coordinate: the rate of a geometric
    fall from degree 1 on, that of the slowest coordinate being 1."""
    size = np.linalg.norm(series.coefficients / np.abs(series.coefficients).max(axis=0, initial=1e-300), axis=1)
    rates = np.full(series.indices.shape[1], np.inf)
    for axis, degrees in enumerate(series.indices.T):
        falls = np.array([np.sqrt((size[degrees == k] ** 2).sum()) for k in range(1, degrees.max() + 1)])
        # odd or even degrees may lack: what counts is what is left from each degree on
        beyond = np.maximum.accumulate(falls[::-1])[::-1]
        if len(beyond) > 1:
            log = np.log(np.maximum(beyond, 1e-17))
            rates[axis] = (log[0] - log[-1]) / (len(log) - 1)
    slowest = rates.min()
    if not np.isfinite(slowest) or slowest <= 0:
        return np.ones(len(rates))
    return np.clip(rates / slowest, 1.0, largest)


def active_weights(metric: np.ndarray, s: np.ndarray, n_q: int) -> np.ndarray | None:
    """(n,) 2 for the coordinates along which the effectors' map hardly bends, by the metric that the coordinates of
    `box_coordinates` come from, 1 for the others and for parameters; None for one or two inputs."""
    if s.shape[1] <= 2:
        return None
    spread = np.ptp(s, axis=0)
    bend = np.sqrt(np.maximum(np.linalg.eigvalsh(metric * np.outer(spread, spread)), 0.0))
    return np.concatenate([np.where(bend < HARDLY * bend[-1], 2.0, 1.0), np.ones(n_q)])


def series(chosen: dict[str, Series], to_box: np.ndarray, n_a: int) -> dict[str, np.ndarray]:
    """indices (M, n), the union of the index sets; series (n_out, M), coefficients of every part of
    `cfem.predict.energy.layout`, derivatives by s (n_a,); and of D where it was fitted."""
    union = {tuple(k) for one in chosen.values() for k in one.indices.tolist()}
    indices = np.array(sorted(union, key=lambda k: (sum(k), k)), dtype=np.int64)
    position = {tuple(k): i for i, k in enumerate(indices.tolist())}

    def padded(one: Series) -> np.ndarray:
        full = np.zeros((len(indices), one.coefficients.shape[1]))
        full[[position[tuple(k)] for k in one.indices.tolist()]] = one.coefficients
        return full

    psi, e, compliance = (padded(chosen[name]) for name in ("potential", "effector", "effector_compliance"))
    arrays = {"indices": indices, "series": differentiated(indices, to_box, n_a, psi, e, compliance)}
    return arrays | ({THIRD: padded(chosen[THIRD]).T.copy()} if THIRD in chosen else {})
