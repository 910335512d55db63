"""The goals of a trajectory that a spec describes."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.far import FAR, doubt, far_of
from cfem.control.task.goals.trajectory import along, arc, half_sphere, loop_of_shares, with_approach
from cfem.control.task.goals.trajectory_spec import ArcSpec, GoalsSpec, HalfSphereSpec, ImageSpec, TrajectorySpec
from cfem.core.console.progress import progress
from cfem.core.errors import InputError, NumericalError, SpecError
from cfem.dataset.tables import read_table
from cfem.equilibrium.system.robot import Robot
from cfem.plant.fem_plant import FemPlant


def goals_of(
    name: str, trajectory: TrajectorySpec, base: Path, robot: Robot, fem: FemPlant, shift: np.ndarray
) -> np.ndarray:
    """Goals (m, n_e) mm absolute of a trajectory. Goals that are images are fewer than asked for where the robot has no
    stable state (`left_out`). NumericalError where most of them have none.

    base:  folder of the spec
    robot: or what stands for several and their object
    shift: (n_e,) mm by how much goals move with a design, empty without one"""
    if isinstance(trajectory, ArcSpec):
        on_arc = arc(*(getattr(trajectory, key) for key in ("centre", "radius", "start", "end", "plane", "goals")))
        on_arc = _on_rows(name, trajectory, on_arc, robot, shift)
        return with_approach(on_arc, robot.rest_e, trajectory.from_rest)
    if isinstance(trajectory, HalfSphereSpec):
        points = half_sphere(trajectory.centre, trajectory.radius, trajectory.turns, trajectory.goals)
        return _on_rows(name, trajectory, points, robot, shift)
    if isinstance(trajectory, GoalsSpec):
        oriented = [] if trajectory.rotation is None else [trajectory.rotation]
        points = trajectory.points
        if trajectory.file is not None:
            aimed = [row for row, aims in zip(robot.rows.effectors, robot.aims, strict=True) if aims]
            points = read_goals(base / trajectory.file, aimed)
        points = points if trajectory.goals is None else along(points, trajectory.goals)
        return _on_rows(name, trajectory, np.hstack([points, *oriented]), robot, shift)
    centre, radii = _shares(name, trajectory, robot.rows.n_a)
    shares = loop_of_shares(centre, radii, trajectory.goals, trajectory.shape)
    return _images(name, shares, fem)


def _images(name: str, shares: np.ndarray, fem: FemPlant) -> np.ndarray:
    """Effectors (k, n_e) mm at shares (m, n_a) of the actuators' reach, without those where finite elements find no
    stable state, as where a body snaps. NumericalError where they find none for more than half."""
    goals, missing = [], []
    with progress(f"solving the goals of {name} by FE", len(shares)) as advance:
        for number, share in enumerate(shares):
            try:
                goals.append(fem.pull(share).x_e)
            except NumericalError as error:
                missing.append((number, share, error))
            advance(1)
    if 2 * len(missing) > len(shares):
        number, share, error = missing[0]
        first = f"the first is goal {number}, at {np.round(share, 2).tolist()} of the reach ({error})"
        do = "lower centre and radii, or the reach in scene.yaml"
        what = f"no stable state is found for {len(missing)} of {len(shares)} goals; {first}"
        raise NumericalError(what, where=f"trajectories.{name}", do=do)
    return np.array(goals)


def read_goals(path: Path, rows: Sequence[str]) -> np.ndarray:
    """Goals (m, n) of effector rows, mm and rad, from a table. InputError where it lacks a row of them, or a number."""
    units = {row: "rad" if turns else "mm" for row, turns in zip(rows, Rows(tuple(rows), ()).turns, strict=True)}
    table = read_table(path, units)
    goals = table.stack(rows)
    lacking = [row for row in rows if row not in table.columns]
    if lacking:
        do = f"the goals need {', '.join(rows)}"
        raise InputError(f"has no column '{lacking[0]}'", where=str(path), do=do)
    if not len(goals):
        raise InputError("holds no goal", where=str(path), do="give one row per goal")
    for place, goal in zip(table.places, goals, strict=True):
        if np.isnan(goal).any():
            raise InputError(f"has no number for {rows[int(np.isnan(goal).argmax())]}", where=place)
    return goals


def demand_fits(name: str, trajectory: TrajectorySpec, n_a: int, n_e: int, aims: int) -> None:
    """SpecError where a trajectory has numbers for another number of actuators, or of effector rows: all, n_e, or those
    that goals are set for."""
    if isinstance(trajectory, ImageSpec):
        _shares(name, trajectory, n_a)
    if isinstance(trajectory, GoalsSpec) and trajectory.points is not None and trajectory.rotation is None:
        numbers = trajectory.points.shape[1]
        _demand_rows(name, numbers, aims if numbers == aims else n_e)


def _shares(name: str, trajectory: ImageSpec, n_a: int) -> tuple[list[float], list[float]]:
    try:
        return trajectory.shares(n_a)
    except ValueError as error:
        do = "give one number for all, or one per actuator"
        raise SpecError(str(error), where=f"trajectories.{name}", do=do) from None


def _demand_rows(name: str, numbers: int, rows: int) -> None:
    if numbers != rows:
        what = f"a goal has {numbers} numbers, the robot {rows} effector rows"
        do = "give x, y, z of each effector, in the order of the scene; weight 0 in search.weights leaves a row free"
        raise SpecError(what, where=f"trajectories.{name}", do=do)


def _on_rows(
    name: str, trajectory: ArcSpec | HalfSphereSpec | GoalsSpec, goals: np.ndarray, robot: Robot, shift: np.ndarray
) -> np.ndarray:
    """Goals (m, n_e) mm of all effector rows, from stated ones (m, k) mm of all rows or of those that are aimed at:
    then the others stay at rest. shift (n_e,) mm is added to every goal, unless it is empty."""
    aims = robot.aims
    if goals.shape[1] != aims.sum():  # no goal is set for a centre of mass, unless all rows are stated
        _demand_rows(name, goals.shape[1], robot.rows.n_e)
        aims = np.ones(robot.rows.n_e, dtype=bool)
    stated, goals = goals, np.tile(robot.rest_e, (len(goals), 1))
    goals[:, aims] = stated + (robot.rest_e[aims] if trajectory.about == "rest" else 0.0)
    return goals + shift if len(shift) else goals


def demand_near(name: str, goals: np.ndarray, robot: Robot) -> None:
    """SpecError where one of the goals (m, n_e) mm is so far away that it must have another unit."""
    far = far_of(robot.rows, robot.length)
    for index, goal in enumerate(goals):
        strange = doubt(goal, robot.rest_e, far)
        if strange:
            do = f"check the unit of the goals, and `length` of the scene: a goal may be {FAR:g} lengths away"
            raise SpecError(f"goal {index} {strange}", where=f"trajectories.{name}", do=do)
