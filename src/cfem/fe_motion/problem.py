"""The equations of a robot that moves: those of equilibrium, with inertia and overstress in one implicit step.

A step of the scheme makes the acceleration at its end an affine function of the positions there, a = c (x - y) + h, and
the overstress one of the stress there (viscosity.py). What is left is an equilibrium, of a body that resists more:

    R(x, lambda) = f_int(x) + f_viscous(x) + M (c (x - y) + h) - f_ext - sum_j lambda_j grad delta_j(x) = 0

so that equilibrium's Newton, its held displacements and its rigid frames serve unchanged. Inertia acts on nodes, whose
positions a rigid group binds: T^T M T and the turning of the inertial forces follow from kinematics.py."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cfem.equilibrium.motion.inertia import mass_of
from cfem.equilibrium.system.evaluation import Evaluation
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics import viscosity as viscous
from cfem.mechanics.assembly import add_blocks
from cfem.mechanics.viscosity import Overstress


@dataclass(frozen=True)
class TimeStep:
    """An implicit step, x'' = c (x - y) + h.

    inertia: c, 1/s^2
    origin: y (n, 3) mm
    offset: h (n, 3) mm/s^2
    overstress: None without viscosity"""

    inertia: float
    origin: np.ndarray
    offset: np.ndarray
    overstress: Overstress | None = None


@dataclass(frozen=True)
class MovingEvaluation(Evaluation):
    """Equations of a step at one x. moving: (n, 3) N on the nodes, of inertia and the solids' overstress; moving_size:
    N, of their parts."""

    moving: np.ndarray
    moving_size: float


class MovingProblem(Problem):
    """A robot with mass. mass: (n, n) t in each direction; viscosity: of each material, empty without any.

    Without a step it is the problem of equilibrium; `during` gives the equations of one."""

    def __init__(self, robot: Robot, payloads: Sequence["NodalPayload"] = ()):
        """Assembles the mass of the robot and of its payloads."""
        mass = mass_of(robot)
        super().__init__(robot, coupled=[payload.nodes[None] for payload in payloads])
        self.mass = mass
        for payload in payloads:
            self.mass = sp.csr_array(self.mass + payload.matrix(len(self.rest)))
        self.viscosity = () if all(material.none for material in robot.viscosity) else robot.viscosity
        self.step: TimeStep | None = None
        self._mass_places = _Places(self)

    def during(self, step: TimeStep) -> "MovingProblem":
        """The equations of one step; symbolic factorisation and mass are shared."""
        moving = copy(self)
        moving.step = step
        # rounding of positions by the stiffness, known once, and by inertia
        by_inertia = np.finfo(float).eps * step.inertia * float(np.linalg.norm(abs(self.mass).sum(axis=1)))
        vars(moving)["_rounding_force"] = self._rounding_force + 32 * by_inertia
        return moving

    def mass_data(self, x: np.ndarray) -> np.ndarray:
        """Lower triangle of T^T M T on the unknowns, t, at positions x."""
        return self._mass_places.data(self.kinematics, self.mass, x)

    def evaluate(self, x: np.ndarray, pressure: np.ndarray, load: float = 1.0) -> Evaluation:
        """Evaluation at x (n, 3) mm, with inertia and overstress during a step."""
        evaluation, step = super().evaluate(x, pressure, load), self.step
        if step is None:
            return evaluation
        moving = self.mass @ (step.inertia * (x - step.origin) + step.offset)
        added = [np.linalg.norm(moving)]
        force = evaluation.force.copy()
        if step.overstress is not None:
            by_solids = viscous.solid_force(self.body, evaluation.response, step.overstress)
            moving = moving + by_solids
            added.append(np.linalg.norm(by_solids))
            if evaluation.response.rod is not None:
                stress = viscous.rod_stress(self.body, evaluation.response, step.overstress)
                by_rod = self._on_unknowns((stress[:, None] @ evaluation.response.rod.gradient).swapaxes(1, 2))[:, 0]
                force += by_rod
                added.append(np.linalg.norm(by_rod))
        force += self.kinematics.reduce(x, moving)
        return MovingEvaluation(**{**vars(evaluation), "force": force}, moving=moving, moving_size=float(max(added)))

    def stiffness(
        self, evaluation: Evaluation, lam: np.ndarray, before: Evaluation | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Lower triangle of the tangent, with c M and the overstress' stiffness during a step, and dtheta
        (`Problem.stiffness`)."""
        data, dtheta = super().stiffness(evaluation, lam, before)
        if self.step is None:
            return data, dtheta
        data = data + self.step.inertia * self.mass_data(evaluation.x)
        if self.step.overstress is not None:
            data += self.overstress_data(evaluation, self.step.overstress)
        if self.robot.rigid and not self._nodal:
            data += self.kinematics.stiffness(evaluation.x, np.empty(0), evaluation.moving)
        return data, dtheta

    def overstress_data(self, evaluation: Evaluation, over: Overstress) -> np.ndarray:
        """Lower triangle, on the unknowns, of the overstress' stiffness, N/mm."""
        full, kinematics = self.kinematics.full, self.kinematics
        if self.body.solids:
            nodal = np.zeros(full.nnz)
            viscous.add_solid_stiffness(self.body, evaluation.response, over, full.slots[0], nodal)
            data = kinematics.stiffness(evaluation.x, nodal, np.zeros_like(evaluation.x))
        else:
            data = np.zeros(self.pattern.nnz)
        if evaluation.response.rod is not None:
            add_blocks(viscous.rod_stiffness(self.body, evaluation.response, over), kinematics.joint_slots, data)
        return data

    def scale(self, evaluation: Evaluation, lam: np.ndarray) -> float:
        """Force, N, to which residuals are relative: as in equilibrium, of the internal force alone, and no less than
        inertia's and viscosity's."""
        if self.step is None:
            return super().scale(evaluation, lam)
        at_rest = Evaluation(
            **{name: value for name, value in vars(evaluation).items() if not name.startswith("moving")}
            | {"force": evaluation.force - self.kinematics.reduce(evaluation.x, evaluation.moving)}
        )
        return max(super().scale(at_rest, lam), evaluation.moving_size)

    def _unbalanced(self, evaluation: Evaluation, lam: np.ndarray) -> np.ndarray:
        nodal = super()._unbalanced(evaluation, lam)
        return nodal + evaluation.moving if isinstance(evaluation, MovingEvaluation) else nodal


@dataclass(frozen=True)
class NodalPayload:
    """A point mass that an affine combination of nodes carries: nodes (k,), weights (k,) of sum 1, mass t."""

    nodes: np.ndarray
    weights: np.ndarray
    mass: float

    def matrix(self, n: int) -> sp.coo_array:
        """Mass matrix (n, n) t of the payload."""
        k = len(self.nodes)
        rows, columns = np.repeat(self.nodes, k), np.tile(self.nodes, k)
        return sp.coo_array((self.mass * np.outer(self.weights, self.weights).ravel(), (rows, columns)), shape=(n, n))


class _Places:
    """Places of T^T M T in the pattern of the unknowns; constant where no node is rigid."""

    def __init__(self, problem: MovingProblem):
        pattern = problem.pattern
        columns = np.repeat(np.arange(pattern.n_dof), np.diff(pattern.indptr))
        self._keys = columns * pattern.n_dof + pattern.indices
        self._constant: np.ndarray | None = None

    def data(self, kinematics, mass: sp.csr_array, x: np.ndarray) -> np.ndarray:
        """Lower triangle of T^T M T, at positions x (n, 3) mm."""
        if self._constant is not None:
            return self._constant
        T = kinematics.transfer_matrix(x)
        nodal = sp.kron(mass, sp.eye_array(3), format="csr")
        product = sp.coo_array(sp.tril(T.T @ (nodal @ T)))
        rows, columns = product.coords
        keys = columns.astype(np.int64) * T.shape[1] + rows
        place = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        placed = (self._keys[place] == keys) | (product.data == 0.0)
        if not placed.all():
            raise AssertionError(f"{(~placed).sum()} masses couple unknowns that the stiffness does not")
        data = np.zeros(len(self._keys))
        np.add.at(data, place, product.data)
        if kinematics.groups is None:
            self._constant = data
        return data
