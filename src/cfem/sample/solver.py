"""Solver that sampling asks of a robot: its facts and its equilibria. The finite-element robot is one; tests have
another."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.parameters import Parameter
from cfem.condensed.pose import Patch
from cfem.condensed.skin import Skin
from cfem.condensed.viscosity import Viscosity
from cfem.constraint.skin_rows import SkinRows
from cfem.constraint.surface import Surface, outer_surface, triangulated
from cfem.contact.surface.overlap import Boundary, boundary_of
from cfem.core.errors import NumericalError, SpecError
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.rotation_strain import RotationStrain
from cfem.equilibrium.system.solution import Equilibrium, State
from cfem.mechanics.mesh import Mesh
from cfem.mechanics.self_contact import SelfContact
from cfem.robot.same_robot import robot_of
from cfem.robot.spec import SceneSpec
from cfem.sample.processes import tally
from cfem.sample.skin import Inside

# Share of a parameter's range on either side, by which robots are differenced: truncation about 1e-8 of the slopes.
_STEP = 1e-4
ROUGH = 1e-5  # relative residual of states that only show the modes of the surface


@dataclass(frozen=True)
class Facts:
    """Facts of a scene that samples need.

    scene: name
    rows: its pose's coordinates are the contacts, if any
    reach: (n_a, 2) mm
    rest_e: (n_e,) mm
    length: mm
    compliance: (n_a, n_a) W_aa at rest, with the pose of the patch behind the actuators where there is one
    parameters: sampled and exact ones
    row_units: of each row's displacement and multiplier, empty where all are mm and N
    patch: that holds the contact points, None where they are free
    forces: (n_a, 2) smallest and largest multipliers, None where the scene does not state them
    in_a_row: whether the robot is of rigid sections in a row, each state of which best starts from the nearest
    robot: what the scene says of it, None where there is no scene
    surface: of the scene's own robot, None where it has none
    viscosity: of each viscous material, None where no dynamics are asked for
    inner: the number of inner motions whose mass is recorded
    masses: t, by the name of the effector that is the centre of that mass
    inside: the nodes that are not of the surface, None where there are none
    boundary: by which parts of the body may pass through each other, None of rigid sections in a row
    contact: of its walls with each other, None where they have none
    unilateral: (n_a,) actuators that go slack rather than push, (0,) where none does"""

    scene: str
    rows: Rows
    reach: np.ndarray
    rest_e: np.ndarray
    length: float
    compliance: np.ndarray
    parameters: tuple[Parameter, ...] = ()
    row_units: tuple[tuple[str, str], ...] = ()
    patch: Patch | None = None
    forces: np.ndarray | None = None
    in_a_row: bool = False
    robot: Mapping[str, Any] | None = None
    surface: Surface | None = None
    viscosity: tuple[Viscosity, ...] | None = None
    inner: int = 0
    masses: Mapping[str, float] = field(default_factory=dict)
    inside: Inside | None = None
    unilateral: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    boundary: Boundary | None = None
    contact: SelfContact | None = None


class Solver(Protocol):
    facts: Facts

    @property
    def rotation_strain(self) -> RotationStrain | None:
        """Coordinates in which its states are combined, None where positions are."""

    def solve(self, actuation: Actuation, start: State | None, p: np.ndarray) -> Equilibrium:
        """Equilibrium of the robot at p (n_p,), from `start`; from rest where that is None or fails. Its slopes are by
        the sampled parameters' coordinates. Depends on its arguments alone, not on earlier calls."""

    def watching(self, skin: Skin) -> "Solver":
        """Solver whose equilibria have the rows of the skin. Needs facts.surface."""

    def roughly(self, pushed: Skin | None = None) -> "Solver":
        """Solver to a loose tolerance, without derivatives of W; with about how all nodes yield to forces on the rows
        `pushed`."""


# Built once in every process: picklable to it.
SolverFactory = Callable[[], Solver]


@dataclass(frozen=True)
class FiniteElements:
    """Factory of the finite-element solver of a scene on its mesh, to a relative residual `tolerance`.

    turns: whether the patch of its contact points can turn, None where nothing holds them
    dynamics: whether mass and viscosity are asked for
    slack: whether unilateral actuators go slack rather than push"""

    scene: SceneSpec
    mesh: Mesh
    tolerance: float
    parameters: tuple[Parameter, ...] = ()
    third_order: bool = False
    loads: int = 0
    turns: bool | None = None
    dynamics: bool = False
    slack: bool = True

    def __call__(self) -> Solver:
        """Solver of the scene in this process."""
        from cfem.condensed.pose import onto_patch
        from cfem.equilibrium.contact.held_patch import contact_points, patch_of
        from cfem.equilibrium.motion.inertia import mass_of
        from cfem.equilibrium.motion.inner_motions import rod_stresses
        from cfem.equilibrium.newton import NewtonSettings
        from cfem.equilibrium.solve import solve
        from cfem.equilibrium.system.actuation import force
        from cfem.equilibrium.system.problem import Problem
        from cfem.sample.family import RobotFamily

        family = RobotFamily(self.scene, self.mesh, self.parameters)
        robot = family.robot
        units = row_units(robot, self.turns)
        problem, settings = Problem(robot), NewtonSettings(tolerance=self.tolerance)
        rest = solve(problem, force(np.zeros(robot.rows.n_a)), settings=settings)
        if not rest.converged:
            raise NumericalError(f"no equilibrium with free actuators: {rest.status.value}", where="sample")
        patch, compliance = None, rest.condensed.W_aa
        if self.turns is not None:
            if not robot.contacts:
                raise SpecError(f"scene '{robot.name}' has no contacts, and `contact` needs them for its patch")
            patch = patch_of(contact_points(problem), self.turns)
            at_rest = onto_patch(rest.condensed, patch, np.zeros(patch.n))
            compliance = at_rest.W[at_rest.rows.active, at_rest.rows.active]
        mass, stresses = mass_of(robot) if self.dynamics else None, None
        if mass is not None and robot.body.rod is not None and not self.parameters:
            stresses = rod_stresses(problem, mass)
        surface = outer_surface(robot.X, robot.body.mesh.facets)
        within = np.setdiff1d(np.arange(len(robot.X)), surface.nodes)
        facts = Facts(
            scene=robot.name,
            rows=replace(robot.rows, contacts=patch.names if patch else ()),
            reach=robot.reach,
            rest_e=robot.rest_e,
            length=robot.length,
            compliance=compliance,
            parameters=self.parameters,
            row_units=units,
            patch=patch,
            forces=robot.forces,
            in_a_row=problem.kinematics.row is not None,
            robot=robot_of(self.scene),
            surface=surface,
            viscosity=tuple(law for law in robot.viscosity if not law.none) if self.dynamics else None,
            inner=0 if stresses is None else stresses.shape[2],
            masses=robot.masses,
            inside=Inside(within, robot.X[within]) if len(within) else None,
            unilateral=robot.unilateral if self.slack else np.zeros(0, dtype=bool),
            boundary=None if robot.body.sections else boundary_of(robot.X, triangulated(robot.body.mesh.facets)),
            contact=robot.body.contact,
        )
        options = self.third_order, self.loads, self.slack
        return _FiniteElementSolver(facts, family, problem, settings, *options, mass, stresses)


@dataclass(frozen=True)
class _FiniteElementSolver:
    """Finite-element solver of a scene.

    problem: of the scene's own robot
    mass: its own, None where no dynamics are asked for
    stresses: of its inner motions, None where it has none
    skin: watched too, None where it is not
    pushed: see `Solver.roughly`"""

    facts: Facts
    family: Any
    problem: Any
    settings: Any
    third_order: bool
    loads: int
    slack: bool
    mass: Any = None
    stresses: Any = None
    skin: Skin | None = None
    pushed: Skin | None = None

    @property
    def rotation_strain(self) -> RotationStrain | None:
        return self.problem.rotation_strain

    def watching(self, skin: Skin) -> "_FiniteElementSolver":
        return replace(self, problem=self._problem(self.problem.robot, skin, self.problem), skin=skin)

    def roughly(self, pushed: Skin | None = None) -> "_FiniteElementSolver":
        settings = replace(self.settings, tolerance=max(ROUGH, self.settings.tolerance))
        return replace(self, settings=settings, third_order=False, loads=0, mass=None, pushed=pushed)

    def solve(self, actuation: Actuation, start: State | None, p: np.ndarray) -> Equilibrium:
        """Equilibrium of the robot at p (n_p,), with slopes by the sampled parameters' coordinates."""
        from cfem.equilibrium.derivatives.parameter_slopes import Sides
        from cfem.equilibrium.motion.inertia import mass_of
        from cfem.equilibrium.solve import Wanted, solve

        problem, sides, mass = self.problem, (), self.mass
        if len(p):
            problem = self._problem(self.family.at(p), self.skin, self.problem if self.family.alike else None)
            mass = None if mass is None else mass_of(problem.robot)
            around = (self.family.around(p, index, _STEP) for index in range(len(p)))
            sides = [
                Sides(self._problem(behind, self.skin, problem), self._problem(ahead, self.skin, problem), width)
                for behind, ahead, width in around
            ]
        # states of other shapes are told by how far nodes are from their rest, measured from the reference's rest
        shift = problem.rest - self.problem.rest
        moved = bool(shift.any())
        start = start if start is None or not moved else replace(start, x=start.x + shift)
        equilibrium = solve(
            problem,
            actuation,
            start,
            settings=self.settings,
            slack=self.slack,
            wanted=Wanted(
                third_order=self.third_order,
                loads=self.loads,
                sides=sides,
                pushed=None if self.pushed is None else SkinRows(self.pushed, problem.robot.X),
                mass=mass,
                stresses=self.stresses,
            ),
            cost=tally.cost(),
        )
        return (
            replace(equilibrium, state=replace(equilibrium.state, x=equilibrium.state.x - shift))
            if moved
            else equilibrium
        )

    def _problem(self, robot: Any, skin: Skin | None, like: Any) -> Any:
        from cfem.equilibrium.skinned import skinned
        from cfem.equilibrium.system.problem import Problem

        return Problem(robot if skin is None else skinned(robot, skin), like=like)


def row_units(robot: Any, turns: bool | None = None) -> tuple[tuple[str, str], ...]:
    """Units of the displacement and of the multiplier of each row; turns: whether the patch of the contact points can
    turn, None where nothing holds them, and they are no rows."""
    pose = [] if turns is None else [("mm", "N")] * 3 + [("rad", "N mm")] * (3 * turns)
    return (*robot.rows.effector_units, *robot.actuator_units, *pose)
