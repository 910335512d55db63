"""Predictions of load cases, with intervals that hold all that is not known (intervals.py)."""

from dataclasses import dataclass

import numpy as np

from cfem.cases.intervals import half_and_radius
from cfem.cases.outcome import Calibrated, widened
from cfem.cases.rig import Rig
from cfem.cases.robots import Posed
from cfem.cases.table import Cases
from cfem.core.errors import NumericalError

_FAR = 1.03


@dataclass(frozen=True)
class Prediction:
    """m cases of k markers: y (m, k, 3) mm places, or displacements where these are compared; half (m, k, 3) mm: half
    of the interval of each coordinate; radius (m, k) mm: distance within which the marker lies; error (m, k, 3) mm
    computed less measured, nan where nothing was measured; failed: number and reason of each case without an
    equilibrium, whose numbers are nan; posed: the robot, in those cases at rest."""

    y: np.ndarray
    half: np.ndarray
    radius: np.ndarray
    error: np.ndarray
    posed: tuple[Posed, ...]
    failed: dict[int, str]

    @property
    def distance(self) -> np.ndarray:
        """(m, k) mm."""
        return np.linalg.norm(self.error, axis=2)

    def covered(self) -> tuple[float, float]:
        """Share of measured coordinates within their intervals, and of markers within their radius."""
        there, whole = np.isfinite(self.error), np.isfinite(self.distance)
        return (
            float((np.abs(self.error) <= self.half)[there].mean()) if there.any() else np.nan,
            float((self.distance <= self.radius)[whole].mean()) if whole.any() else np.nan,
        )


def beyond_calibration(cases: Cases, known: Calibrated) -> np.ndarray:
    """(m,) whether any force is larger, by more than a thirtieth, than all that the calibration knows."""
    if not known.largest:
        return np.zeros(len(cases), dtype=bool)
    return (np.abs(cases.forces) > _FAR * np.array(known.largest) + 1e-12).any(axis=1)


def predict(rig: Rig, cases: Cases, known: Calibrated, confidence: float, beyond: float = 0.0) -> Prediction:
    """beyond: share of its displacement that a coordinate may be off, one sd, where forces are beyond those of the
    calibration, as no case told what the model lacks there."""
    z, d, C = widened(known, rig)
    y = np.full(cases.places.shape, np.nan)
    slopes, posed, failed = np.zeros((*y.shape, len(z) + len(d))), [], {}
    moved = np.zeros(y.shape[:2])
    for i in range(len(cases)):
        try:
            seen = rig.see(cases.only(np.array([i])), z, d)
        except NumericalError as error:
            failed[i] = str(error)
            posed.append(Posed(rig.robots.rest, np.tile(np.eye(3), (len(rig.robots.rest), 1, 1)), rig.robots.robot.X))
            continue
        y[i], slopes[i] = seen.y[0], np.concatenate([seen.by_z, seen.by_d], axis=3)[0]
        moved[i] = seen.moved[0]
        posed.append(seen.posed[0])
    C3 = np.einsum("mkin,no,mkjo->mkij", slopes, C, slopes)
    lacks = beyond * beyond_calibration(cases, known)[:, None] * moved
    C3 = C3 + (known.scatter.variance(moved) + lacks**2)[..., None, None] * np.eye(3)
    half, radius = half_and_radius(C3, known.inflation, known.degrees, confidence)
    half[list(failed)], radius[list(failed)] = np.nan, np.nan
    return Prediction(y, half, radius, y - cases.target, tuple(posed), failed)
