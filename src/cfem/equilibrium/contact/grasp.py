"""Equilibria of robots and one free rigid object between them, which rests where contact balances its load."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.condensed.rotation import cross_matrix
from cfem.contact.law.problem import Law
from cfem.contact.obstacle import Obstacle
from cfem.equilibrium.contact.points import PlacedRobot, PointsState, points_step
from cfem.equilibrium.system.actuation import Actuation


@dataclass(frozen=True)
class FreeObject:
    """`Partner`: a free rigid object.

    shape: placed as at rest
    centre: (3,) mm at rest
    load: (6,) N and N mm about the centre, constant
    turns: True where it can turn, else it is guided
    carried: True where it stays where it is, whatever its load
    R, x: (3, 3) and (3,) mm, rotation and displacement since rest
    mobility: (k,) mm and rad for each N and N mm that nothing balances, by which a viscous drag lets it go on from
    `begin` in one step; None: in balance
    oriented: True where its rotation vector counts as an effector"""

    shape: Obstacle
    centre: np.ndarray
    load: np.ndarray
    turns: bool = True
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    x: np.ndarray = field(default_factory=lambda: np.zeros(3))
    mobility: np.ndarray | None = None
    begin: "FreeObject | None" = None
    oriented: bool = False
    carried: bool = False

    @property
    def delta_e(self) -> np.ndarray:
        """Displacement (n_e,) of the object since rest, mm, and rad where it is oriented."""
        return np.concatenate([self.x, Rotation.from_matrix(self.R).as_rotvec()]) if self.oriented else self.x

    @property
    def gone(self) -> np.ndarray:
        """Motion (k,) of the object, mm and rad, since `begin`."""
        return self.begin.way_to(self)

    @property
    def wrench(self) -> np.ndarray:
        if self.carried:
            return self.load[:0]
        return self.load if self.turns else self.load[:3]

    @property
    def placed(self) -> Obstacle:
        """The shape where it is now."""
        return self.shape.posed(self.R @ self.shape.R, self.now(self.shape.t))

    def surface(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        placed = self.placed
        return placed.distance(points), placed.frames(points)

    def motion(self, points: np.ndarray) -> np.ndarray:
        shift = np.tile(np.eye(3), (len(points), 1))
        if self.carried:
            return shift[:, :0]
        if not self.turns:
            return shift
        return np.hstack([shift, -cross_matrix(points - self.centre - self.x).reshape(-1, 3)])

    def moved(self, xi: np.ndarray) -> "FreeObject":
        if self.carried:
            return self
        R = Rotation.from_rotvec(xi[3:]).as_matrix() @ self.R if self.turns else self.R
        return replace(self, R=R, x=self.x + xi[:3])

    def way_to(self, other: "FreeObject") -> np.ndarray:
        turned = Rotation.from_matrix(other.R @ self.R.T).as_rotvec()
        return np.concatenate([other.x - self.x, turned])[: len(self.wrench)]

    def now(self, places: np.ndarray) -> np.ndarray:
        return (places - self.centre) @ self.R.T + self.centre + self.x

    def places(self, points: np.ndarray) -> np.ndarray:
        return (points - self.centre - self.x) @ self.R + self.centre


def holding_stiffness(state: PointsState, points: np.ndarray) -> np.ndarray:
    """Stiffness (k, k) N/mm (N, N mm for rotations about the centre) with which points (m, 3) mm that are glued to the
    free object hold it in a state: J^T C^-1 J, and the moments of the points' forces f as their arms a turn with it,
    (f a^T + a f^T) / 2 - f . a."""
    held, posed = state.around, state.posed
    J = held.motion(points)
    K = J.T @ np.linalg.solve(posed.compliance, J)
    if held.turns:
        forces, arms = (posed.force @ posed.rotation).reshape(-1, 3), points - held.centre - held.x
        moments = forces.T @ arms
        K[3:, 3:] += (moments + moments.T) / 2 - np.trace(moments) * np.eye(3)
    return (K + K.T) / 2


def grasp_step(
    fingers: Sequence[PlacedRobot],
    actuators: Sequence[Actuation],
    held: FreeObject,
    law: Law = "coulomb",
    mu: float = 0.0,
    before: PointsState | None = None,
) -> PointsState:
    """Quasi-static step of the fingers to `actuators`, one for each, from the state `before` (none: at rest, every
    point that touches the object sticks where it is); the object begins where it was then. Never raises for numerical
    failure."""
    if before is not None:
        held = replace(held, R=before.around.R, x=before.around.x)
    if held.mobility is not None:
        held = replace(held, begin=held)
    return points_step(fingers, actuators, held, before, law, mu)
