"""How well markers can tell a push at all: the bound of Cramer and Rao, with what is known before (van Trees,
*Detection, Estimation, and Modulation Theory*, 1968, section 2.4), for a robot that stands at one state meanwhile.

With J the derivative of all that a frame measures, each over its standard deviation, by the actuators' displacements
and the forces, no estimate is on average nearer than the covariance P that a filter ends with whose model is right:

    P <- (P^-1 + J^T J)^-1 in each frame        P <- F P F^T + Q from frame to frame

(F and Q: `cfem.predict.estimation.filter`). Where J hardly tells two unknowns apart, many frames are needed, whatever
the estimator does."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from cfem.predict.estimation.estimate import Estimator

MOST = 10_000  # frames that are looked ahead


@dataclass(frozen=True)
class Seen:
    """What the frames of a filter see, as standard deviations.

    slip: mm, of the actuators from frame to frame
    offset: mm, distance of the actuators from their first command
    ticks: frames for which a load lasts
    sensed, forces: whether the actuators' displacements and forces are measured
    """

    slip: float
    offset: float
    ticks: float = np.inf
    sensed: bool = False
    forces: bool = False


def push_errors(estimator: Estimator, delta_a: np.ndarray, seen: Seen) -> Iterator[float]:
    """Yields, after each frame, the least expected error of the push: root mean square over its size before anything
    was measured. delta_a (n_a,) mm: where the robot stands."""
    n_a, information = len(delta_a), frame_information(estimator, delta_a, seen)
    loads, keeps = estimator.load_covariance, np.exp(-1.0 / seen.ticks)
    size = np.r_[np.full(n_a, seen.offset), np.sqrt(np.diag(loads))]  # in whose units nothing depends on units
    across = np.outer(size, size)
    P, Q = np.zeros_like(across), np.zeros_like(across)
    P[range(n_a), range(n_a)], Q[range(n_a), range(n_a)] = 1.0, (seen.slip / seen.offset) ** 2
    P[n_a:, n_a:] = loads / across[n_a:, n_a:]
    Q[n_a:, n_a:] = (1 - keeps**2) * P[n_a:, n_a:]
    F, information = np.r_[np.ones(n_a), np.full(len(loads), keeps)], information * across
    while True:
        P = np.linalg.solve(np.eye(len(P)) + P @ information, P)
        yield float(np.sqrt(np.trace(P[n_a:, n_a:] * across[n_a:, n_a:]) / np.trace(loads)))
        P = (P + P.T) / 2 * np.outer(F, F) + Q


def push_error(estimator: Estimator, delta_a: np.ndarray, seen: Seen, frames: int) -> float:
    """The least expected error of the push after so many frames, at least 1; as in `push_errors`."""
    return next(islice(push_errors(estimator, delta_a, seen), frames - 1, None))


def frames_for(estimator: Estimator, delta_a: np.ndarray, seen: Seen, share: float) -> int | None:
    """Number of frames after which the push is known to a share of its size; None where that takes more than MOST."""
    errors = islice(push_errors(estimator, delta_a, seen), MOST)
    return next((number for number, error in enumerate(errors, 1) if error <= share), None)


def frame_information(estimator: Estimator, delta_a: np.ndarray, seen: Seen) -> np.ndarray:
    """Information (n, n), J^T J, of one frame, without forces on the robot."""
    n_a, w = len(delta_a), np.zeros(len(estimator.loaded))
    parts = [estimator.marker_series(delta_a, w)[1] / estimator.noise]
    if seen.sensed:
        parts.append(np.eye(n_a, n_a + len(w)) / estimator.sensor)
    if seen.forces:
        parts.append(estimator.tension_series(delta_a, w)[1] / estimator.tension)
    J = np.vstack(parts)
    return J.T @ J
