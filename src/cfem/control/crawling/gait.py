"""A gait: the cyclic command of a leg's actuators, s(phi) = mean + amplitude cos(phi - phase), cut to [0, 1], as a
share of the range that the spec gives. The one is found that carries the crawler farthest in a cycle.

A slow robot that goes back by the way that it came has gone nowhere. How far it gets grows with the area that the cycle
encloses in the space of its actuators, and changes sign with the sense of going round (Shapere and Wilczek, *Geometry
of self-propulsion at low Reynolds number*, 1989). The area costs nothing, so it says which gaits are worth a trial."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

PUSHES = 100.0  # mm/N: what a gait costs whose actuators would have to push
TRIED = 0.25  # of the evaluations: gaits all over; the others improve the best of these
DRAWN = 8  # gaits for each that is tried: the one that encloses most
SIMPLEX = 0.15  # of each range: the first steps of the improvement
FAILED = 1e3  # mm: what a gait costs that cannot be walked


@dataclass(frozen=True)
class Gait:
    """Cyclic command of a leg: mean and amplitude (n_a,) as shares of the pulls, phase (n_a,) in turns."""

    mean: np.ndarray
    amplitude: np.ndarray
    phase: np.ndarray

    @classmethod
    def of(cls, shares: np.ndarray) -> "Gait":
        """Gait of 3 n_a - 1 numbers in [0, 1]; the first phase is 0, as a cycle begins anywhere."""
        n_a = (len(shares) + 1) // 3
        mean, amplitude, phase = shares[:n_a], shares[n_a : 2 * n_a], shares[2 * n_a :]
        return cls(mean, amplitude, np.concatenate([[0.0], phase]))

    def leg(self, steps: int) -> np.ndarray:
        """Shares (steps, n_a) of a cycle."""
        phi = np.arange(1, steps + 1)[:, None] / steps - self.phase
        return np.clip(self.mean + self.amplitude * np.cos(2 * np.pi * phi), 0.0, 1.0)

    def encloses(self, steps: int) -> float:
        """Area of the cycle, of all pairs of actuators together."""
        share = self.leg(steps)
        area = share.T @ np.roll(share, -1, axis=0) / 2
        return float(np.linalg.norm(area - area.T)) / np.sqrt(2)


def commands_of(
    gait: Gait, mirrored: Sequence[bool], pulls: tuple[float, float], steps: int, cycles: int
) -> np.ndarray:
    """Commands (cycles steps, legs n_a) mm of all legs, the mirrored ones with their actuators in reverse order."""
    share = gait.leg(steps)
    both = np.hstack([share[:, ::-1] if turned else share for turned in mirrored])
    return np.tile(pulls[0] + (pulls[1] - pulls[0]) * both, (cycles, 1))


def best_gait(
    distance: Callable[[Gait], tuple[float, float]], n_a: int, steps: int, evaluations: int, seed: int = 1
) -> tuple[Gait, float]:
    """Gait of so many steps that goes farthest, and its distance (mm a cycle). The one that goes farthest backwards is
    tried in reverse as well. distance: of a gait, NaN where it cannot be walked, and the smallest force of an actuator
    (N), where it is below 0. seed: of the gaits that are drawn."""
    n = 3 * n_a - 1

    def cost(shares: np.ndarray) -> float:
        far, least = distance(Gait.of(np.clip(shares, 0.0, 1.0)))
        return -far - PUSHES * least if np.isfinite(far) else FAILED

    first = max(1, int(TRIED * evaluations))
    drawn = qmc.Halton(n, seed=seed).random(first * DRAWN).reshape(first, DRAWN, n)
    tried = np.array([max(few, key=lambda shares: Gait.of(shares).encloses(steps)) for few in drawn])
    costs = np.array([cost(shares) for shares in tried])
    best, back = tried[costs.argmin()], _reversed(tried[np.where(costs < FAILED, costs, 0.0).argmax()], n_a)
    if cost(back) < costs.min():
        best = back
    options = {"maxfev": max(1, evaluations - first - 1), "initial_simplex": _around(best)}
    result = minimize(cost, best, method="Nelder-Mead", bounds=[(0.0, 1.0)] * n, options=options)
    return Gait.of(np.clip(result.x, 0.0, 1.0)), -float(result.fun)


def _reversed(shares: np.ndarray, n_a: int) -> np.ndarray:
    """Shares (n,) of the gait backwards in time, which takes a crawler about as far the other way."""
    return np.concatenate([shares[: 2 * n_a], (1.0 - shares[2 * n_a :]) % 1.0])


def _around(best: np.ndarray) -> np.ndarray:
    """Corners (n + 1, n) of the first simplex, within [0, 1]."""
    steps = np.where(best < 0.5, SIMPLEX, -SIMPLEX)
    return np.vstack([best, best + np.diag(steps)])
