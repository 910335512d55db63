"""What sampling asks of a robot: its facts and its equilibria. The finite-element robot is one; tests have another."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from cfem.condensed import Rows
from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.solution import Equilibrium, State


@dataclass(frozen=True)
class Facts:
    """scene: name; reach: (n_a, 2) mm; rest_e: (n_e,) mm; length: mm."""

    scene: str
    rows: Rows
    reach: np.ndarray
    rest_e: np.ndarray
    length: float


class Solver(Protocol):
    facts: Facts

    def solve(self, actuation: Actuation, start: State | None) -> Equilibrium:
        """From `start`; from rest where that is None or fails. Depends on its arguments alone, not on earlier calls."""


# Built once in every process: hashable, and picklable to it.
SolverFactory = Callable[[], Solver]


@dataclass(frozen=True)
class FiniteElements:
    """Factory of the finite-element solver of a scene on a mesh artefact, to a relative residual `tolerance`."""

    scene: Path
    mesh: Path
    tolerance: float

    def __call__(self) -> Solver:
        from cfem.equilibrium.newton import Settings
        from cfem.equilibrium.problem import Problem
        from cfem.robot.build import build_robot
        from cfem.robot.load import load_scene_and_mesh

        robot = build_robot(*load_scene_and_mesh(self.scene, self.mesh))
        facts = Facts(robot.name, robot.rows, robot.reach, robot.rest_e, robot.length)
        return _FiniteElementSolver(facts, Problem(robot), Settings(tolerance=self.tolerance))


@dataclass(frozen=True)
class _FiniteElementSolver:
    facts: Facts
    problem: object
    settings: object

    def solve(self, actuation: Actuation, start: State | None) -> Equilibrium:
        from cfem.equilibrium.solve import solve

        return solve(self.problem, actuation, start, settings=self.settings)
