"""The same motion in full finite elements."""

from dataclasses import replace

import numpy as np

from cfem.core.errors import InputError, NumericalError
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import Actuation, displacement, force
from cfem.equilibrium.system.robot import Robot
from cfem.fe_motion import problem as full
from cfem.fe_motion.simulate import MotionRun, StepControl, simulate
from cfem.fe_motion.start import at_rest
from cfem.motion.commands import CommandTable
from cfem.motion.payload import Payload


def simulate_full(
    robot: Robot, commands: CommandTable, until: float, dt: float, payload: Payload | None, unilateral: np.ndarray
) -> MotionRun:
    """Motion of the FE robot in steps of dt s, halved where they do not converge. unilateral: (n_a,) actuators that go
    slack. NumericalError where the first command has no equilibrium, InputError where finite elements cannot carry the
    payload."""
    robot = replace(robot, unilateral=unilateral)
    carried: tuple[full.NodalPayload, ...] = ()
    if payload is not None:
        effector = (
            robot.effectors[payload.rows[0] // 3] if len(robot.rows.effectors) == 3 * len(robot.effectors) else None
        )
        attachment = getattr(effector, "attachment", None)
        if attachment is None:
            raise InputError("full finite elements carry a payload at points in the body only", do="leave `full` out")
        carried = (full.NodalPayload(attachment.nodes, attachment.weights, payload.mass),)
        loads = np.zeros_like(robot.X) if robot.loads is None else robot.loads.copy()
        loads[attachment.nodes] += attachment.weights[:, None] * payload.weight
        robot = replace(robot, loads=loads)
    problem = full.MovingProblem(robot, carried)

    def command_at(t: float) -> Actuation:
        value = commands.at(t)
        return displacement(value) if commands.kind == "displacement" else force(value)

    begin = float(commands.t[0])
    rest = solve(problem, command_at(begin))
    if not rest.converged:
        raise NumericalError(f"full finite elements at the first command: {rest.status.value}")
    kinks = [float(t) for t in commands.t[1:] if t < until]
    return simulate(
        problem, at_rest(problem, rest.state, begin), command_at, until, kinks, StepControl(dt, tolerance=None)
    )
