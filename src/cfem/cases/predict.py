"""Predictions of load cases, with intervals that hold all that is not known.

The variance of a coordinate is inflation^2 (g^T C g + s^2): C the covariance of all unknowns of robot and rig, g the
prediction's derivative by them, s the scatter that no unknown explains, and the inflation by which errors of left-out
cases are larger than this says (compare.py). As few cases tell s and the inflation, quantiles are Student's t of one
less degrees of freedom than cases; of the distance of a marker, those of F."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f, t

from cfem.cases.outcome import Calibrated, widened
from cfem.cases.rig import Rig
from cfem.cases.robots import Posed
from cfem.cases.table import Cases
from cfem.core.errors import NumericalError


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


def predict(rig: Rig, cases: Cases, known: Calibrated, confidence: float) -> Prediction:
    z, d, C = widened(known, rig)
    y = np.full(cases.places.shape, np.nan)
    slopes, posed, failed = np.zeros((*y.shape, len(z) + len(d))), [], {}
    for i in range(len(cases)):
        try:
            seen = rig.see(cases.only(np.array([i])), z, d)
        except NumericalError as error:
            failed[i] = str(error)
            posed.append(Posed(rig.robots.rest, np.tile(np.eye(3), (len(rig.robots.rest), 1, 1)), rig.robots.robot.X))
            continue
        y[i], slopes[i] = seen.y[0], np.concatenate([seen.by_z, seen.by_d], axis=3)[0]
        posed.append(seen.posed[0])
    C3 = np.einsum("mkin,no,mkjo->mkij", slopes, C, slopes) + known.scatter**2 * np.eye(3)
    sd = known.inflation * np.sqrt(np.einsum("mkii->mki", C3))
    degrees = max(known.degrees, 1)
    half = float(t.ppf(0.5 + confidence / 2, degrees)) * sd
    # of the ellipsoid, the ball of its largest axis
    largest = known.inflation * np.sqrt(np.linalg.eigvalsh(C3)[..., -1])
    radius = float(np.sqrt(3 * f.ppf(confidence, 3, degrees))) * largest
    half[list(failed)], radius[list(failed)] = np.nan, np.nan
    return Prediction(y, half, radius, y - cases.target, tuple(posed), failed)
