"""From equilibria to what cameras see: drives, markers that stand off the body, and the frame of the cameras.

A marker is seen at

    y = Q (x + T (a + d)) + s

with x and T the place and the turn of its effector, a its stand-off, d = d_marker + d_marker,session its offset, Q the
turn of the frame by the rotation vector frame.turn, and s = frame.shift. Where displacements are compared, the marker's
place at rest is taken away. Drives pull by (scale f + offset) / (1 - (f / limit)^2) where f is not 0: a chamber's wall
bulges under its pressure, which then acts on more, and without bound near the limit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.cases.robots import CaseRobots, Posed
from cfem.cases.spec import Marker, Offsets
from cfem.cases.table import Cases
from cfem.cases.unknowns import Sought
from cfem.core.errors import NumericalError

_STEP = 1e-3  # of z, by which predictions are differenced


@dataclass(frozen=True)
class Seen:
    """Predictions of m cases: y (m, k, 3) mm; by_z (m, k, 3, n_z); by_d (m, k, 3, n_d); posed: the robot in each; moved
    (m, k) mm from where each marker is without any load."""

    y: np.ndarray
    by_z: np.ndarray
    by_d: np.ndarray
    posed: tuple[Posed, ...]
    moved: np.ndarray


class Rig:
    """The unknowns z of `sought` and d of the markers' offsets, in mm: of each marker, then of each session and marker.

    sessions: those that have unknowns of their own; d_sd (n_d,) mm: what is known of d; blocks: of d, each of all
    markers"""

    def __init__(
        self,
        robots: CaseRobots,
        unknowns: Sequence[Sought],
        markers: Sequence[Marker],
        watched: Sequence[str],
        actuators: Sequence[str],
        sessions: Sequence[str],
        offsets: Offsets | None,
    ):
        self.robots, self.unknowns, self.actuators = robots, tuple(unknowns), tuple(actuators)
        self._effector = np.array([list(watched).index(one.effector) for one in markers])
        self._stand_off = np.array([np.zeros(3) if one.stand_off is None else one.stand_off for one in markers])
        self.sessions, k = tuple(sessions), len(markers)
        by_session = offsets is not None and offsets.session is not None
        self.blocks = 0 if offsets is None else 1 + (len(sessions) if by_session else 0)
        each = [] if offsets is None else [offsets.sd] + [offsets.session] * (self.blocks - 1)
        self.d_sd = np.repeat(np.array(each, float), 3 * k)

    @property
    def n_d(self) -> int:
        return len(self.d_sd)

    def see(self, cases: Cases, z: np.ndarray, d: np.ndarray, slopes: bool = True) -> Seen:
        """NumericalError where a case has no equilibrium."""
        posed = self._posed(cases, z)
        y, by_d = self._markers(cases, posed, z, d)
        by_z = np.zeros((*y.shape, len(z)))
        for i in range(len(z)) if slopes else ():
            step = _STEP * (np.arange(len(z)) == i)
            ahead, behind = (self._markers(cases, self._posed(cases, one), one, d)[0] for one in (z + step, z - step))
            by_z[..., i] = (ahead - behind) / (2 * _STEP)
        return Seen(y, by_z, by_d, posed, np.array([self._moved(one) for one in posed]))

    def _posed(self, cases: Cases, z: np.ndarray) -> tuple[Posed, ...]:
        mine = [(one, share) for one, share in zip(self.unknowns, z, strict=True) if one.of_scene]
        p = np.array([one.value(share) for one, share in mine for _ in one.keys], float)
        found = []
        for i, name in enumerate(cases.names):
            forces, before = cases.forces[i], cases.before[i]
            forces = self._driven(forces, z, cases.sessions[i])
            before = None if before is None else self._driven(before, z, cases.sessions[i])
            found.append(self.robots.at(p, forces, cases.ways[i], name, before))
        return tuple(found)

    def _driven(self, f: np.ndarray, z: np.ndarray, session: str) -> np.ndarray:
        """What the drives do at commands f (..., n_a). NumericalError where a chamber bulges without bound."""
        parts = (("scale", 1.0), ("offset", 0.0), ("limit", np.inf))
        scale, offset, limit = np.array(
            [
                [self._rig(f"drive.{one}.{part}", nominal, z, session) for one in self.actuators]
                for part, nominal in parts
            ]
        )
        if (np.abs(f / limit) >= 1).any():
            raise NumericalError("a chamber bulges without bound at this pressure", do="narrow the range of its limit")
        return np.where(f != 0, (scale * f + offset) / (1 - (f / limit) ** 2), 0.0)

    def _markers(
        self, cases: Cases, posed: Sequence[Posed], z: np.ndarray, d: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        k = len(self._effector)
        y, by_d = np.empty((len(cases), k, 3)), np.zeros((len(cases), k, 3, self.n_d))
        for i, (one, session) in enumerate(zip(posed, cases.sessions, strict=True)):
            turn = Rotation.from_rotvec([self._rig(f"frame.turn.{a}", 0.0, z, session) for a in "xyz"]).as_matrix()
            shift = np.array([self._rig(f"frame.shift.{a}", 0.0, z, session) for a in "xyz"])
            T = one.turn[self._effector]
            place = one.x[self._effector] + (T @ self._stand_off[:, :, None])[:, :, 0]
            if cases.rest is not None:
                place = place - (self.robots.rest[self._effector] + self._stand_off)
                T, shift = T - np.eye(3), np.zeros(3)
            y[i] = place @ turn.T + shift
            own = turn @ T
            for block in self._mine(session):
                columns = 3 * k * block + np.arange(3 * k).reshape(k, 3)
                for marker in range(k):
                    by_d[i, marker][:, columns[marker]] = own[marker]
        return y + by_d @ d, by_d

    def _moved(self, one: Posed) -> np.ndarray:
        turned = (one.turn[self._effector] @ self._stand_off[:, :, None])[:, :, 0] - self._stand_off
        return np.linalg.norm((one.x - self.robots.rest)[self._effector] + turned, axis=1)

    def _mine(self, session: str) -> list[int]:
        """Blocks of d that act in a session."""
        if self.blocks <= 1:
            return list(range(self.blocks))
        return [0, 1 + self.sessions.index(session)]

    def _rig(self, key: str, nominal: float, z: np.ndarray, session: str) -> float:
        for one, share in zip(self.unknowns, z, strict=True):
            if key in one.keys and one.session in (None, session):
                return one.value(share)
        return nominal
