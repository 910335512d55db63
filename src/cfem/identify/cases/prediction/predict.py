"""Predictions of load cases, with intervals that hold all that is not known (fit/prediction_intervals.py)."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed.discrepancy import BEYOND
from cfem.core.errors import NumericalError
from cfem.identify.cases.outcome import Calibrated, widened
from cfem.identify.cases.rig import MarkerPredictions, Rig
from cfem.identify.cases.robots import Pose
from cfem.identify.cases.table import Cases
from cfem.identify.fit.prediction_intervals import half_and_radius, share_covered


@dataclass(frozen=True)
class Prediction:
    """Predictions for m cases of k markers.

    y:      (m, k, 3) mm places, or displacements where these are compared
    half:   (m, k, 3) mm half of the interval of each coordinate
    radius: (m, k) mm distance within which the marker lies
    error:  (m, k, 3) mm computed less measured, nan where nothing was measured
    poses:  of the robot; at rest in failed cases
    failed: number and reason of each case without an equilibrium, whose numbers are nan
    covariance: (m, k, 3, 3) mm^2 of each marker, not inflated"""

    y: np.ndarray
    half: np.ndarray
    radius: np.ndarray
    error: np.ndarray
    poses: tuple[Pose, ...]
    failed: dict[int, str]
    covariance: np.ndarray

    @property
    def distance(self) -> np.ndarray:
        """Distances (m, k) mm of the markers from their predictions."""
        return np.linalg.norm(self.error, axis=2)

    def covered(self) -> tuple[float, float]:
        """Share of measured coordinates within their intervals, and of markers within their radius."""
        return share_covered(self.error, self.half, self.radius)


def beyond_calibration(cases: Cases, known: Calibrated) -> np.ndarray:
    """Mask (m,) of cases with a force larger, by more than a thirtieth, than all that the calibration knows."""
    if not known.largest:
        return np.zeros(len(cases), dtype=bool)
    return (np.abs(cases.forces) > BEYOND * np.array(known.largest) + 1e-12).any(axis=1)


def predict(rig: Rig, cases: Cases, known: Calibrated, confidence: float, beyond: float = 0.0) -> Prediction:
    """Predicts where a calibrated rig sees the markers in other cases. A case without an equilibrium spoils no other.

    beyond: share of its displacement that a coordinate may err by, one sd, where forces are beyond those of the
            calibration, as no case told what the model lacks there"""
    z, d, C = widened(known, rig)
    lacks = beyond * beyond_calibration(cases, known)
    y, half = (np.full(cases.places.shape, np.nan) for _ in range(2))
    radius, poses, failed = np.full(y.shape[:2], np.nan), [], {}
    covariance = np.full((*y.shape, 3), np.nan)
    for i in range(len(cases)):
        try:
            seen: MarkerPredictions = rig.see(cases.only(np.array([i])), z, d)
        except NumericalError as error:
            failed[i] = str(error)
            poses.append(Pose(rig.robots.rest, np.tile(np.eye(3), (len(rig.robots.rest), 1, 1)), rig.robots.robot.X))
            continue
        variance = known.scatter.variance(seen.moved) + (lacks[i] * seen.moved) ** 2
        of_case = seen.covariance(C, variance)
        intervals = half_and_radius(of_case, known.inflation, known.degrees, confidence)
        y[i], half[i], radius[i] = seen.y[0], intervals[0][0], intervals[1][0]
        covariance[i] = of_case[0]
        poses.append(seen.poses[0])
    return Prediction(y, half, radius, y - cases.target, tuple(poses), failed, covariance)
