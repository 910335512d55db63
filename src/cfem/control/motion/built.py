"""Controllers from their spec: the static one, alone or shaped, a computed feed-forward, and the predictive one."""

import numpy as np

from cfem.condensed import Condensed
from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.pilots import Situation
from cfem.control.closed_loop.run import TickedController
from cfem.control.closed_loop.spec import ControllerSpec
from cfem.control.closed_loop.tick import Pilot
from cfem.control.motion.feedforward import Computed, Shaped
from cfem.control.motion.horizon import Bounds, HalfSpace, HorizonCost
from cfem.control.motion.mpc import Mpc, Plan
from cfem.control.motion.observer import Doubt
from cfem.core.errors import SpecError
from cfem.motion.clocked import Clocked
from cfem.motion.model import MotionModel
from cfem.motion.mpc_spec import MpcSpec
from cfem.plant.gains import Gains

_NO_NOISE = 0.01  # mm, of a sensor without


def controller_of(
    spec: ControllerSpec, pilot: Pilot, gains: Gains | None, motion: MotionModel | None, situation: Situation
) -> TickedController:
    """Controller that knows how the robot moves, or the static one; pilot: of the static controller; motion: None where
    nothing asks for it."""
    start = None if situation.start is None else situation.start.delta_a
    dt = 1 / situation.loop.rate
    if spec.mpc is not None:
        condensed = situation.start or pilot.model.at_displacement(np.zeros(len(pilot.ridge)))
        return _mpc(spec, pilot, motion, situation, condensed)
    if spec.feedforward:
        return Computed(pilot, motion, situation.rest_e, np.zeros(len(pilot.ridge)) if start is None else start, dt)
    static = Controller(pilot, situation.rest_e, gains, start, situation.far)
    if spec.shaping is None:
        return static
    return Shaped(static, motion, pilot.command == "displacement", spec.shaping.kind, spec.shaping.modes, dt)


def _mpc(spec: ControllerSpec, pilot: Pilot, motion: MotionModel, situation: Situation, start: Condensed) -> Mpc:
    """Predictive controller of the spec, starting at rest in the state `start`."""
    mpc: MpcSpec = spec.mpc
    estimate = situation.loop.estimate
    forces, known = pilot.command == "force", motion.static.domain
    command, course = pilot.limits.lambda_a, pilot.limits.delta_a
    if not forces:
        command, course = course, command
    full = np.abs(known.lambda_a if forces else situation.reach.T).max(axis=0)
    size = situation.length / full
    cost = HorizonCost(pilot.weights, np.sqrt(mpc.smooth) * size, np.sqrt(mpc.effort) * size)
    bounds = Bounds(command, np.full(len(full), pilot.rate), course, _planes(mpc, len(situation.rest_e)))
    plan = Plan(mpc.horizon, cost, bounds, pilot.settings.backend, mpc.moves)
    clocked = Clocked(motion, pilot.command, 1 / situation.loop.rate, start.delta_a)
    doubt = (
        None
        if spec.mode == "open"
        else doubt_of(mpc, situation.loop.sensor.noise or (estimate.noise if estimate else 0.0))
    )
    return Mpc(clocked, plan, situation.rest_e, start, doubt)


def doubt_of(spec: MpcSpec, noise: float) -> Doubt:
    """Uncertainty that the spec states, or the sensor has; noise: mm, of the sensor."""
    stated = spec.doubt
    known = noise or _NO_NOISE if stated.noise is None else stated.noise
    return Doubt(known, stated.stiffness, stated.viscosity, stated.wander, stated.offset, stated.push, spec.gate)


def _planes(spec: MpcSpec, n_e: int) -> tuple[HalfSpace, ...]:
    planes = []
    for obstacle in spec.obstacles:
        if n_e < 3:
            raise SpecError("needs an effector with rows x, y, z", where="loop.controllers")
        normal = np.asarray(obstacle.normal, float) / np.linalg.norm(obstacle.normal)
        planes.append(HalfSpace(np.concatenate([normal, np.zeros(n_e - 3)]), float(normal @ obstacle.point)))
    return tuple(planes)
