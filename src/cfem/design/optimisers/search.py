"""The best design by one number: a grid, then gradients from its best points.

    minimise t    subject to    s . f_hat(z) - t <= 0 for every row s of S,    g(z) >= 0,    0 <= z <= 1

with f_hat the objectives between 0 and 1 on the grid. One row of weights is a weighted sum; the unit rows, shifted by a
reference point, are the scalarisation of Pascoletti and Serafini (J. Optim. Theory Appl. 42, 1984), which reaches
every point of a front, also where it is not convex. Solved by SLSQP (Kraft 1988)."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from cfem.core.errors import NumericalError, SpecError
from cfem.design.problem import DesignProblem, Scores
from cfem.design.spec import Scattered

_FEASIBLE = 1e-7
_SCATTERED_APART = 0.25  # of a range: scattered designs that count as different starts
AT_ONCE = 5000  # designs of one batch
LARGEST_GRID = 1_000_000  # designs


@dataclass(frozen=True)
class Grid:
    """First designs, judged.

    shape: (n,) points along each parameter, empty where designs are scattered
    z, scores: (m, n), and of all
    low, width: (n_f,) smallest objective among the feasible, and how far they spread"""

    shape: tuple[int, ...]
    z: np.ndarray
    scores: Scores
    low: np.ndarray
    width: np.ndarray

    def hat(self, objectives: np.ndarray) -> np.ndarray:
        """Objectives (..., n_f) scaled to between 0 and 1 on the feasible grid."""
        return (objectives - self.low) / self.width


@dataclass(frozen=True)
class Scalar:
    """A blend of objectives into one: max_k (weights_k . f_hat - shift_k)."""

    weights: np.ndarray  # (r, n_f)
    shift: np.ndarray  # (r,)

    @classmethod
    def weighted(cls, weights: np.ndarray) -> "Scalar":
        return cls(np.asarray(weights, float)[None], np.zeros(1))

    def __call__(self, hat: np.ndarray) -> np.ndarray:
        """Blends (m,) of scaled objectives (m, n_f)."""
        return (hat @ self.weights.T - self.shift).max(axis=-1)


@dataclass(frozen=True)
class Design:
    """Design that a search has found.

    z, objectives, constraints: (n,), (n_f,) and (n_g,)
    value: of what was minimised
    iterations: of the gradient search from the start that won
    message: of how it ended"""

    z: np.ndarray
    objectives: np.ndarray
    constraints: np.ndarray
    value: float
    iterations: int
    message: str


def first_designs(problem: DesignProblem, grid: Any) -> Grid:
    """First designs as design.yaml asks: points along each parameter, one number or a list, or a number of scattered
    designs. SpecError where a grid has another number of parameters, or far too many designs."""
    if isinstance(grid, Scattered):
        return evaluate_scattered(problem, grid.designs)
    n = len(problem.free)
    shape = [grid] * n if isinstance(grid, int) else list(grid)
    if len(shape) != n:
        raise SpecError(
            f"has {len(shape)} numbers of points, and {n} parameters vary",
            where="grid",
            do="give one number per parameter",
        )
    if prod(shape) > LARGEST_GRID:
        what = f"has {prod(shape):.1e} designs, of {n} parameters"
        raise SpecError(what, where="grid", do="scatter them: grid: {designs: 10000}")
    return evaluate_grid(problem, shape)


def evaluate_grid(problem: DesignProblem, shape: Sequence[int]) -> Grid:
    """Designs on a grid over the ranges. NumericalError where no point satisfies the constraints."""
    axes = [np.linspace(0, 1, count) if count > 1 else np.array([0.5]) for count in shape]
    return _evaluated(problem, tuple(shape), np.array(list(product(*axes))))


def evaluate_scattered(problem: DesignProblem, count: int) -> Grid:
    """Grid of designs that lie evenly scattered, and their middle."""
    n = len(problem.free)
    spread = qmc.Sobol(n, rng=np.random.default_rng(0)).random_base2(max(int(np.ceil(np.log2(count))), 1))
    return _evaluated(problem, (), np.vstack([np.full((1, n), 0.5), spread[: count - 1]]))


def _evaluated(problem: DesignProblem, shape: tuple[int, ...], z: np.ndarray) -> Grid:
    parts = [problem(z[first : first + AT_ONCE]) for first in range(0, len(z), AT_ONCE)]
    scores = Scores(*(np.concatenate(part) for part in zip(*parts, strict=True)))
    return judged(problem, shape, z, scores)


def judged(problem: DesignProblem, shape: tuple[int, ...], z: np.ndarray, scores: Scores) -> Grid:
    """Designs z (m, n) with their scores. NumericalError where none satisfies the constraints."""
    good = scores.objectives[scores.feasible]
    if not len(good):
        least = scores.constraints.max(axis=0)
        names = [name for name, slack in zip(problem.constraints, least, strict=True) if slack < 0] or [
            *problem.constraints
        ]
        raise NumericalError(
            f"none of the {len(z)} designs tried first satisfies the constraints {', '.join(names)}",
            do="relax them, or try more",
        )
    width = good.max(axis=0) - good.min(axis=0)
    return Grid(shape, z, scores, good.min(axis=0), np.where(width > 0, width, 1.0))


def best(
    problem: DesignProblem, grid: Grid, scalar: Scalar, starts: int = 3, near: Sequence[np.ndarray] = ()
) -> Design:
    """Best design from the best feasible points of the grid that lie apart, and from those `near` (n,)."""
    designs = [refine(problem, grid, scalar, z) for z in [*near, *starts_apart(grid, scalar, starts)]]
    return min(designs, key=lambda design: design.value)


def refine(
    problem: DesignProblem,
    grid: Grid,
    scalar: Scalar,
    start: np.ndarray,
    within: tuple[np.ndarray, np.ndarray] | None = None,
    from_outside: bool = False,
) -> Design:
    """Design refined by gradients from a feasible start (n,); the start itself where they lead nowhere better. within:
    ends (n,) of the search, all of the ranges unless given. from_outside: the start violates constraints, so that any
    design that satisfies them, or violates them by less, is better."""
    n_f, n = len(problem.objectives), len(start)
    low, high = (np.zeros(n), np.ones(n)) if within is None else within
    seen: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def values_at(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        key = z.tobytes()
        if key not in seen:
            seen[key] = problem.with_slopes(z)
        return seen[key]

    def slack(v: np.ndarray) -> np.ndarray:
        values, _ = values_at(v[:n])
        return np.concatenate([v[n] - (scalar.weights @ grid.hat(values[:n_f]) - scalar.shift), values[n_f:] / scale])

    def slack_slopes(v: np.ndarray) -> np.ndarray:
        _, slopes = values_at(v[:n])
        rows = -scalar.weights @ (slopes[:n_f] / grid.width[:, None])
        rows = np.hstack([rows, np.ones((len(rows), 1))])
        of_constraints = np.hstack([slopes[n_f:] / scale[:, None], np.zeros((len(slopes) - n_f, 1))])
        return np.vstack([rows, of_constraints])

    first, slopes = values_at(start)
    scale = np.maximum(np.abs(slopes[n_f:]).max(axis=1, initial=0.0), 1e-12)
    begin = Design(start, first[:n_f], first[n_f:], float(scalar(grid.hat(first[None, :n_f]))[0]), 0, "the start")
    gradient = np.append(np.zeros(n), 1.0)
    answer = minimize(
        lambda v: v[n],
        np.append(start, begin.value),
        jac=lambda v: gradient,
        bounds=[*zip(low, high, strict=True), (None, None)],
        constraints={"type": "ineq", "fun": slack, "jac": slack_slopes},
        method="SLSQP",
        options={"maxiter": 100, "ftol": 1e-10},
    )
    z = np.clip(answer.x[:n], low, high)
    values, _ = values_at(z)
    value = float(scalar(grid.hat(values[None, :n_f]))[0])
    least, before = ((slacks / scale).min(initial=0.0) for slacks in (values[n_f:], first[n_f:]))
    better = least > before if from_outside else least >= -_FEASIBLE and value < begin.value
    if not better:
        return begin
    return Design(z, values[:n_f], values[n_f:], value, int(answer.nit), answer.message)


def starts_apart(grid: Grid, scalar: Scalar, count: int) -> list[np.ndarray]:
    """Best feasible points of the grid of which no two are neighbours."""
    feasible = np.flatnonzero(grid.scores.feasible)
    order = feasible[np.argsort(scalar(grid.hat(grid.scores.objectives[feasible])), kind="stable")]
    gap = 1.5 / max(min(max(points - 1, 1) for points in grid.shape), 1) if grid.shape else _SCATTERED_APART
    chosen: list[np.ndarray] = []
    for index in order:
        if all(np.abs(grid.z[index] - start).max() > gap for start in chosen):
            chosen.append(grid.z[index])
        if len(chosen) == count:
            break
    return chosen
