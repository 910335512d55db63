"""Robots that move between ticks: a command is carried out over a period, and the robot need not be at rest at its
end. One in full finite elements, and a condensed one to try things out on."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed.model import under_force
from cfem.core.errors import NumericalError
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import Actuation, displacement, force
from cfem.equilibrium.system.robot import Robot
from cfem.fe_motion.problem import MovingProblem
from cfem.fe_motion.scheme import Scheme
from cfem.fe_motion.simulate import KeptTangent, MotionRun, StepControl, simulate
from cfem.fe_motion.start import at_rest
from cfem.motion import step as condensed
from cfem.plant.protocol import Command, Measurement


class MovingFemPlant:
    """`Plant`. A robot with mass, in steps of the generalised-alpha scheme, `substeps` a tick, which are halved where
    they are not found. Forces and displacements move evenly over a tick to the commanded ones. Actuators that would
    have to push go slack where displacements are commanded.

    steps, factorizations, refused: what it has cost"""

    moves = True

    def __init__(self, robot: Robot, period: float, substeps: int, pushed: Robot | None = None, since: int = 0):
        """Begins at rest. period: s of a tick; pushed: the robot that takes the robot's place from tick `since` on, in
        the same motion."""
        self._problems = [MovingProblem(plant_robot) for plant_robot in (robot, pushed) if plant_robot is not None]
        self._period, self._pace = period, StepControl(period / substeps, longest=period, tolerance=None)
        self._since, self._t = since, 0
        self._kept: KeptTangent | None = None
        self._motion = at_rest(self._problems[0], solve(self._problems[0], displacement(robot.reach[:, 0] * 0)).state)
        self._told = np.zeros(robot.rows.n_a)
        self.steps = self.factorizations = self.refused = 0

    @property
    def x(self) -> np.ndarray:
        """Nodes (n, 3) mm now."""
        return self._motion.x

    def settle(self, u: ArrayLike, kind: Command = "displacement") -> Measurement:
        """Measurement at rest under u, before the first tick. NumericalError where there is no such equilibrium."""
        u, problem = np.asarray(u, float), self._problems[0]
        equilibrium = solve(problem, _prescribed(kind, u), slack=True)
        if not equilibrium.converged:
            raise NumericalError(f"FE robot: {equilibrium.status.value}")
        self._motion, self._told, self._t, self._kept = at_rest(problem, equilibrium.state), u, 0, None
        x_e = problem.robot.rest_e + equilibrium.delta_e
        return Measurement(x_e, equilibrium.delta_a, equilibrium.lambda_a, 0, "converged")

    def step(self, u: ArrayLike, kind: Command = "displacement") -> Measurement:
        """Measurement at the end of a tick in which the command moves evenly to u."""
        self._t += 1
        u, begin = np.asarray(u, float), self._motion.t
        problem = self._problems[-1 if self._t >= self._since else 0]

        def command(t: float) -> Actuation:
            return _prescribed(kind, self._told + min((t - begin) / self._period, 1.0) * (u - self._told))

        run = simulate(problem, self._motion, command, begin + self._period, (), self._pace, Scheme(), kept=self._kept)
        self._account(run)
        if run.why is not None:
            return Measurement.failed(problem.robot.rows.n_e, len(u), self._t, f"FE robot in motion: {run.why}")
        self._motion, self._told, self._kept = replace(run.end, t=self._period * self._t), u, run.kept
        last, n_a = run.samples[-1], len(u)
        return Measurement(problem.robot.rest_e + last.delta_e, last.delta[:n_a], last.lam[:n_a], self._t, "converged")

    def _account(self, run: MotionRun) -> None:
        self.steps += len(run.samples) - 1
        self.factorizations += run.cost.factorizations
        self.refused += len(run.refused)


class MovingModelPlant:
    """`Plant`. The condensed model that moves, or an `Altered` one, for the robot: it proves nothing about the
    model."""

    moves = True

    def __init__(self, model: Any, period: float, substeps: int, push: np.ndarray | None = None, since: int = 0):
        """Begins at rest. push: (n_e,) N on the effectors from tick `since` on."""
        self._model, self._dt, self._substeps = model, period / substeps, substeps
        self._push, self._since, self._t = push, since, 0
        self._motion, self._told = condensed.at_rest(model, np.zeros(model.n_a)), np.zeros(model.n_a)

    def settle(self, u: ArrayLike, kind: Command = "displacement") -> Measurement:
        """Stands still under u before the first tick. NumericalError where there is no such equilibrium."""
        u, model = np.asarray(u, float), self._model
        delta_a, self._told, self._t = u, u, 0
        if kind == "force":
            static = model.static
            near = static.at_displacement(static.domain.nearest(u, "force"))
            delta_a = under_force(static, u / getattr(model, "stiffness", 1.0), near).delta_a
        self._motion = condensed.at_rest(model, delta_a)
        return self._measurement()

    def step(self, u: ArrayLike, kind: Command = "displacement") -> Measurement:
        """Measurement at the end of a tick in which the command moves evenly to u."""
        self._t += 1
        u, last_command, motion = np.asarray(u, float), self._told, self._motion
        push = self._push if self._push is not None and self._t >= self._since else None
        try:
            for index in range(self._substeps):
                # a force of its mean over the step, a displacement of its end
                share = (index + (0.5 if kind == "force" else 1.0)) / self._substeps
                goal = {kind: last_command + share * (u - last_command)}
                motion = condensed.step(self._model, motion, condensed.MotionCommand(**goal, push=push), self._dt)
        except NumericalError as error:
            return Measurement.failed(len(self._model.rest_e), len(u), self._t, str(error))
        self._motion, self._told = motion, u
        return self._measurement()

    def _measurement(self) -> Measurement:
        model, now = self._model, self._motion
        x_e = model.rest_e + condensed.effectors(model, now)
        return Measurement(x_e, now.q[: model.n_a].copy(), now.lam, self._t, "converged")


def _prescribed(kind: Command, u: np.ndarray) -> Actuation:
    return force(u) if kind == "force" else displacement(u)
