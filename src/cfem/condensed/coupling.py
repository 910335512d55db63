"""Several robots that hold one rigid object: the energies of the robots and the object's own, as one condensed model.

Robot f sees the object's pose X = (x, theta) as a pose Y_f(X) of its own contact patch. The object rests where

    Pi(delta_a, X) = sum_f Psi_f(delta_f, Y_f(X)) - w . X

is stationary in X, w being the weight or another constant wrench on it. Seen from outside, what is left is a condensed
model of all actuators whose effector is the object: with K = hess Pi,

    lambda_a = grad_a Pi    K_aa - K_aX K_XX^-1 K_Xa = W_aa^-1    de/ddelta_a = -K_XX^-1 K_Xa    C_ee = K_XX^-1

The paper (Navez, Menager et al. 2025, the gripper) takes one step towards that X at every control step, from the forces
of the actuators: X = S J^T W_cc^-1 (W_ca lambda_a + delta_c_free - delta_c + J X_before) + S w, S = (J^T W_cc^-1 J)^-1.
`updates: 1` is that step at given displacements; without a limit, Newton's method ends it. Where K_XX is not positive
definite the robots buckle under what they hold: that is an error, not an answer."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cfem.condensed import Condensed, Rows
from cfem.condensed.model import KnowsDomain, KnowsSlopes, Model
from cfem.condensed.pose import COORDINATES, from_energy
from cfem.condensed.rotation import RotationDerivatives, turn
from cfem.core.errors import NumericalError

TOLERANCE = 1e-9  # of the object's balance, relative to the largest wrench on it
UNSEEN = 1e-4  # mm
ITERATIONS = 30


@dataclass(frozen=True)
class RigidObject:
    """An object that several robots hold.

    centre: (3,) mm at rest
    turns: whether it can turn, else it is guided
    wrench: (3,) N constant force on it, or (6,) with the moment by theta (N mm)
    oriented: whether its rotation vector is an effector, as its place is"""

    centre: np.ndarray
    turns: bool
    wrench: np.ndarray
    oriented: bool = False

    @property
    def n(self) -> int:
        return 6 if self.turns else 3

    @property
    def rest_e(self) -> np.ndarray:
        """Position (n_e,) mm at rest, and rotation rad where it is oriented."""
        return np.concatenate([self.centre, np.zeros(3)]) if self.oriented else self.centre


@dataclass(frozen=True)
class Holder:
    """A robot that holds the object.

    model: of (its actuators, the pose of its patch)
    n_a: number of its actuators
    turn, shift: (3, 3) and (3,) mm from its frame to that of the object
    origin: (3,) mm of its patch, in its frame"""

    name: str
    model: Model
    n_a: int
    n_pose: int
    turn: np.ndarray
    shift: np.ndarray
    origin: np.ndarray

    def lever(self, centre: np.ndarray) -> np.ndarray:
        """Lever (3,) mm from the object's centre to the patch, at rest."""
        return self.turn @ self.origin + self.shift - centre


def object_rows(oriented: bool, names: Sequence[str], actuators: Sequence[str]) -> Rows:
    """Rows of an object that robots of these names and actuators hold; oriented: its rotation vector is an effector."""
    of_robots = [f"{name}.{actuator}" if len(names) > 1 else actuator for name in names for actuator in actuators]
    return Rows(tuple(f"object.{axis}" for axis in COORDINATES[: 6 if oriented else 3]), tuple(of_robots))


class HolderState(NamedTuple):
    """State of one robot, as far as one that holds something is asked for it: its own effectors are not.

    delta_a, lambda_a: (n_a + n_pose,) of its actuators and of its patch
    hessian: of its energy by delta_a"""

    delta_a: np.ndarray
    lambda_a: np.ndarray
    hessian: np.ndarray


@dataclass(frozen=True)
class HeldObject(Condensed):
    """The condensed model of all actuators, with the object as effector, where it rests.

    X: (n,) its pose
    parts: the robots' own states
    balance: (2,) sum of the forces and of the moments on the object, relative to the largest of either
    stiffness: (n, n) K_XX
    softest: its smallest eigenvalue over the largest, lengths scaled by that of the levers
    updates: Newton steps that it took
    forces: (robots, 3) N by which each robot pushes the object"""

    X: np.ndarray
    parts: tuple[HolderState, ...]
    balance: tuple[float, float]
    stiffness: np.ndarray
    softest: float
    updates: int
    forces: np.ndarray


class _Energy(NamedTuple):
    """Potential energy Pi of the robots and the object, to second order in delta_a and the pose X."""

    parts: tuple[HolderState, ...]  # the robots' states
    gradient: np.ndarray  # (n_a + n,)
    hessian: np.ndarray
    scale: tuple[float, float]  # the largest force N and moment N mm on the object


class Coupled:
    """`Model` of several robots that hold an object. home: (n_a,) mm actuators where control starts from."""

    def __init__(
        self, holds: Sequence[Holder], held: RigidObject, home: np.ndarray | None = None, updates: int | None = None
    ):
        """Places the robots about the object, and names the rows."""
        self.holds, self.object = tuple(holds), held
        self._levers = np.array([hold.lever(held.centre) for hold in holds])
        self._back = np.array([hold.turn.T for hold in holds])
        self._ends = np.cumsum([0, *(hold.n_a for hold in holds)])
        n_a = int(self._ends[-1])
        self.home = np.zeros(n_a) if home is None else home
        self._updates = updates
        names, alone = [hold.name for hold in holds], holds[0]
        self.rows = object_rows(held.oriented, names, alone.model.rows.actuators[: alone.n_a])
        self._length = max(1.0, float(np.linalg.norm(self._levers, axis=1).max()))
        first = holds[0].model
        self._alike = isinstance(first, KnowsSlopes) and all(hold.model is first for hold in holds)
        self._last: HeldObject | None = None
        self._slope = np.zeros((held.n, n_a))  # of the pose by the actuators, there

    def at_displacement(self, delta_a: np.ndarray) -> HeldObject:
        """The object at rest between its robots. NumericalError where it finds no stable rest, or a robot no state."""
        delta_a = np.asarray(delta_a, float)
        X = np.zeros(self.object.n) if self._last is None else self._predict(delta_a)
        limit = self._updates or ITERATIONS
        for update in range(limit + 1):
            energy = self._energy(delta_a, X)
            n_a, g, K = len(delta_a), energy.gradient, energy.hessian
            try:
                np.linalg.cholesky(K[n_a:, n_a:])
            except np.linalg.LinAlgError:
                raise NumericalError(
                    "the object is not held stably: a robot that holds it buckles",
                    do="pull less, or keep it nearer to where the robots rest",
                ) from None
            step = -np.linalg.solve(K[n_a:, n_a:], g[n_a:])
            balance = tuple(
                float(np.linalg.norm(part)) / size if size else 0.0
                for part, size in zip((g[n_a : n_a + 3], g[n_a + 3 :]), energy.scale, strict=True)
            )
            if self._updates is None and max(balance) <= TOLERANCE:
                return self._condense(delta_a, X, energy, balance, update)
            if self._updates is not None and update == self._updates - 1:
                energy = energy._replace(gradient=g + K[:, n_a:] @ step)
                return self._condense(delta_a, X + step, energy, balance, update + 1)
            X = X + step
        raise NumericalError(f"the object does not come to rest: a force balance of {max(balance):.1e}")

    def inside(self, held: HeldObject) -> bool:
        """True where every robot's state is like those that its model was trained on."""
        return all(
            not isinstance(hold.model, KnowsDomain) or hold.model.inside(part)
            for hold, part in zip(self.holds, held.parts, strict=True)
        )

    def distance(self, held: HeldObject) -> float:
        """The largest of the robots' distances from their training states; NaN where nothing was learned."""
        return max(
            (
                hold.model.distance(part)
                for hold, part in zip(self.holds, held.parts, strict=True)
                if isinstance(hold.model, KnowsDomain)
            ),
            default=float("nan"),
        )

    def _predict(self, delta_a: np.ndarray) -> np.ndarray:
        """Pose (n,) that the last state's linearisation expects."""
        last = self._last
        return last.X + self._slope @ (delta_a - last.delta_a)

    def _energy(self, delta_a: np.ndarray, X: np.ndarray) -> _Energy:
        """Pi to second order at displacements delta_a and pose X."""
        n_a, n = len(delta_a), len(X)
        now = turn(X[3:]) if n == 6 else None
        poses, slopes = self._poses(X, now)
        displacements = [
            np.concatenate([delta_a[first:end], pose])
            for first, end, pose in zip(self._ends[:-1], self._ends[1:], poses, strict=True)
        ]
        parts = self._states(displacements)
        g, K = np.zeros(n_a + n), np.zeros((n_a + n, n_a + n))
        g[n_a:] = -self.object.wrench
        force, moment = float(np.linalg.norm(self.object.wrench[:3])), float(np.linalg.norm(self.object.wrench[3:]))
        pulled = np.zeros((3, 3))
        for i, (hold, part, slope) in enumerate(zip(self.holds, parts, slopes, strict=True)):
            actuators, pose_rows = slice(self._ends[i], self._ends[i + 1]), slice(hold.n_a, None)
            push = slope.T @ part.lambda_a[pose_rows]
            coupled = part.hessian[: hold.n_a, pose_rows] @ slope
            g[actuators] = part.lambda_a[: hold.n_a]
            g[n_a:] += push
            K[actuators, actuators] = part.hessian[: hold.n_a, : hold.n_a]
            K[actuators, n_a:] = coupled
            K[n_a:, actuators] = coupled.T
            K[n_a:, n_a:] += slope.T @ part.hessian[pose_rows, pose_rows] @ slope
            pulled += np.outer(hold.turn @ part.lambda_a[hold.n_a : hold.n_a + 3], self._levers[i])
            force, moment = max(force, float(np.linalg.norm(push[:3]))), max(moment, float(np.linalg.norm(push[3:])))
        # robots that carry next to nothing: no less than what holds the object against a shift that nobody sees
        force = max(force, UNSEEN * float(np.abs(K[n_a : n_a + 3, n_a : n_a + 3]).max()))
        if now is not None:
            K[n_a + 3 :, n_a + 3 :] += np.tensordot(now.second, pulled, 2)
            moment = max(moment, UNSEEN / self._length * float(np.abs(K[n_a + 3 :, n_a + 3 :]).max()))
        return _Energy(parts, g, (K + K.T) / 2, (force, moment))

    def _poses(self, X: np.ndarray, now: RotationDerivatives | None) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Pose of every robot's patch in its frame, (n_pose,) each, and their derivatives (n_pose, n) by X."""
        moved = np.tile(X[:3], (len(self.holds), 1))
        slope = np.zeros((len(self.holds), 6, len(X)))
        slope[:, :3, :3] = self._back
        if now is not None:
            moved += self._levers @ now.R.T - self._levers
            slope[:, :3, 3:] = self._back @ np.einsum("jab,kb->kaj", now.first, self._levers)
            slope[:, 3:, 3:] = self._back
        poses = np.zeros((len(self.holds), 6))
        poses[:, :3] = (self._back @ moved[:, :, None])[:, :, 0]
        if now is not None:
            poses[:, 3:] = self._back @ X[3:]
        sizes = [hold.n_pose for hold in self.holds]
        return [pose[:n] for pose, n in zip(poses, sizes, strict=True)], [
            by_X[:n] for by_X, n in zip(slope, sizes, strict=True)
        ]

    def _states(self, displacements: list[np.ndarray]) -> tuple[HolderState, ...]:
        """States of the robots at these displacements, at once where all have the same learned model."""
        if self._alike:
            return tuple(map(HolderState, displacements, *self.holds[0].model.slopes(np.array(displacements))))
        return tuple(state_of(hold.model, delta) for hold, delta in zip(self.holds, displacements, strict=True))

    def _softest(self, K_XX: np.ndarray) -> float:
        size = np.array([1.0] * 3 + [self._length] * (len(K_XX) - 3))
        values = np.linalg.eigvalsh(K_XX / np.outer(size, size))
        return float(values[0] / np.abs(values).max())

    def _condense(
        self, delta_a: np.ndarray, X: np.ndarray, energy: _Energy, balance: tuple[float, ...], updates: int
    ) -> HeldObject:
        """Condensed model at the pose X, which follows the actuators: dX / d delta_a = -K_XX^-1 K_Xa."""
        n_a, n_e, g, K = len(delta_a), self.rows.n_e, energy.gradient, energy.hessian
        flexible = np.linalg.inv(K[n_a:, n_a:])
        slope = -flexible @ K[n_a:, :n_a]
        hessian = K[:n_a, :n_a] + K[:n_a, n_a:] @ slope
        delta = np.concatenate([X[:n_e], delta_a])
        plain = from_energy(self.rows, delta, g[:n_a], hessian, slope[:n_e], flexible[:n_e, :n_e])
        stiffness = K[n_a:, n_a:]
        forces = -np.array(
            [hold.turn @ part.lambda_a[hold.n_a :][:3] for hold, part in zip(self.holds, energy.parts, strict=True)]
        )
        held = HeldObject(
            plain.rows,
            plain.W,
            plain.delta_free,
            plain.lam,
            X=X,
            parts=energy.parts,
            balance=balance,
            stiffness=stiffness,
            softest=self._softest(stiffness),
            updates=updates,
            forces=forces,
        )
        self._last, self._slope = held, slope
        return held


def state_of(model: Model, delta_a: np.ndarray) -> HolderState:
    """State of one robot at delta_a (n_a + n_pose,)."""
    if isinstance(model, KnowsSlopes):
        lam, hessian = model.slopes(delta_a[None])
        return HolderState(delta_a, lam[0], hessian[0])
    condensed = model.at_displacement(delta_a)
    act = condensed.rows.active
    return HolderState(delta_a, condensed.lam, np.linalg.inv(condensed.W[act, act]))
