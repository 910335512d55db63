"""From equilibria to what cameras see: drives, markers that stand off the body, and the frame of the cameras.

A marker is seen at

    y = Q (x + T (a + d) + delta) + s

with x and T the place and the turn of its effector, a its stand-off, d = d_marker + d_marker,session its offset, delta
what the model lacks (discrepancy.py), Q the turn of the frame by the rotation vector frame.turn, and s = frame.shift.
Where displacements are compared, the marker's place at rest is taken away. Drives pull by
(scale f + offset) / (1 - (f / limit)^2) where f is not 0: a chamber's wall bulges under its pressure, which then acts
on more, and without bound near the limit."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.core.errors import NumericalError
from cfem.identify.cases.discrepancy import DiscrepancyPrior
from cfem.identify.cases.robots import CaseRobots, Pose
from cfem.identify.cases.spec import Marker, Offsets
from cfem.identify.cases.table import Cases
from cfem.identify.cases.unknowns import CaseUnknown

_STEP = 1e-3  # of z, by which predictions are differenced


@dataclass(frozen=True)
class MarkerPredictions:
    """Predictions of m cases of k markers.

    y:     (m, k, 3) mm places, or displacements where these are compared
    by_z:  (m, k, 3, n_z) derivatives by the unknowns
    by_d:  (m, k, 3, n_d) derivatives by the offsets
    poses: of the robot in each case
    moved: (m, k) mm from where each marker is without any load"""

    y: np.ndarray
    by_z: np.ndarray
    by_d: np.ndarray
    poses: tuple[Pose, ...]
    moved: np.ndarray

    @property
    def by_u(self) -> np.ndarray:
        """Derivatives (m, k, 3, n_z + n_d) by unknowns and offsets."""
        return np.concatenate([self.by_z, self.by_d], axis=3)

    def covariance(self, of_unknowns: np.ndarray, scatter: np.ndarray) -> np.ndarray:
        """Covariances (m, k, 3, 3) mm^2 of each marker, from that of unknowns and offsets (n, n) and the scatter's
        variance (m, k) mm^2 of each coordinate."""
        spread = np.einsum("mkin,no,mkjo->mkij", self.by_u, of_unknowns, self.by_u)
        return spread + scatter[..., None, None] * np.eye(3)


class Rig:
    """Markers, drives and cameras of a laboratory. Its unknowns are z (n_z,), and for the markers d (n_d,) mm: offsets,
    and the discrepancy of the model.

    robots:   those that are measured
    unknowns: of robot and rig
    actuators: names, in the order of forces
    sessions: those that have unknowns of their own
    discrepancy: prior of what the model lacks, None where nothing
    d_sd:     (n_d,) mm standard deviations of d
    blocks:   of d, each (3 k,) of all markers: offsets of all sessions, of each session, then each term of the
              discrepancy"""

    def __init__(
        self,
        robots: CaseRobots,
        unknowns: Sequence[CaseUnknown],
        markers: Sequence[Marker],
        watched: Sequence[str],
        actuators: Sequence[str],
        sessions: Sequence[str],
        offsets: Offsets | None,
        discrepancy: DiscrepancyPrior | None = None,
    ):
        """Gathers the unknowns and offsets. watched: names of the effectors; offsets: how far markers may be from where
        they are said to be."""
        self.robots, self.unknowns, self.actuators = robots, tuple(unknowns), tuple(actuators)
        self._effector = np.array([list(watched).index(marker.effector) for marker in markers])
        self._stand_off = np.array([np.zeros(3) if m.stand_off is None else m.stand_off for m in markers])
        self.sessions, self.discrepancy = tuple(sessions), discrepancy
        by_session = offsets is not None and offsets.session is not None
        self._offsets = [] if offsets is None else [offsets.sd, *([offsets.session] * len(sessions) * by_session)]

    @property
    def blocks(self) -> list[tuple[str, str]]:
        """Kind and name of each block of d."""
        of_offsets = [("offset", "all"), *(("session", name) for name in self.sessions)][: len(self._offsets)]
        terms = [] if self.discrepancy is None else self.discrepancy.terms
        return of_offsets + [("force", " ".join(self.actuators[i] for i in term)) for term in terms]

    @property
    def d_sd(self) -> np.ndarray:
        """Standard deviations (n_d,) mm of the unknowns d."""
        alike = [np.full(len(self._effector), sd) for sd in self._offsets]
        lacking = [] if self.discrepancy is None else [self.discrepancy.sd] * len(self.discrepancy.terms)
        return np.repeat(np.concatenate([*alike, *lacking, []]), 3)

    def with_discrepancy(self, discrepancy: DiscrepancyPrior) -> "Rig":
        """This rig with another prior of what the model lacks."""
        rig = copy.copy(self)
        rig.discrepancy = discrepancy
        return rig

    @property
    def n_d(self) -> int:
        """Number of offsets."""
        return len(self.d_sd)

    def see(self, cases: Cases, z: np.ndarray, d: np.ndarray, slopes: bool = True) -> MarkerPredictions:
        """Predicts where the cameras see the markers; derivatives by z are zero without `slopes`. NumericalError where
        a case has no equilibrium."""
        poses = self._poses(cases, z)
        y, by_d = self._markers(cases, poses, z, d)
        by_z = np.zeros((*y.shape, len(z)))
        for i, step in enumerate(_STEP * np.eye(len(z))) if slopes else ():
            ahead, behind = (self._markers(cases, self._poses(cases, u), u, d)[0] for u in (z + step, z - step))
            by_z[..., i] = (ahead - behind) / (2 * _STEP)
        return MarkerPredictions(y, by_z, by_d, poses, np.array([self._moved(pose) for pose in poses]))

    def _poses(self, cases: Cases, z: np.ndarray) -> tuple[Pose, ...]:
        """Equilibria of all cases, at the forces that the drives give."""
        of_scene = [(unknown, share) for unknown, share in zip(self.unknowns, z, strict=True) if unknown.of_scene]
        p = np.array([unknown.value(share) for unknown, share in of_scene for _ in unknown.keys], float)
        poses = []
        for i, name in enumerate(cases.names):
            session, before = cases.sessions[i], cases.before[i]
            forces = self._driven(cases.forces[i], z, session)
            before = None if before is None else self._driven(before, z, session)
            poses.append(self.robots.at(p, forces, cases.directions[i], name, before))
        return tuple(poses)

    def _driven(self, f: np.ndarray, z: np.ndarray, session: str) -> np.ndarray:
        """Forces (..., n_a) of the drives at commands f. NumericalError where a chamber bulges without bound."""

        def number(part: str, nominal: float) -> np.ndarray:
            return np.array([self._rig(f"drive.{name}.{part}", nominal, z, session) for name in self.actuators])

        limit = number("limit", np.inf)
        if (np.abs(f / limit) >= 1).any():
            raise NumericalError("a chamber bulges without bound at this pressure", do="narrow the range of its limit")
        driven = (number("scale", 1.0) * f + number("offset", 0.0)) / (1 - (f / limit) ** 2)
        return np.where(f != 0, driven, 0.0)

    def _markers(
        self, cases: Cases, poses: Sequence[Pose], z: np.ndarray, d: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Places y (m, k, 3) mm of the markers and their derivative by d (m, k, 3, n_d)."""
        k = len(self._effector)
        y, by_d = np.empty((len(cases), k, 3)), np.zeros((len(cases), k, 3, self.n_d))
        features = np.zeros((len(cases), 0)) if self.discrepancy is None else self.discrepancy.features(cases.forces)
        for i, (pose, session) in enumerate(zip(poses, cases.sessions, strict=True)):
            turn, shift = (
                np.array([self._rig(f"frame.{part}.{axis}", 0.0, z, session) for axis in "xyz"])
                for part in ("turn", "shift")
            )
            Q, T = Rotation.from_rotvec(turn).as_matrix(), pose.turn[self._effector]
            place = pose.x[self._effector] + (T @ self._stand_off[:, :, None])[:, :, 0]
            if cases.rest is not None:
                place = place - (self.robots.rest[self._effector] + self._stand_off)
                T, shift = T - np.eye(3), np.zeros(3)
            y[i] = place @ Q.T + shift
            columns = np.arange(self.n_d).reshape(-1, k, 3)
            for marker in range(k):
                for block in self._offset_blocks(session):
                    by_d[i, marker][:, columns[block, marker]] = Q @ T[marker]
                for block, phi in enumerate(features[i], len(self._offsets)):
                    by_d[i, marker][:, columns[block, marker]] = phi * Q
        return y + by_d @ d, by_d

    def _moved(self, pose: Pose) -> np.ndarray:
        """Distances (k,) mm of each marker from where it is without any load."""
        turned = (pose.turn[self._effector] @ self._stand_off[:, :, None])[:, :, 0] - self._stand_off
        return np.linalg.norm((pose.x - self.robots.rest)[self._effector] + turned, axis=1)

    def _offset_blocks(self, session: str) -> list[int]:
        """Blocks of d that are offsets of markers in a session."""
        return [0, 1 + self.sessions.index(session)][: len(self._offsets)]

    def _rig(self, key: str, nominal: float, z: np.ndarray, session: str) -> float:
        """A number of the rig in a session: an unknown's value, or the nominal one."""
        for unknown, share in zip(self.unknowns, z, strict=True):
            if key in unknown.keys and unknown.session in (None, session):
                return unknown.value(share)
        return nominal
