"""A learned robot whose patch of contact points touches an object, point by point.

The model knows the energy Psi(delta_a, X) of its actuators and the pose X of the patch as a rigid body. Points that are
touched one by one deform the patch as well. How forces that hold each other in balance within the patch do that is
local: it turns with the patch and otherwise hardly changes, so that one state of finite elements tells it
(`cfem.equilibrium.contact.patch_compliance.within_patch`). With N the shapes of that and D their compliance the points
stand at

    x = g(X) + R(X) N s        energy Psi(delta_a, X) + s . D^-1 s / 2 - s . D^-1 c delta_a

c delta_a is s where nothing holds the points, and s = 0 where Psi was learned. Forces f on the points are the gradient
of the energy by their places."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed.coupling import HolderState, state_of
from cfem.condensed.model import Model
from cfem.condensed.pose import Patch
from cfem.condensed.rotation import turn
from cfem.core.errors import NumericalError

ITERATIONS, TOLERANCE = 30, 1e-12


@dataclass(frozen=True)
class WithinPatch:
    """Deformation of a patch of k points about its pose; n = 3 k - 6.

    shapes: N (3 k, n), displacements of the points in the frame of the patch, without unit
    compliance: D (n, n) mm/N
    by_actuators: c (n, n_a), how actuators that move deform the patch"""

    shapes: np.ndarray
    compliance: np.ndarray
    by_actuators: np.ndarray


@dataclass(frozen=True)
class Response:
    """One state, as `Equilibrium` has it.

    X: (6,) pose of the patch
    by_actuators: (3 k, n_a), how the points move with the actuators under constant forces
    stiffness: (n_a, n_a) N/mm of the actuators under constant forces"""

    X: np.ndarray
    delta_a: np.ndarray
    lambda_a: np.ndarray
    delta_c: np.ndarray
    lambda_c: np.ndarray
    by_actuators: np.ndarray
    stiffness: np.ndarray
    converged: bool
    factorizations: int = 0


@dataclass(frozen=True)
class LearnedFinger:
    """`PointRobot`: a learned robot placed by turn (3, 3) and shift (3,) mm. model: of (its actuators, the pose of
    `patch`)."""

    model: Model
    patch: Patch
    within: WithinPatch
    turn: np.ndarray
    shift: np.ndarray

    @property
    def points(self) -> np.ndarray:
        return self.patch.points @ self.turn.T + self.shift

    def respond(
        self, actuators, delta_c: np.ndarray, before: Response | None, tolerance: float = 0.0
    ) -> tuple[Response, np.ndarray]:
        """State and compliance (3 k, 3 k) mm/N of the points held at delta_c (3 k,) mm. actuators: held at their
        targets, whether they pull or push."""
        delta_a = actuators.target
        X, size, M = self._placed(delta_c, np.zeros(6) if before is None else before.X)
        c = self.within.by_actuators
        z = size - c @ delta_a
        _, lam, hessian = state_of(self.model, np.concatenate([delta_a, X]))
        n_a, n = len(delta_a), len(M)
        stiff = np.linalg.inv(self.within.compliance)
        f = np.linalg.solve(M.T, np.concatenate([lam[n_a:], stiff @ z]))
        lam_a = lam[:n_a] - c.T @ (stiff @ size)
        K = hessian[n_a:, n_a:] - self.patch.curvature(X, f)
        stable = bool(np.isfinite(K).all() and np.linalg.eigvalsh((K + K.T) / 2)[0] > 0)
        if not stable:
            none = np.zeros((n, n_a)), hessian[:n_a, :n_a]
            return Response(X, delta_a, lam_a, delta_c, f, *none, False), np.zeros((n, n))
        compliance = np.zeros((n, n))
        compliance[:6, :6], compliance[6:, 6:] = np.linalg.inv(K), self.within.compliance
        follows = -compliance[:6, :6] @ hessian[n_a:, :n_a]
        stiffness = hessian[:n_a, :n_a] + hessian[:n_a, n_a:] @ follows - c.T @ stiff @ c
        response = Response(X, delta_a, lam_a, delta_c, f, M @ np.vstack([follows, c]), stiffness, True)
        return response, M @ compliance @ M.T

    def inside(self, state: Response) -> bool:
        """True where the model knows a state."""
        return self.model.inside(self._model_state(state))

    def distance(self, state: Response) -> float:
        """Distance of a state from those that the model was trained on."""
        return self.model.distance(self._model_state(state))

    def _model_state(self, state: Response) -> HolderState:
        return state_of(self.model, np.concatenate([state.delta_a, state.X]))

    def _placed(self, delta_c: np.ndarray, X: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """X (6,) and sizes (n,) of the shapes at which the points stand at delta_c (3 k,) mm from rest, and the
        derivative of their places by both."""
        z, k, before = np.zeros(len(self.within.compliance)), len(self.patch.points), np.inf
        near = TOLERANCE * float(np.abs(self.patch.points).max())
        for _ in range(ITERATIONS):
            now = turn(X[3:])
            shapes = (now.R @ self.within.shapes.reshape(k, 3, -1)).reshape(3 * k, -1)
            local = (self.within.shapes @ z).reshape(k, 3)
            J = self.patch.jacobian(X)
            J[:, 3:] += np.einsum("jab,kb->kaj", now.first, local).reshape(3 * k, 3)
            M = np.hstack([J, shapes])
            missing = delta_c - self.patch.displacement(X) - shapes @ z
            size = float(np.abs(missing).max())
            if size <= near and size >= before / 2:  # to rounding: the patch is stiff, and what is missing is a force
                return X, z, M
            before = size
            step = np.linalg.solve(M, missing)
            X, z = X + step[:6], z + step[6:]
        raise NumericalError("a patch of contact points is bent out of shape")
