"""The least-squares problem of one estimate: markers, sensors and what is known before, and its minimum.

Where all markers fit, that is Gauss and Newton's in a few steps, within a box: far beyond its data the model means
nothing. Where some do not, steps with weights that leave them out begin at a state near which half of the markers are
seen; then the marker without which the fit gets best is left out, again and again, as geodesy does it (Baarda, *A
testing procedure for use in geodetic networks*, 1968). More than half of the markers must fit. The number of steps is
bounded."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

FIRST, LEVELS, LAST = 12, 12, 8  # iterations: with all markers, with weights, with those that fit
TOLERANCE = 1e-5  # of each unknown's scale: the next step
DAMPING = 1e-6  # Levenberg's, of the first step
OUTLIER = 4.0  # standard deviations at which a marker counts a quarter
FIT = 2.57  # standard deviations of a coordinate, root mean square of three: 1 in 5000 true markers is farther


class EstimateStatus(Enum):
    """How an estimate ended; the value is the sentence that the user reads."""

    CONVERGED = "converged"
    ITERATIONS = "the estimate keeps changing: the iterations allowed were used up"
    TOO_FEW = "fewer numbers are measured than are unknown"
    REJECTED = "the frame does not fit what was known before it"
    OUTLIERS = "half of the markers do not fit the others; look at their noise, their places and the frame"


# x (n,) -> a vector, and its derivative by x
Function = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Prior:
    """The distribution of the unknowns before anything is measured: root (x - mean) has standard deviation 1.

    mean: (n,)
    root: (p, n), zero columns for unknowns of which nothing is known
    """

    mean: np.ndarray
    root: np.ndarray


@dataclass(frozen=True)
class Sensor:
    """A measurement without outliers.

    function: x (n,) -> what the sensor shows (k,), and its derivative (k, n)
    measured: (k,)
    sd: standard deviation of its noise
    valid: (k,) which of its numbers were measured
    """

    function: Function
    measured: np.ndarray
    sd: float
    valid: np.ndarray

    def residual(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals of the valid numbers over the standard deviation, and their derivative by x."""
        shown, by_x = self.function(x)
        return (shown - self.measured)[self.valid] / self.sd, by_x[self.valid] / self.sd


@dataclass(frozen=True)
class Markers:
    """Measured places, of which some may be wrong.

    residual: x (n,) -> residuals over the noise (m, 3), and their derivative (m, 3, n)
    seen: (m,) which of them were measured
    """

    residual: Function
    seen: np.ndarray


@dataclass(frozen=True)
class FitResiduals:
    """All residuals of one estimate: of markers, of the prior and of sensors."""

    markers: Markers
    prior: Prior
    sensors: tuple[Sensor, ...] = ()

    def sizes(self, x: np.ndarray) -> np.ndarray:
        """Root mean square (m,) of each marker's coordinates, in standard deviations."""
        return np.sqrt((self.markers.residual(x)[0] ** 2).sum(axis=1) / 3)

    def __call__(self, x: np.ndarray, kept: np.ndarray, weight: np.ndarray | None = None) -> "Evaluated":
        """Residuals and derivatives at x (n,); kept (m,): markers that count; weight: of each of these, 1 unless
        given."""
        r, J = self.markers.residual(x)
        r, J = r[kept], J[kept]
        size = np.sqrt((r * r).sum(axis=1) / 3)
        if weight is not None:
            root = np.sqrt(weight)[:, None]
            r, J = r * root, J * root[..., None]
        rs, Js = [r.ravel()], [J.reshape(-1, len(x))]
        if len(self.prior.root):
            rs.append(self.prior.root @ (x - self.prior.mean))
            Js.append(self.prior.root)
        for sensor in self.sensors:
            r, J = sensor.residual(x)
            rs.append(r)
            Js.append(J)
        return Evaluated(x, np.concatenate(rs), np.concatenate(Js), size)


@dataclass(frozen=True)
class Evaluated:
    """Residuals at one point.

    x: (n,)
    r, J: all residuals and their derivative
    size: of each marker that counts, root mean square in standard deviations of a coordinate
    """

    x: np.ndarray
    r: np.ndarray
    J: np.ndarray
    size: np.ndarray


@dataclass(frozen=True)
class Search:
    """Where and how long a minimum is looked for.

    scale: (n,) how large each unknown becomes
    box: (n, 2) bounds of the unknowns
    tolerance: of each unknown's scale; a step below it ends the iterations
    iterations: at most, before wrong markers are looked for
    """

    scale: np.ndarray
    box: np.ndarray
    tolerance: float = TOLERANCE
    iterations: int = FIRST

    def bounded(self, x: np.ndarray) -> np.ndarray:
        """Point x (n,) moved into the box."""
        return np.clip(x, *self.box.T)


@dataclass(frozen=True)
class Minimum:
    """Where the sum of squares is least.

    x: (n,)
    r, J: residuals of markers that fit, prior and sensors at x, and their derivative
    kept: (m,) markers that fit
    seen: (m,) markers that were measured
    """

    status: EstimateStatus
    x: np.ndarray
    r: np.ndarray
    J: np.ndarray
    kept: np.ndarray
    seen: np.ndarray = field(repr=False)
    iterations: int = 0

    @property
    def converged(self) -> bool:
        """True where the minimum may be carried forward."""
        return self.status is EstimateStatus.CONVERGED and bool(np.isfinite(self.J).all())

    @property
    def misfit(self) -> tuple[float, int]:
        """The sum of squares, which is nu^T S^-1 nu of the innovation nu with covariance S, and its degrees of
        freedom."""
        return float(self.r @ self.r), len(self.r) - len(self.x)

    @property
    def innovation(self) -> tuple[float, int]:
        """The misfit for the gate: infinite without an answer, and nothing to judge where too little was measured."""
        if self.status is EstimateStatus.TOO_FEW:
            return 0.0, 0
        return self.misfit if self.converged else (np.inf, 1)

    @property
    def outliers(self) -> tuple[int, ...]:
        """Numbers of the markers that do not fit."""
        return tuple(int(number) for number in np.flatnonzero(self.seen & ~self.kept))

    @property
    def noise(self) -> float:
        """Root mean square of the residuals of markers that fit, in standard deviations; 0 without markers."""
        residuals = self.r[: 3 * int(self.kept.sum())]
        return float(np.sqrt(np.mean(residuals**2))) if len(residuals) else 0.0

    def covariance(self, scale: np.ndarray, least: float = 0.0) -> np.ndarray:
        """Covariance (n, n), the inverse of J^T J; least: information on each unknown over its scale (n,), added so
        that the inverse exists where nothing was measured of an unknown."""
        scaled = self.J * scale
        return np.linalg.inv(scaled.T @ scaled + least * np.eye(len(scale))) * np.outer(scale, scale)


def minimise(problem: FitResiduals, x: np.ndarray, search: Search, elsewhere: Callable[[], np.ndarray]) -> Minimum:
    """The minimum from a first guess x (n,); elsewhere: gives a state near which half of the markers are seen.

    Never raises for what the numbers are: the status says how it ended."""
    seen = problem.markers.seen
    kept = seen.copy()
    point = problem(search.bounded(x), kept)
    if len(point.r) < len(x):
        return Minimum(EstimateStatus.TOO_FEW, point.x, point.r, point.J, kept, seen)
    point, iterations, done = _descend(problem, point, search, kept, search.iterations)
    if (done or not kept.any()) and _fits(point.size):
        return Minimum(_status(done), point.x, point.r, point.J, kept, seen, iterations)
    least = int(kept.sum()) // 2 + 1
    x, more = _weighted(problem, search.bounded(elsewhere()), search)
    kept = seen & (problem.sizes(x) < 2 * OUTLIER)
    iterations += more
    while int(kept.sum()) >= least:
        point, more, done = _descend(problem, problem(x, kept), search, kept, LAST)
        x, iterations = point.x, iterations + more
        if _fits(point.size):
            return Minimum(_status(done), x, point.r, point.J, kept, seen, iterations)
        kept[np.flatnonzero(kept)[_worst(point, search.scale)]] = False
    point = problem(x, seen)
    return Minimum(EstimateStatus.OUTLIERS, x, point.r, point.J, seen, seen, iterations)


def _weighted(problem: FitResiduals, x: np.ndarray, search: Search) -> tuple[np.ndarray, int]:
    """State after Gauss and Newton's steps from x in which markers count less the farther they are off, and the number
    of steps. The outlier distance shrinks at each step (Geman and McClure, 1987)."""
    bound, count = np.inf, 0
    while count < LEVELS and bound > OUTLIER:
        size = problem.sizes(x)[problem.markers.seen]
        bound = max(OUTLIER, min(bound / 2, 3.0 * float(np.median(size))))
        point = problem(x, problem.markers.seen, 1.0 / (1.0 + (size / bound) ** 2) ** 2)
        x, count = search.bounded(x - search.scale * _step(point, search.scale, DAMPING)), count + 1
    return x, count


def _descend(
    problem: FitResiduals, point: Evaluated, search: Search, kept: np.ndarray, most: int
) -> tuple[Evaluated, int, bool]:
    """Levenberg-Marquardt from `point`, at most `most` steps: the last point, the number of steps, and whether it
    converged. It ends where the next step would be below the tolerance, by the rate at which undamped steps shrink."""
    damping, cost, count, before = DAMPING, float(point.r @ point.r), 0, np.inf
    while count < most:
        count += 1
        trial = problem(search.bounded(point.x - search.scale * _step(point, search.scale, damping)), kept)
        step, new = np.abs((trial.x - point.x) / search.scale).max(), float(trial.r @ trial.r)
        if not new <= cost * (1 + 1e-12):
            damping, before = damping * 100, np.inf
            if damping < 1e8:
                continue
            return point, count, True
        point, cost, damping = trial, new, max(damping / 100, 1e-12)
        if step * (min(step / before, 1.0) if before < np.inf else 1.0) <= search.tolerance:
            return point, count, True
        before = step if damping < 1e-5 else np.inf
    return point, count, False


def _step(point: Evaluated, scale: np.ndarray, damping: float) -> np.ndarray:
    """Step (n,) over the scale, to be subtracted, of the normal equations with Levenberg's damping."""
    scaled = point.J * scale
    normal = scaled.T @ scaled
    diagonal = np.diagonal(normal)
    normal = normal + np.diag(damping * diagonal + 1e-12 * max(1.0, float(diagonal.max())))
    return np.linalg.solve(normal, scaled.T @ point.r)


def _worst(point: Evaluated, scale: np.ndarray) -> int:
    """Number of the marker, among those that count, without which the sum of squares falls most: r (I - H)^-1 r of its
    three residuals, H = J N^-1 J^T their leverage."""
    scaled = point.J * scale
    normal = scaled.T @ scaled
    inverse = np.linalg.inv(normal + 1e-9 * np.diag(np.maximum(np.diagonal(normal), 1.0)))
    count = len(point.size)
    r, J = point.r[: 3 * count].reshape(-1, 3), scaled[: 3 * count].reshape(count, 3, -1)
    remaining = (1 + 1e-9) * np.eye(3) - J @ inverse @ J.swapaxes(1, 2)
    return int(np.argmax(np.einsum("mi,mi->m", r, np.linalg.solve(remaining, r[..., None])[..., 0])))


def _status(done: bool) -> EstimateStatus:
    return EstimateStatus.CONVERGED if done else EstimateStatus.ITERATIONS


def _fits(size: np.ndarray) -> bool:
    """True where every marker is within FIT standard deviations."""
    return not len(size) or float(size.max()) < FIT
