"""The learned bar as robot and as plant: a static model that answers like those of a folder, and a control rate."""

from functools import cache

import numpy as np
from motion.learned import LARGEST, Static, dataset, problem

from cfem.condensed import Condensed
from cfem.condensed.model import under_force
from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.tick import Pilot
from cfem.control.motion.horizon import Bounds, HorizonCost
from cfem.control.motion.mpc import Mpc, Plan
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.motion.altered import Altered
from cfem.motion.clocked import Clocked
from cfem.motion.model import MotionModel
from cfem.plant.gains import Gains
from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant
from cfem.plant.moving_plant import MovingModelPlant
from cfem.predict.series.energy import condense
from cfem.surrogate.motion import fit_motion
from cfem.surrogate.series.spectral import fit

DT, LENGTH = 3e-3, 60.0
REACH = np.array([[0.0, LARGEST]])


class Whole(Static):
    """That answers at displacements too."""

    def at_displacement(self, delta_a):
        part = self.parts(np.asarray(delta_a, float), np.zeros(0))
        W, free = condense("displacement", self.rows, np.asarray(delta_a, float), part)
        return Condensed(self.rows, W, free, part["gradient"])


@cache
def robot() -> MotionModel:
    data = dataset()
    static = Whole(data, problem().robot.rest_e, fit(data, max_degree=8, folds=3).arrays)
    return MotionModel(static, fit_motion(data, max_degree=8, folds=3)[0], data.moving.viscosity)


def standing(u: float, kind: str = "force") -> Condensed:
    static = robot().static
    near = static.at_displacement([1.5])
    return under_force(static, np.array([u]), near) if kind == "force" else static.at_displacement([u])


def clocked(kind: str = "force", dt: float = DT) -> Clocked:
    return Clocked(robot(), kind, dt, np.array([1.5]))


def plant(start: float, kind="force", stiffness=1.0, viscosity=1.0, noise=0.0, delay=0, substeps=4) -> ImperfectPlant:
    moving = MovingModelPlant(Altered(robot(), stiffness, viscosity), DT, substeps)
    moving.settle(np.array([start]), kind)
    return ImperfectPlant(moving, Imperfection(noise, 1.0, delay), seed=3)


def pilot(kind: str = "force", highest: float = 5.0) -> Pilot:
    limits = Limits(np.array([[0.0, highest]]), REACH)
    ridge = ridge_of(1e-10, REACH, LENGTH)
    return Pilot(robot().static, kind, "equilibrium", limits, np.ones(3), ridge, SearchSettings(3))


def static(start: Condensed, kind="force", integral=None) -> Controller:
    gains = None if integral is None else Gains(0.0, integral)
    return Controller(pilot(kind), robot().rest_e, gains, start.delta_a)


def mpc(start: Condensed, kind="force", doubt=None, ticks=15, rate=np.inf, highest=5.0, planes=(), smooth=1e-3) -> Mpc:
    full = 5.0 if kind == "force" else LARGEST
    cost = HorizonCost(np.ones(3), np.array([np.sqrt(smooth) * LENGTH / full]), np.array([1e-5 * LENGTH / full]))
    force, course = np.array([[0.0, highest]]), REACH + [[-0.5, 0.5]]
    command, other = (force, course) if kind == "force" else (course, force)
    bounds = Bounds(command, np.array([rate]), other, tuple(planes))
    return Mpc(clocked(kind), Plan(ticks, cost, bounds), robot().rest_e, start, doubt)


def swing(frequency: float, ticks: int, kind="force") -> np.ndarray:
    """(ticks, 3) mm: where the tip would be at rest under 2.4 N (1.5 mm) that swings by a third, from standing."""
    t = DT * np.arange(1, ticks + 1)
    share = 1 + np.sin(2 * np.pi * frequency * t) / 3 * np.minimum(t * frequency, 1.0)
    middle, static_model = (2.4 if kind == "force" else 1.5), robot().static
    near, found = standing(middle, kind), []
    for one in middle * share:
        near = under_force(static_model, np.array([one]), near) if kind == "force" else standing(one, kind)
        found.append(robot().rest_e + near.delta_e)
    return np.array(found)


def errors(controller, body: ImperfectPlant, goals: np.ndarray, kind: str = "force") -> tuple[np.ndarray, np.ndarray]:
    """mm at each tick, and the commands (ticks, 1)."""
    measured, missed, commands = None, [], []
    for k, goal in enumerate(goals):
        told = controller.tick(goal, measured, goals[k:])
        measured = body.step(told.u, kind)
        commands.append(told.u)
        missed.append(np.linalg.norm(body.actual.x_e - goal))
    return np.array(missed), np.array(commands)
