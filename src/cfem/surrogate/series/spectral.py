"""The energy model as Chebyshev series, fitted by linear least squares to all that the samples know.

The potential, e and C each have their own index set, of anisotropic total degree, chosen by the error of states left
out: among weights of the coordinates that are all 1, weights found by search, weights by how fast the coefficients fall
along each, and weights by how much the effectors' map bends along each, and among degrees. With many inputs the sets
grow term by term instead (greedy.py)."""

from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import comb
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.pose import COORDINATES, resting
from cfem.predict.series.derivatives import differentiated
from cfem.predict.series.energy import FOURTH, FOURTH_INDICES, THIRD, Form
from cfem.surrogate.series.chebyshev import design_rows, index_set
from cfem.surrogate.series.coordinates import box_coordinates, held_coordinates, mean_square
from cfem.surrogate.series.greedy import greedy_set
from cfem.surrogate.series.least_squares import least_norm
from cfem.surrogate.series.nested_fit import level_counts, try_counts, values_left_out
from cfem.surrogate.series.observations import Derivative, Observations, in_box, inputs, observations
from cfem.surrogate.series.weights import SEARCH_ROWS, active_weights, decay_weights, searched_weights
from cfem.surrogate.spec import SpectralSpec

ROWS_A_TERM = 1 / 0.9
SEARCH_TERMS = 300  # of the fits that judge weights
MANY = 8  # inputs, beyond which no weights say well what matters: sets grow term by term
# Error of states left out above which the terms that are left out matter. Their derivatives of order k are n^k times as
# large as they are, for a degree n: with equal weights those decide the fit, and the values pay for it. Each order is
# then tried at a tenth of the weight of the one below, and taken where the values of states left out are better by far.
TRUNCATED, FALL, FAR = 0.05, 10.0, 0.6
PILOT_TERMS = 600  # whole degrees that are tried first, of three or more coordinates


@dataclass(frozen=True)
class Series:
    """Series of one quantity in box coordinates: indices (M, n), coefficients (M, q)."""

    indices: np.ndarray
    coefficients: np.ndarray


@dataclass(frozen=True)
class Fit:
    """A fitted energy model.

    arrays: what SpectralPredictor evaluates
    terms: chosen, by quantity
    weights: of the coordinates, by quantity
    held_out: one record a quantity, weighting and degree: terms and the root mean square error of states left out,
    relative"""

    arrays: dict[str, np.ndarray]
    terms: dict[str, int]
    weights: dict[str, list[float]]
    held_out: list[dict[str, Any]]


def fit_spec(dataset: Any, spec: SpectralSpec, folder: Path | None = None) -> tuple[dict, dict, list]:
    """Arrays, facts for model.json and held-out errors of the model that a spec asks for, as every kind has them."""
    fitted = fit(dataset, spec.form, spec.max_degree, spec.max_terms, spec.folds)
    return fitted.arrays, {"form": spec.form, "terms": fitted.terms, "weights": fitted.weights}, fitted.held_out


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
        observed = in_box(observed, to_box)
        chosen[name], weights[name], records = fit_quantity(z, observed, max_degree, max_terms, folds, active)
        if name == "effector" and min(record["error"] for record in records) > TRUNCATED:
            chosen[name], weights[name], records = _values_first(
                z, observed, (chosen[name], weights[name], records), (max_degree, max_terms, folds, active)
            )
        held_out += [{"quantity": name, **record} for record in records]
    curvature = {}
    if dataset.d2C is not None and form == "displacement":
        indices, coefficients, error = least_norm(z, dataset.d2C)
        curvature = {FOURTH_INDICES: indices, FOURTH: coefficients.T.copy()}
        held_out.append({"quantity": FOURTH, "weights": "least norm", "terms": len(indices), "error": error})
    return Fit(
        {"to_box": to_box, "offset": offset, **series(chosen, to_box, s.shape[1]), **curvature},
        {name: len(part.indices) for name, part in chosen.items()},
        {name: values.tolist() for name, values in weights.items()},
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
    """Rests (n_c, n_a) of the coordinates that were drawn about their rest; None where none were."""
    free = dataset.meta["plan"]["contact"].get("about_rest")
    if not free:
        return None
    compliance = np.array(dataset.meta["compliance"])
    return resting(compliance, len(compliance) - dataset.n_c, [COORDINATES.index(axis) for axis in free])


def _mean_hessian(known: dict[str, Observations], n_a: int) -> np.ndarray:
    """Mean Hessian (n_a, n_a) of the potential by s."""
    mean = known["potential"].values[:, 1 + n_a : 1 + n_a + n_a * (n_a + 1) // 2, 0].mean(axis=0)
    hessian = np.zeros((n_a, n_a))
    hessian[np.triu_indices(n_a)] = mean
    return hessian + np.triu(hessian, 1).T


Choice = tuple["Series", np.ndarray, list[dict[str, Any]]]


def _values_first(z: np.ndarray, observed: Observations, equal: Choice, limits: tuple) -> Choice:
    """Choice with derivatives that count less, where that gives the values at states left out better than `equal`, the
    choice with equal weights. limits: as of `fit_quantity`."""
    chosen = fit_quantity(z, observed, *limits, fall=FALL)
    folds = min(limits[2], len(z))
    errors = [
        values_left_out(z, observed.derivatives, observed.scaled(fall), choice[0].indices, folds)
        for fall, choice in ((1.0, equal), (FALL, chosen))
    ]
    return chosen if errors[1] < FAR * errors[0] else equal


def fit_quantity(
    z: np.ndarray,
    observed: Observations,
    max_degree: int,
    max_terms: int,
    folds: int,
    active: np.ndarray | None = None,
    enough: float = 0.0,
    fall: float = 1.0,
) -> tuple[Series, np.ndarray, list[dict[str, Any]]]:
    """The series with the least error on states left out, of several below `enough` the shortest; the weights of its
    coordinates; and one record a trial. active: weights to try besides equal ones, those that a search finds and those
    of the coefficients' decay. fall: how much less each order of derivatives counts than the one below."""
    n = z.shape[1]
    trials = _Trials(z, observed.derivatives, observed.scaled(fall), max_degree, min(folds, len(z)), max_terms, enough)
    if n > MANY:
        trials.try_greedy()
        return trials.result()
    most = trials.most
    pilot = trials.attempt("equal", np.ones(n), min(most, PILOT_TERMS) if n > 2 else most)
    candidates = {}
    if n > 1:
        searched = trials.searched_weights(min(most // 2, SEARCH_TERMS))
        candidates = {"searched": searched, "decay": decay_weights(pilot.indices, pilot.coefficients), "active": active}
    for name, weights in candidates.items():
        if weights is not None and not np.allclose(weights, 1.0, atol=0.1):
            trials.attempt(name, weights, most)
    trials.try_higher_degrees(len(pilot.indices))
    return trials.result()


class _Trials:
    """Fits of one quantity with index sets that compete for the least error on states left out.

    most: terms that the states can determine
    records: one a set tried, with weights, degree, terms and error
    ranked: (rank, series, weights) of each trial's best set; a rank is (error, but no less than `enough`; terms)"""

    def __init__(
        self,
        z: np.ndarray,
        derivatives: tuple[Derivative, ...],
        scaled: tuple[np.ndarray, np.ndarray],
        max_degree: int,
        folds: int,
        max_terms: int,
        enough: float,
    ):
        """Counts the terms that scaled observations determine."""
        self._z, self._derivatives, self._max_degree, self._folds = z, derivatives, max_degree, folds
        self._enough, self._targets, self._divisors = enough, *scaled
        most = int(len(self._divisors) * (len(z) - -(-len(z) // folds)) / ROWS_A_TERM)
        self.most = max(1, min(max_terms, most))
        self.ranked: list[tuple[tuple[float, int], Series, np.ndarray]] = []
        self.records: list[dict[str, Any]] = []

    def attempt(self, name: str, weights: np.ndarray, limit: int) -> Series:
        """The best of the nested sets by these weights, of at most `limit` terms."""
        indices, order = index_set(weights, limit, self._max_degree)
        return self._judge(name, weights, indices, order, level_counts(order, smooth=name != "equal"))

    def try_greedy(self) -> None:
        """Tries sets that grow term by term."""
        n, known = self._z.shape[1], (self._derivatives, self._divisors)
        indices, sizes = greedy_set(*_fewer(self._z, self._targets, self.most), *known, self.most, self._max_degree)
        greatest = np.maximum.accumulate(indices.sum(axis=1))
        self._judge("greedy", np.ones(n), indices, greatest, [size for size in sizes if size >= len(indices) / 8])

    def try_higher_degrees(self, terms: int) -> None:
        """Tries higher degrees of equal weights while each is the best so far, from the pilot's `terms` on, if these
        are all terms of a degree."""
        n, max_degree = self._z.shape[1], self._max_degree
        degree = next(k for k in range(max_degree + 1) if comb(n + k, n) >= terms)
        while terms == comb(n + degree, n) and degree < max_degree and comb(n + degree + 1, n) <= self.most:
            best, degree = min(rank for rank, *_ in self.ranked), degree + 1
            if best[0] <= self._enough or best[1] != terms:
                return
            terms = comb(n + degree, n)
            self._judge("equal", np.ones(n), *index_set(np.ones(n), terms, max_degree), [terms])

    def searched_weights(self, limit: int) -> np.ndarray:
        """Weights (n,) by which at most `limit` terms come closest to states that are left out."""
        return searched_weights(self._z, self._derivatives, self._targets, self._divisors, limit, self._max_degree)

    def result(self) -> tuple[Series, np.ndarray, list[dict[str, Any]]]:
        """The series of the lowest rank, its weights, and all records."""
        _, series, weights = min(self.ranked, key=lambda trial: trial[0])
        return series, weights, self.records

    def _judge(
        self, name: str, weights: np.ndarray, indices: np.ndarray, order: np.ndarray, counts: list[int]
    ) -> Series:
        """The best of the first `counts` of indices (M, n), by the error on states left out."""
        fits = try_counts(self._z, self._derivatives, self._targets, self._divisors, indices, counts, self._folds)
        self.records.extend(
            {"weights": name, "degree": float(order[count - 1]), "terms": count, "error": error}
            for count, (error, _) in zip(counts, fits, strict=True)
            if np.isfinite(error)
        )
        ranks = [(max(error, self._enough), count) for count, (error, _) in zip(counts, fits, strict=True)]
        place = ranks.index(min(ranks))
        series = Series(indices[: counts[place]], fits[place][1])
        self.ranked.append((ranks[place], series, weights))
        return series


def _fewer(z: np.ndarray, targets: np.ndarray, terms: int) -> tuple[np.ndarray, np.ndarray]:
    """The states that choose among terms: enough of them, without those of the fold that judges."""
    states = np.flatnonzero(np.arange(len(z)) % 5 != 0)[: max(20, SEARCH_ROWS * terms // targets.shape[1])]
    return z[states], targets[states]


def series(chosen: dict[str, Series], to_box: np.ndarray, n_a: int) -> dict[str, np.ndarray]:
    """Arrays of the series: indices (M, n), the union of the index sets; series (n_out, M), coefficients of every part
    of `cfem.predict.series.energy.layout`, derivatives by s (n_a,); and of D where it was fitted."""
    indices, padded = united(chosen)
    psi, e, compliance = (padded[name] for name in ("potential", "effector", "effector_compliance"))
    arrays = {"indices": indices, "series": differentiated(indices, to_box, n_a, psi, e, compliance)}
    return arrays | ({THIRD: padded[THIRD].T.copy()} if THIRD in chosen else {})


def united(chosen: dict[str, Series]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Multi-indices (M, n) of several series together, by degree, and the coefficients (M, q) of each, 0 where it has
    no such term."""
    union = {tuple(k) for part in chosen.values() for k in part.indices.tolist()}
    indices = np.array(sorted(union, key=lambda k: (sum(k), k)), dtype=np.int64)
    position = {tuple(k): i for i, k in enumerate(indices.tolist())}
    padded = {}
    for name, part in chosen.items():
        padded[name] = np.zeros((len(indices), part.coefficients.shape[1]))
        padded[name][[position[tuple(k)] for k in part.indices.tolist()]] = part.coefficients
    return indices, padded
