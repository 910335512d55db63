"""The equations of one robot on its free unknowns: residual, gap of the actuation, and the factored tangent.

R(x, lambda) = f_int(x) - sum_j lambda_j grad delta_j(x) = 0        C delta_a(x) = target"""

from dataclasses import dataclass

import numpy as np

from cfem.constraint.protocol import Watched
from cfem.mechanics.assembly import Pattern, add_blocks, make_pattern
from cfem.mechanics.factorization import Factor, analyze
from cfem.mechanics.solid import Response, pressure_force, response, tangent
from cfem.robot.robot import Robot


@dataclass
class Cost:
    """What a solve has cost so far."""

    iterations: int = 0
    factorizations: int = 0
    steps: int = 0


@dataclass(frozen=True)
class Evaluation:
    """The equations at one x and element pressure p.

    force: (n_dof,) N internal forces on the free nodes; delta_a: (n_a,); H: (n_dof, n_a) gradients of delta_a"""

    x: np.ndarray
    pressure: np.ndarray
    response: Response
    force: np.ndarray
    delta_a: np.ndarray
    H: np.ndarray

    def residual(self, lambda_a: np.ndarray) -> np.ndarray:
        """(n_dof,) N."""
        return self.force - self.H @ lambda_a


@dataclass(frozen=True)
class Tangent:
    """A factored at one state, with what the element pressures need: bulk / V and the gradient of theta_mean V."""

    factor: Factor
    data: np.ndarray
    dtheta: np.ndarray


class Problem:
    """Sparsity pattern and symbolic factorisation of a robot, found once; all else is recomputed from arguments."""

    def __init__(self, robot: Robot):
        self.robot = robot
        body = robot.body
        cliques = [clique for actuator in robot.actuators for clique in actuator.cliques]
        self.pattern: Pattern = make_pattern(len(body.mesh.X), body.mesh.cells, robot.fixed, cliques)
        self._factor = analyze(self.pattern)
        self._bulk_over_volume = body.bulk / body.weights.sum(axis=1)
        # residuals are relative to the forces at hand, but never to less than a strain of 1e-10 over the whole body
        self.force_floor = 1e-10 * body.shear * body.mesh.size**2

    @property
    def rest(self) -> np.ndarray:
        return self.robot.body.mesh.X

    def evaluate(self, x: np.ndarray, pressure: np.ndarray) -> Evaluation:
        """An empty pressure stands for the one that x itself demands."""
        body = self.robot.body
        at = response(body, x, pressure)
        if body.n_pressures and len(pressure) == 0:
            pressure = at.point_pressure[:: body.weights.shape[1]]
        delta_a = np.array([actuator.value(x)[0] for actuator in self.robot.actuators])
        return Evaluation(
            x,
            pressure,
            at,
            at.force[self.pattern.free].ravel(),
            delta_a,
            self.gradients(self.robot.actuators, x),
        )

    def gradients(self, rows: tuple[Watched, ...], x: np.ndarray) -> np.ndarray:
        """(n_dof, sum of rows) on the free unknowns."""
        columns = []
        for row in rows:
            dense = np.zeros((len(row.rest), *x.shape))
            dense[:, row.nodes] = row.gradient(x)
            columns.append(dense[:, self.pattern.free].reshape(len(row.rest), -1).T)
        return np.ascontiguousarray(np.hstack(columns))

    def stiffness(self, at: Evaluation, lambda_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lower triangle of A = d f_int/dx - sum_j lambda_j hess delta_j, and dtheta of the elements."""
        data = np.zeros(self.pattern.nnz)
        dtheta = tangent(self.robot.body, at.response, self.pattern.cells, data)
        slots = iter(self.pattern.cliques)
        for actuator, multiplier in zip(self.robot.actuators, lambda_a, strict=True):
            for slot, block in zip((next(slots) for _ in actuator.cliques), actuator.curvature(at.x), strict=True):
                if multiplier != 0.0:
                    add_blocks(-multiplier * block, slot, data)
        return data, dtheta

    def factor(self, at: Evaluation, lambda_a: np.ndarray, cost: Cost) -> Tangent:
        """Raises SingularMatrixError."""
        data, dtheta = self.stiffness(at, lambda_a)
        cost.factorizations += 1
        return Tangent(self._factor(data), data, dtheta)

    def pressure_residual(self, at: Evaluation, tangent: Tangent) -> np.ndarray:
        """(n_dof,) N: force of the pressure that the elements have yet to gain."""
        if len(at.response.mismatch) == 0:
            return np.zeros(self.pattern.n_dof)
        return pressure_force(self.robot.body, tangent.dtheta, at.response.mismatch)[self.pattern.free].ravel()

    def pressure_step(self, at: Evaluation, tangent: Tangent, step: np.ndarray) -> np.ndarray:
        """(m,) MPa change of the element pressures that goes with nodal displacements `step` (n, 3)."""
        if len(at.response.mismatch) == 0:
            return np.empty(0)
        work = np.einsum("mai,mai->m", tangent.dtheta, step[self.robot.body.mesh.cells])
        return at.response.mismatch + self._bulk_over_volume * work

    def hold(self, x: np.ndarray) -> np.ndarray:
        """x (n, 3) with the held nodes where they belong: no residual would tell if a start had moved them."""
        held = x.copy()
        held[self.robot.fixed] = self.rest[self.robot.fixed]
        return held

    def spread(self, free: np.ndarray) -> np.ndarray:
        """(n_dof,) -> (n, 3), zero at held nodes."""
        full = np.zeros_like(self.rest)
        full[self.pattern.free] = free.reshape(-1, 3)
        return full
