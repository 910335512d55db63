"""The equations of one robot on its unknowns: residual, gap of the actuation, and the factored tangent.

R(x, lambda) = f_int(x) - f_ext - sum_j lambda_j grad delta_j(x) = 0        C delta(x) = target

on free nodes and rigid frames; j runs over the active rows, actuators then contacts."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from cfem.constraint.cable import Cable
from cfem.constraint.protocol import Watched
from cfem.constraint.rod_row import RodRow
from cfem.equilibrium.system.evaluation import Evaluation, SolveCost, Tangent
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.rotation_strain import RotationStrain, make_rotation_strain
from cfem.mechanics.assembly import Pattern, add_blocks
from cfem.mechanics.body import (
    bulk_over_volume,
    pressure_force,
    response,
    tangent,
    tangent_form,
    without,
)
from cfem.mechanics.factorization import analyze
from cfem.mechanics.kinematics import NO_JOINTS, make_kinematics
from cfem.mechanics.rod import region as rods


class Problem:
    """Sparsity pattern and symbolic factorisation of a robot, found once; all else is recomputed from arguments.

    like: the problem of a robot that differs in its materials, loads and places of nodes only, whose pattern and
    symbolic factorisation then serve again (its factors must not be used any more once this one has made its own); to
    be evaluated only, of one that differs in anything but its mesh and what is held or rigid.
    coupled: further groups (g, k) of nodes between which the pattern has entries.
    loads: (n, 3) N of the robot, None without any; finite: whether they are numbers (they count as none where not)"""

    def __init__(self, robot: Robot, like: "Problem | None" = None, coupled: Sequence[np.ndarray] = ()):
        """Prepares the kinematics, the symbolic factorisation and the rows that act on a rod."""
        self.robot = robot
        owner = np.full(len(robot.body.mesh.X), -1)
        for number, nodes in enumerate(robot.rigid):
            owner[nodes] = number
        self.body = without(robot.body, owner) if robot.rigid else robot.body
        sections = self.body.sections
        groups = NO_JOINTS[:, 0] if sections is None else owner[sections.nodes[:, 0]]
        joints = NO_JOINTS if self.body.rod is None else np.stack([groups[:-1], groups[1:]], axis=1)
        in_a_row = sections is not None and np.array_equal(groups, np.arange(-1, len(robot.rigid)))
        if like is None:
            cliques = [clique for row in robot.active for clique in row.cliques]
            groups_of_nodes = [*self.body.cliques, *cliques, *coupled]
            row = sections if in_a_row else None
            self.kinematics = make_kinematics(self.rest, groups_of_nodes, robot.fixed, robot.rigid, joints, row)
            self._factor, self._made = analyze(self.pattern), []
        else:
            self.kinematics, self._factor, self._made = like.kinematics, like._factor, like._made
            if self.rest is not like.rest and not robot.rigid:
                self.kinematics = replace(like.kinematics, X=self.rest)
        shares = like is not None and self.rest is like.rest
        self._coordinates: list[RotationStrain | None] = like._coordinates if shares else []
        if self.body.rod is not None:
            self._joined = self.kinematics.unknowns(joints).reshape(-1, 12)
        self._rod_rows = tuple(row for row in robot.active if isinstance(row, RodRow))
        columns = np.cumsum([0] + [len(row.rest) for row in robot.active])[:-1]
        self._strained = columns[np.array([isinstance(row, RodRow) for row in robot.active], dtype=bool)]
        # whether anything acts on nodes: where a rod and its chambers are all, there is nothing to gather from them
        self._nodal = bool(self.body.solids or len(self._rod_rows) < len(robot.active) or robot.loads is not None)
        self._bulk_over_volume = bulk_over_volume(self.body) if self.body.n_pressures else np.empty(0)
        self.finite = robot.loads is None or bool(np.isfinite(robot.loads).all())
        self.loads = robot.loads if self.finite else None
        self._loads = None if self.loads is None else self.kinematics.reduce(self.rest, self.loads)
        # residuals are relative to the forces at hand, but never to less than a strain of 1e-10 over the whole body
        self.force_floor = 1e-10 * self.body.shear * robot.body.mesh.size**2

    def under(self, forces: np.ndarray) -> "Problem":
        """This problem under further constant forces (n, 3) N on the nodes; all factors are shared."""
        loads = forces if self.robot.loads is None else self.robot.loads + forces
        loaded = copy(self)
        loaded.robot, loaded.finite = replace(self.robot, loads=loads), bool(np.isfinite(loads).all())
        loaded.loads, loaded._nodal = loads if loaded.finite else None, True
        loaded._loads = None if loaded.loads is None else self.kinematics.reduce(self.rest, loads)
        return loaded

    @property
    def rotation_strain(self) -> RotationStrain | None:
        """Coordinates of the body in which its large motions are nearly linear; None where it has none."""
        if not self._coordinates:
            self._coordinates.append(make_rotation_strain(self.robot.body, self.robot.fixed))
        return self._coordinates[0]

    @property
    def n_active(self) -> int:
        """Active rows, of actuators and contacts."""
        return self.robot.rows.n_a + self.robot.rows.n_c

    @property
    def pattern(self) -> Pattern:
        return self.kinematics.pattern

    @property
    def rest(self) -> np.ndarray:
        return self.robot.body.mesh.X

    def evaluate(self, x: np.ndarray, pressure: np.ndarray, load: float = 1.0) -> Evaluation:
        """Evaluation at x (n, 3) mm. An empty pressure stands for the one that x itself demands."""
        body_response = response(self.body, x, pressure)
        nodal = body_response.force if self.loads is None else body_response.force - load * self.loads
        force = self.kinematics.reduce(x, nodal) if self._nodal else np.zeros(self.pattern.n_dof)
        H = self.gradients(self.robot.active, x)
        if body_response.rod is not None:
            force += self._on_unknowns(body_response.rod.force[:, :, None])[:, 0]
        strained = tuple(row.strained(body_response.rod.strain.e) for row in self._rod_rows)
        if strained:
            pulls = np.stack([row.by_e for row in strained], axis=-1)
            H[:, self._strained] += self._on_unknowns(body_response.rod.gradient.swapaxes(1, 2) @ pulls)
        delta = [None if isinstance(row, RodRow) else row.value(x) - row.rest for row in self.robot.active]
        growths = iter(strained)
        delta = np.concatenate([np.zeros(0), *([next(growths).value] if each is None else each for each in delta)])
        return Evaluation(x, body_response.pressure, load, body_response, force, delta, H, strained=strained)

    def potential(self, evaluation: Evaluation) -> float:
        """Potential U - f_ext . u, N mm."""
        work = 0.0 if self.loads is None else evaluation.load * float(np.sum(self.loads * (evaluation.x - self.rest)))
        return evaluation.response.energy - work

    def gradients(self, rows: tuple[Watched, ...], x: np.ndarray) -> np.ndarray:
        """Gradients (n_dof, rows) of the constraints by the unknowns."""
        count = sum(len(row.rest) for row in rows)
        if not any(len(row.nodes) for row in rows):
            return np.zeros((self.pattern.n_dof, count))
        nodal = np.zeros((len(x), 3, count))
        column = 0
        for row in rows:
            end = column + len(row.rest)
            nodal[row.nodes, :, column:end] = row.gradient(x).transpose(1, 2, 0)
            column = end
        return self.kinematics.reduce(x, nodal)

    def stiffness(
        self, evaluation: Evaluation, lam: np.ndarray, before: Evaluation | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Lower triangle of A = d f_int/dx - sum_j lambda_j hess delta_j, and dtheta of the elements. before: where the
        linear step to `evaluation` began, whose predicted stress then stiffens or softens A (body.tangent)."""
        if not self._nodal:
            data, none = np.zeros(self.pattern.nnz), np.zeros((0, self.body.element.n_nodes, 3))
            return self._with_rod(evaluation, lam, data), none
        full = self.kinematics.full
        data = np.zeros(full.nnz)
        of_body = len(self.body.cliques)
        dtheta = tangent(self.body, evaluation.response, full.slots[:of_body], data, before and before.response)
        slots, column = iter(full.slots[of_body:]), 0
        for row in self.robot.active:
            mine = [next(slots) for _ in row.cliques]
            if mine and lam[column] != 0.0:
                for slot, blocks in zip(mine, row.curvature(evaluation.x), strict=True):
                    add_blocks(-lam[column] * blocks, slot, data)
            column += len(row.rest)
        if not self.robot.rigid:
            return data, dtheta
        return self._with_rod(
            evaluation, lam, self.kinematics.stiffness(evaluation.x, data, self._unbalanced(evaluation, lam))
        ), dtheta

    def _with_rod(self, evaluation: Evaluation, lam: np.ndarray, data: np.ndarray) -> np.ndarray:
        if evaluation.response.rod is not None:
            add_blocks(self._rod_blocks(evaluation, lam), self.kinematics.joint_slots, data)
        return data

    def form(self, evaluation: Evaluation, lam: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Quadratic form q^T A q (k, k) N mm of changes q (n_dof, k) of the unknowns, without A."""
        if not self._nodal:
            return self._form_of_rod(evaluation, lam, q)
        motions = self.kinematics.spread(evaluation.x, q)
        out = tangent_form(self.body, evaluation.response, motions)
        column = 0
        for row in self.robot.active:
            if row.cliques and lam[column] != 0.0:
                out -= lam[column] * curvature_form(row, evaluation.x, motions)
            column += len(row.rest)
        if self.robot.rigid:
            out = out + self.kinematics.turning_form(evaluation.x, q, self._unbalanced(evaluation, lam))
        return out + self._form_of_rod(evaluation, lam, q)

    def _form_of_rod(self, evaluation: Evaluation, lam: np.ndarray, q: np.ndarray) -> np.ndarray | float:
        if evaluation.response.rod is None:
            return 0.0
        return self.rod_form(self._rod_blocks(evaluation, lam), q)

    def rod_form(self, blocks: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Products (k, k) N mm of changes q (n_dof, k) of the unknowns with blocks (m, 12, 12) of the rod's
        elements."""
        mine = np.concatenate([q, np.zeros((1, q.shape[1]))])[self._joined]
        return np.tensordot(mine, blocks @ mine, axes=((0, 1), (0, 1)))

    def rod_strains(self, evaluation: Evaluation, q: np.ndarray) -> np.ndarray:
        """Strains (m, 6, k) mm and rad of the rod's elements by changes q (n_dof, k) of the unknowns."""
        mine = np.concatenate([q, np.zeros((1, q.shape[1]))])[self._joined]
        return evaluation.response.rod.gradient @ mine

    def rod_forces(self, evaluation: Evaluation, stress: np.ndarray) -> np.ndarray:
        """Forces (n_dof, k) N on the unknowns by stresses (m, 6, k) of the rod's elements, N and N mm."""
        return self._on_unknowns(evaluation.response.rod.gradient.swapaxes(1, 2) @ stress)

    def factor(
        self, evaluation: Evaluation, lam: np.ndarray, cost: SolveCost, before: Evaluation | None = None
    ) -> Tangent:
        """Factors the tangent at a state. Raises SingularMatrixError."""
        data, dtheta = self.stiffness(evaluation, lam, before)
        cost.factorizations += 1
        self._made[:] = []
        self._made[:] = [Tangent(self._factor(data), dtheta)]
        return self._made[0]

    @property
    def latest(self) -> Tangent | None:
        """The only factored tangent that may still be used, of this problem or of those that share its factorisation;
        None before any."""
        return self._made[0] if self._made else None

    def pressure_residual(self, evaluation: Evaluation, tangent: Tangent) -> np.ndarray:
        """Residual force (n_dof,) N from pressures that have not converged."""
        if len(evaluation.response.mismatch) == 0:
            return np.zeros(self.pattern.n_dof)
        return self.kinematics.reduce(
            evaluation.x, pressure_force(self.body, tangent.dtheta, evaluation.response.mismatch)
        )

    def pressure_step(self, evaluation: Evaluation, tangent: Tangent, step: np.ndarray) -> np.ndarray:
        """Change (m,) MPa of the element pressures that goes with the change `step` (n_dof,) of the unknowns."""
        if len(evaluation.response.mismatch) == 0:
            return np.empty(0)
        moved = self.kinematics.spread(evaluation.x, step)
        work = np.einsum("mai,mai->m", tangent.dtheta, moved[self.body.cells])
        return evaluation.response.mismatch + self._bulk_over_volume * work

    def scale(self, evaluation: Evaluation, lam: np.ndarray) -> float:
        """Force, N, to which residuals are relative: the largest of |f_int|, |f_ext|, |H lambda| and the floor."""
        load = 0.0 if self._loads is None else evaluation.load * float(np.linalg.norm(self._loads))
        internal = evaluation.force if self._loads is None else evaluation.force + evaluation.load * self._loads
        return max(float(np.linalg.norm(internal)), load, float(np.linalg.norm(evaluation.H @ lam)), self.force_floor)

    def rounding(self, evaluation: Evaluation, lam: np.ndarray) -> float:
        """Relative residual that rounding of the positions alone makes."""
        return float(self._rounding_force * np.abs(evaluation.x).max() / self.scale(evaluation, lam))

    @cached_property
    def _rounding_force(self) -> float:
        """Force, N a mm of |x|, that rounding makes: eps |diag A| at rest, and eight times that where the positions of
        rigid groups, which several operations round, make it up."""
        evaluation = self.evaluate(self.rest, np.empty(0), 0.0)
        stiffest = np.linalg.norm(self.stiffness(evaluation, np.zeros(self.n_active))[0][self.pattern.indptr[:-1]])
        return float((8 if self.robot.rigid else 1) * np.finfo(float).eps * stiffest)

    def relative_residual(self, evaluation: Evaluation, lam: np.ndarray, tangent: Tangent | None = None) -> float:
        """Relative residual |R with the demanded pressures| over `scale`; the tangent is needed where pressures lag
        behind."""
        parts = np.linalg.norm(evaluation.residual(lam)) + (
            np.linalg.norm(self.pressure_residual(evaluation, tangent))
            if len(evaluation.response.mismatch) and tangent
            else 0.0
        )
        return float(parts / self.scale(evaluation, lam))

    def _rod_blocks(self, evaluation: Evaluation, lam: np.ndarray) -> np.ndarray:
        """Tangent stiffness (m, 12, 12) N/mm of the rod under the rows that pull at its strains."""
        tensions = lam[self._strained]
        pulled = sum((t * row.by_e for t, row in zip(tensions, evaluation.strained, strict=True)), 0.0)
        blocks = rods.stiffness(self.body.rod, evaluation.response.rod, pulled)
        bent = [t * row.second for t, row in zip(tensions, evaluation.strained, strict=True) if row.second is not None]
        if bent:
            gradient = evaluation.response.rod.gradient
            blocks = blocks - gradient.swapaxes(1, 2) @ sum(bent) @ gradient
        return blocks

    def _on_unknowns(self, joined: np.ndarray) -> np.ndarray:
        """Sums (n_dof, k) of values (m, 12, k) on the unknowns of the sections that the rod's elements join."""
        out = np.zeros((self.pattern.n_dof + 1, joined.shape[2]))  # the last row for sections that are held
        np.add.at(out, self._joined, joined)
        return out[:-1]

    def _unbalanced(self, evaluation: Evaluation, lam: np.ndarray) -> np.ndarray:
        """Nodal residual (n, 3) N."""
        nodal = evaluation.response.force.copy()
        if self.loads is not None:
            nodal -= evaluation.load * self.loads
        column = 0
        for row in self.robot.active:
            end = column + len(row.rest)
            nodal[row.nodes] -= np.einsum("j,jki->ki", lam[column:end], row.gradient(evaluation.x))
            column = end
        return nodal


def curvature_form(row: Watched, x: np.ndarray, motions: np.ndarray) -> np.ndarray:
    """Curvature (k, k) M^T hess delta M of a row that has one, M the motions (n, 3, k)."""
    if isinstance(row, Cable):
        return row.curvature_form(x, motions)
    form = np.zeros((motions.shape[2], motions.shape[2]))
    for clique, blocks in zip(row.cliques, row.curvature(x), strict=True):
        mine = motions[clique].reshape(len(clique), 3 * clique.shape[1], motions.shape[2])
        form += np.einsum("gik,gil->kl", mine, blocks @ mine)
    return form
