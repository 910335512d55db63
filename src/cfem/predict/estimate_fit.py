"""The least-squares problem of one estimate: markers, sensors and what is known before, and its minimum.

Where all markers fit, that is Gauss and Newton's in a few steps, within a box: far beyond its data the model means
nothing. Where some do not, steps with weights that leave them out begin at a state near which half of the markers are
seen; then the marker without which the fit gets best is left out, again and again, as geodesy does it (Baarda, *A
testing procedure for use in geodetic networks*, 1968). More than half of the markers must fit. The number of steps is
bounded."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

FIRST, LEVELS, LAST = 12, 12, 8  # iterations: with all markers, with weights, with those that fit
TOLERANCE = 1e-5  # of each unknown's scale: the next step
OUTLIER = 4.0  # standard deviations at which a marker counts a quarter
FIT = 2.57  # standard deviations of a coordinate, root mean square of three: 1 in 5000 true markers is farther


class EstimateStatus(Enum):
    """How it ended; the value is the sentence that the user reads."""

    CONVERGED = "converged"
    ITERATIONS = "the estimate keeps changing: the iterations allowed were used up"
    TOO_FEW = "fewer numbers are measured than are unknown"
    REJECTED = "the frame does not fit what was known before it"
    OUTLIERS = "half of the markers do not fit the others; look at their noise, their places and the frame"


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

    def sizes(self, x: np.ndarray) -> np.ndarray:
        """(m,) standard deviations of a coordinate by which each marker misses."""
        return np.sqrt((self.missing(x)[0] ** 2).sum(axis=1) / 3)

    def __call__(self, x: np.ndarray, kept: np.ndarray, weight: np.ndarray | None = None) -> "Evaluated":
        """kept (m,): markers that count; weight: of each of these, 1 unless given."""
        r, J = self.missing(x)
        r, J = r[kept], J[kept]
        size = np.sqrt((r * r).sum(axis=1) / 3)
        if weight is not None:
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
        return Evaluated(x, np.concatenate(rs), np.concatenate(Js), size)


@dataclass(frozen=True)
class Evaluated:
    """r, J: all residuals and their derivative; size: of each marker that counts, in standard deviations of a
    coordinate."""

    x: np.ndarray
    r: np.ndarray
    J: np.ndarray
    size: np.ndarray


@dataclass(frozen=True)
class Minimum:
    """kept (m,): markers that fit; r, J: residuals of those, sensors and what was known, at x."""

    status: EstimateStatus
    x: np.ndarray
    r: np.ndarray
    J: np.ndarray
    kept: np.ndarray
    iterations: int

    @property
    def innovation(self) -> tuple[float, int]:
        """The sum of squares, which is nu^T S^-1 nu of what was missed before (nu, of covariance S), and of how many
        numbers."""
        return float(self.r @ self.r), len(self.r) - len(self.x)


def minimise(
    problem: Residuals, x: np.ndarray, scale: np.ndarray, box: np.ndarray, elsewhere: Callable[[], np.ndarray]
) -> Minimum:
    """From a first guess x (n,), within box (n, 2); scale (n,): of the unknowns; elsewhere: gives a state near which
    half of the markers are seen. Never raises for what the numbers are."""
    kept = problem.there.copy()
    here = problem(np.clip(x, *box.T), kept)
    if len(here.r) < len(x):
        return Minimum(EstimateStatus.TOO_FEW, here.x, here.r, here.J, kept, 0)
    here, iterations, done = _descend(problem, here, scale, box, kept, FIRST)
    if (done or not kept.any()) and _fits(here.size):
        return Minimum(_status(done), here.x, here.r, here.J, kept, iterations)
    least = int(kept.sum()) // 2 + 1
    x, more = _weighted(problem, np.clip(elsewhere(), *box.T), scale, box)
    kept = problem.there & (problem.sizes(x) < 2 * OUTLIER)
    iterations += more
    while int(kept.sum()) >= least:
        here, more, done = _descend(problem, problem(x, kept), scale, box, kept, LAST)
        x, iterations = here.x, iterations + more
        if _fits(here.size):
            return Minimum(_status(done), x, here.r, here.J, kept, iterations)
        kept[np.flatnonzero(kept)[_worst(here, scale)]] = False
    here = problem(x, problem.there)
    return Minimum(EstimateStatus.OUTLIERS, x, here.r, here.J, problem.there, iterations)


def _weighted(problem: Residuals, x: np.ndarray, scale: np.ndarray, box: np.ndarray) -> tuple[np.ndarray, int]:
    """Gauss and Newton's steps from x with weights of Geman and McClure (1987), by which a marker counts less the
    farther it is off; the distance that is far comes down from step to step."""
    bound, count = np.inf, 0
    while count < LEVELS and bound > OUTLIER:
        size = problem.sizes(x)[problem.there]
        bound = max(OUTLIER, min(bound / 2, 3.0 * float(np.median(size))))
        here = problem(x, problem.there, 1.0 / (1.0 + (size / bound) ** 2) ** 2)
        x, count = np.clip(x - scale * _step(here, scale, 1e-6), *box.T), count + 1
    return x, count


def _descend(
    problem: Residuals, here: Evaluated, scale: np.ndarray, box: np.ndarray, kept: np.ndarray, most: int
) -> tuple[Evaluated, int, bool]:
    """Levenberg-Marquardt until the next step would be below the tolerance, relative to scale, by the rate at which
    undamped ones fall; how many steps, and whether."""
    damping, cost, count, before = 1e-6, float(here.r @ here.r), 0, np.inf
    while count < most:
        count += 1
        trial = problem(np.clip(here.x - scale * _step(here, scale, damping), *box.T), kept)
        step, new = np.abs((trial.x - here.x) / scale).max(), float(trial.r @ trial.r)
        if not new <= cost * (1 + 1e-12):
            damping, before = damping * 100, np.inf
            if damping < 1e8:
                continue
            return here, count, True
        here, cost, damping = trial, new, max(damping / 100, 1e-12)
        if step * (min(step / before, 1.0) if before < np.inf else 1.0) <= TOLERANCE:
            return here, count, True
        before = step if damping < 1e-5 else np.inf
    return here, count, False


def _step(here: Evaluated, scale: np.ndarray, damping: float) -> np.ndarray:
    scaled = here.J * scale
    normal = scaled.T @ scaled
    diagonal = np.diagonal(normal)
    normal = normal + np.diag(damping * diagonal + 1e-12 * max(1.0, float(diagonal.max())))
    return np.linalg.solve(normal, scaled.T @ here.r)


def _worst(here: Evaluated, scale: np.ndarray) -> int:
    """Number of the marker, among those that count, without which the sum of squares falls most: r (I - H)^-1 r of its
    three residuals, H = J N^-1 J^T their leverage."""
    scaled = here.J * scale
    normal = scaled.T @ scaled
    inverse = np.linalg.inv(normal + 1e-9 * np.diag(np.maximum(np.diagonal(normal), 1.0)))
    count = len(here.size)
    r, J = here.r[: 3 * count].reshape(-1, 3), scaled[: 3 * count].reshape(count, 3, -1)
    left = (1 + 1e-9) * np.eye(3) - J @ inverse @ J.swapaxes(1, 2)
    return int(np.argmax(np.einsum("mi,mi->m", r, np.linalg.solve(left, r[..., None])[..., 0])))


def _status(done: bool) -> EstimateStatus:
    return EstimateStatus.CONVERGED if done else EstimateStatus.ITERATIONS


def _fits(size: np.ndarray) -> bool:
    return not len(size) or float(size.max()) < FIT
