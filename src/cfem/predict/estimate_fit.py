"""The least-squares problem of one estimate: markers, sensors and what is known before, and its minimum.

Where all markers fit, that is Gauss and Newton's in a few steps. Where some do not, weights of Geman and McClure (1987)
leave them out: far from the answer every marker is an outlier, so the distance from which one counts as such comes
down as the fit gets better, and the markers that are left then count in full."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

ITERATIONS = 50
TOLERANCE = 1e-5  # of each unknown's scale: the last step
POLISH = 2  # last steps, by the markers that fit alone
OUTLIER = 4.0  # standard deviations at which a marker counts a quarter
KEPT = 0.5  # weight above which a marker fits


class EstimateStatus(Enum):
    """How it ended; the value is the sentence that the user reads."""

    CONVERGED = "converged"
    ITERATIONS = "the estimate keeps changing: the iterations allowed were used up"
    TOO_FEW = "fewer numbers are measured than are unknown"


@dataclass(frozen=True)
class Known:
    """What is known of the unknowns before anything is measured: root (x - mean) has standard deviation 1. mean (n,);
    root (p, n), its zero columns those of which nothing is known."""

    mean: np.ndarray
    root: np.ndarray


# x (n,) -> what markers miss over their noise (m, 3), and its derivative (m, 3, n)
Missing = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Sensor:
    """of: x (n,) -> what it shows (k,), and its derivative (k, n); measured (k,), sd: its standard deviation; there
    (k,): which of them were measured."""

    of: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    measured: np.ndarray
    sd: float
    there: np.ndarray

    def missing(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Over the standard deviation, and its derivative."""
        shown, by_x = self.of(x)
        return (shown - self.measured)[self.there] / self.sd, by_x[self.there] / self.sd


@dataclass(frozen=True)
class Residuals:
    """missing: of the markers; there (m,): which were measured."""

    missing: Missing
    there: np.ndarray
    known: Known
    sensors: tuple[Sensor, ...] = ()

    def __call__(self, x: np.ndarray, bound: float = np.inf, kept: np.ndarray | None = None) -> "Evaluated":
        """bound: standard deviations from which markers lose weight; kept (m,): those that count, all unless given."""
        r, J = self.missing(x)
        there = self.there if kept is None else kept
        r, J = r[there], J[there]
        size = np.sqrt((r * r).sum(axis=1) / 3)
        weight = np.ones(len(size)) if np.isinf(bound) else 1.0 / (1.0 + (size / bound) ** 2) ** 2
        if not np.isinf(bound):
            root = np.sqrt(weight)[:, None]
            r, J = r * root, J * root[..., None]
        rs, Js = [r.ravel()], [J.reshape(-1, len(x))]
        if len(self.known.root):
            rs.append(self.known.root @ (x - self.known.mean))
            Js.append(self.known.root)
        for sensor in self.sensors:
            r, J = sensor.missing(x)
            rs.append(r)
            Js.append(J)
        return Evaluated(x, np.concatenate(rs), np.concatenate(Js), size, weight)


@dataclass(frozen=True)
class Evaluated:
    """r, J: all residuals and their derivative; size, weight: of each marker that was asked for, its size in standard
    deviations of one coordinate."""

    x: np.ndarray
    r: np.ndarray
    J: np.ndarray
    size: np.ndarray
    weight: np.ndarray


@dataclass(frozen=True)
class Minimum:
    """kept (m,): markers that fit; r, J: residuals of those, sensors and what was known, at x."""

    status: EstimateStatus
    x: np.ndarray
    r: np.ndarray
    J: np.ndarray
    kept: np.ndarray
    iterations: int


def minimise(problem: Residuals, x: np.ndarray, scale: np.ndarray) -> Minimum:
    """From a first guess x (n,); scale (n,): of the unknowns. Never raises for what the numbers are."""
    there, here = problem.there, problem(x)
    if len(here.r) < len(x):
        return Minimum(EstimateStatus.TOO_FEW, x, here.r, here.J, there, 0)
    here, iterations, done = _descend(problem, here, scale, np.inf, TOLERANCE, ITERATIONS)
    kept = there.copy()
    bound = float(3.0 * np.median(here.size)) if len(here.size) else OUTLIER
    if _fits(here.size):
        return Minimum(_status(done), here.x, here.r, here.J, kept, iterations)
    while iterations < ITERATIONS:
        bound = max(bound, OUTLIER)
        rough = bound > OUTLIER
        here = problem(here.x, bound)
        here, more, done = _descend(problem, here, scale, bound, 1e-3 if rough else TOLERANCE, ITERATIONS - iterations)
        iterations += more
        if not rough:
            break
        raw = problem(here.x).size
        bound = OUTLIER if bound <= 4 * OUTLIER else min(bound / 2, float(3.0 * np.median(raw)))
    kept[there] = here.weight > KEPT
    if done:  # the markers that fit, each in full: so that the covariance is theirs
        for _ in range(POLISH):
            near = problem(here.x, kept=kept)
            here = problem(near.x - _step(near, scale, 0.0) * scale, kept=kept)
    here = problem(here.x, kept=kept)
    return Minimum(_status(done), here.x, here.r, here.J, kept, iterations)


def _descend(
    problem: Residuals, here: Evaluated, scale: np.ndarray, bound: float, tolerance: float, most: int
) -> tuple[Evaluated, int, bool]:
    """Levenberg-Marquardt until the step is below the tolerance, relative to scale; how many steps, and whether."""
    damping, cost, count = 1e-6, float(here.r @ here.r), 0
    while count < most:
        count += 1
        step = _step(here, scale, damping)
        trial = problem(here.x - scale * step, bound)
        new = float(trial.r @ trial.r)
        stuck = not new <= cost * (1 + 1e-12)
        if stuck:
            damping *= 100
            if damping < 1e8:
                continue
            return here, count, True
        here, cost, damping = trial, new, max(damping / 100, 1e-12)
        if np.abs(step).max() <= tolerance:
            return here, count, True
    return here, count, False


def _step(here: Evaluated, scale: np.ndarray, damping: float) -> np.ndarray:
    scaled = here.J * scale
    normal = scaled.T @ scaled
    diagonal = np.diagonal(normal)
    normal = normal + np.diag(damping * diagonal + 1e-12 * max(1.0, float(diagonal.max())))
    return np.linalg.solve(normal, scaled.T @ here.r)


def _fits(size: np.ndarray) -> bool:
    """Whether no marker would lose more than half of its weight."""
    return not len(size) or float(size.max()) < OUTLIER * np.sqrt(KEPT**-0.5 - 1.0)


def _status(done: bool) -> EstimateStatus:
    return EstimateStatus.CONVERGED if done else EstimateStatus.ITERATIONS
