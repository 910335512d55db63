"""The best design by finite elements, found with a model: finite elements correct the model, the model leads.

At a design z both are asked for values and slopes of all objectives and constraints. The corrected model

    m(z') + (f - m)(z) + (grad f - grad m)(z) . (z' - z)

has the values and slopes of finite elements at z. Its best design within |z' - z| <= radius is solved by finite
elements. The ratio of what they gain to what the corrected model promised decides whether the search goes there, and
sets the next radius (approximation and model management: Alexandrov, Dennis, Lewis and Torczon, Struct. Optim. 15,
1998). Such a search ends where finite elements have a first-order optimum, however wrong the model is.

The gain is that of an exact penalty: the objective plus the largest multiplier times what constraints are violated by.
The residual is |grad f - sum_i mu_i grad c_i|, mu_i >= 0 of the constraints and ends of ranges that hold there (by
non-negative least squares, Lawson and Hanson 1974): 0 at an optimum. It is a share of the objective's spread over
the designs, for a whole range of a parameter."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from scipy.optimize import nnls

from cfem.core.errors import NumericalError
from cfem.design.optimisers.search import Grid, Scalar, refine

# Of a slope's size, that is in shares of a range: what a constraint that is active may have to spare, and what one that
# holds may be violated by.
_ACTIVE, _HELD = 1e-4, 1e-5
_SHRINK, _GROW = 0.25, 0.75  # ratios below and above which the radius changes
_SMALLEST, _LEAST_GAIN = 1e-7, 1e-10
_ENDS = 1e-9


class Slopes(Protocol):
    """What both a model's problem and that of finite elements are."""

    objectives: Any
    constraints: Any

    def with_slopes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]: ...


@dataclass(frozen=True)
class TrustRegionSettings:
    """Settings of the trust-region search."""

    radius: float = 0.2  # of the first step, in shares of the ranges
    tolerance: float = 1e-3  # of the residual
    solves: int = 20  # at most, by finite elements, from one start


@dataclass(frozen=True)
class Optimum:
    """Design at which a search by finite elements has ended.

    z, objectives, constraints: (n,), (n_f,) and (n_g,)
    value: of the scalar
    residual: of the first-order conditions
    held: whether the constraints hold
    stationary: whether the residual is below the tolerance
    first: (n_f,) objectives of the start
    solves: number of them
    why: it ended"""

    z: np.ndarray
    objectives: np.ndarray
    constraints: np.ndarray
    value: float
    residual: float
    held: bool
    stationary: bool
    first: np.ndarray
    solves: int
    why: str

    @property
    def certified(self) -> bool:
        """True if it is a first-order optimum by finite elements."""
        return self.held and self.stationary


@dataclass
class _Corrected:
    """The model with the values and slopes of finite elements at z."""

    model: Slopes
    z: np.ndarray
    values: np.ndarray
    slopes: np.ndarray
    objectives: Any = field(init=False)
    constraints: Any = field(init=False)

    def __post_init__(self):
        self.objectives, self.constraints = self.model.objectives, self.model.constraints
        values, slopes = self.model.with_slopes(self.z)
        self._apart, self._turned = self.values - values, self.slopes - slopes

    def with_slopes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, slopes = self.model.with_slopes(z)
        return values + self._apart + self._turned @ (z - self.z), slopes + self._turned


def optimum(
    model: Slopes, exact: Slopes, grid: Grid, weights: np.ndarray, start: np.ndarray, limits: TrustRegionSettings
) -> Optimum:
    """Optimum of the corrected model, by finite elements. weights: (n_f,) of the objectives between 0 and 1 on the
    grid. start: (n,). NumericalError where finite elements do not solve the start."""
    n_f, radius = len(exact.objectives), limits.radius
    scalar = Scalar.weighted(weights)
    z = np.clip(start, 0.0, 1.0)
    values, slopes = exact.with_slopes(z)
    if not np.isfinite(values).all():
        raise NumericalError("finite elements give the start of the search a value that is not finite")
    first, solves, why = values[:n_f], 1, "the solves allowed were used up"
    while True:
        residual, largest = first_order(grid, weights, n_f, z, values, slopes)
        violated = _violation(values[n_f:], slopes[n_f:])
        if residual <= limits.tolerance and violated <= _HELD:
            why = "a first-order optimum"
            break
        if solves >= limits.solves:
            break
        led = _Corrected(model, z, values, slopes)
        low, high = np.maximum(z - radius, 0.0), np.minimum(z + radius, 1.0)
        candidate = refine(led, grid, scalar, z, (low, high), from_outside=violated > 0.1 * _HELD)
        penalty = 2 * max(largest, 1.0)

        def merit(design_values: np.ndarray, penalty: float = penalty, scales: np.ndarray = slopes[n_f:]) -> float:
            objective = float(scalar(grid.hat(design_values[None, :n_f]))[0])
            return objective + penalty * _violation(design_values[n_f:], scales)

        promised = merit(values) - merit(np.concatenate([candidate.objectives, candidate.constraints]))
        if promised <= _LEAST_GAIN or radius < _SMALLEST:
            why = "the corrected model promises no gain" if radius >= _SMALLEST else "the steps became too small"
            break
        try:
            exact_values, turned = exact.with_slopes(candidate.z)
            ratio = (merit(values) - merit(exact_values)) / promised
        except NumericalError:
            ratio = -np.inf
        solves += 1
        step = float(np.abs(candidate.z - z).max())
        if not ratio >= _SHRINK:
            radius = 0.4 * step
        elif ratio > _GROW and step > 0.9 * radius:
            radius = min(2 * radius, 1.0)
        if ratio > 0:
            z, values, slopes = candidate.z, exact_values, turned
    held = violated <= _HELD
    value = float(scalar(grid.hat(values[None, :n_f]))[0])
    return Optimum(
        z, values[:n_f], values[n_f:], value, residual, held, residual <= limits.tolerance, first, solves, why
    )


def best_of(optima: Sequence[Optimum]) -> Optimum:
    """Best of several starts whose constraints hold."""
    return min(optima, key=lambda reached: (not reached.held, reached.value))


def first_order(
    grid: Grid, weights: np.ndarray, n_f: int, z: np.ndarray, values: np.ndarray, slopes: np.ndarray
) -> tuple[float, float]:
    """Residual of the first-order conditions at z, and the largest multiplier of a constraint in units in which its
    slopes have the size 1."""
    gradient = weights @ (slopes[:n_f] / grid.width[:, None])
    scale = _scale(slopes[n_f:])
    active = values[n_f:] / scale <= _ACTIVE
    normals = [*(slopes[n_f:] / scale[:, None])[active]]
    count = len(normals)
    normals += [*np.eye(len(z))[z <= _ENDS], *-np.eye(len(z))[z >= 1 - _ENDS]]
    if not normals:
        return float(np.linalg.norm(gradient)), 0.0
    multipliers, residual = nnls(np.array(normals).T, gradient)
    return float(residual), float(multipliers[:count].max(initial=0.0))


def _scale(slopes: np.ndarray) -> np.ndarray:
    """Scale (n_g,) of each constraint: its largest slope."""
    return np.maximum(np.abs(slopes).max(axis=1, initial=0.0), 1e-12)


def _violation(constraints: np.ndarray, slopes: np.ndarray) -> float:
    """Sum over the constraints, each in units of its slopes (n_g, n)."""
    return float(np.maximum(-constraints / _scale(slopes), 0.0).sum())
