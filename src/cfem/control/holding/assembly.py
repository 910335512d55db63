"""From what `control.yaml` says of an object and the robots that hold it to models and a plant."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.coupling import Coupled, Holder, RigidObject, object_rows
from cfem.condensed.model import Model
from cfem.contact.obstacle import Obstacle
from cfem.control.holding.body import HeldBody, body_of
from cfem.control.holding.grasp import from_table, margin_of
from cfem.control.holding.gripping import Grip, Gripping
from cfem.control.holding.spec import HoldingSpec
from cfem.control.holding.squeeze import balanced
from cfem.control.task.same_rows import demand_same_rows
from cfem.core.errors import InputError, NumericalError, SpecError, located
from cfem.equilibrium.contact.grasp import FreeObject
from cfem.equilibrium.contact.held_patch import contact_points, patch_of
from cfem.equilibrium.contact.patch_compliance import within_patch
from cfem.equilibrium.contact.points import PlacedRobot, PointRobot
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surface_robot import PlacedSurface, chosen
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.plant.fem_patch import CoupledFem, FemPatch
from cfem.plant.grip_plant import GripPlant
from cfem.predict.contact.gripping_finger import LearnedFinger, WithinPatch
from cfem.predict.contact.surface.kept_patches import fe_points, node_model_of
from cfem.predict.contact.surface_finger import SurfaceFinger
from cfem.predict.protocol import Predictor
from cfem.robot.load import made_from
from cfem.robot.mesh.placement import motion_of

LONGEST = 0.05  # of its reach: the longest way of an actuator in one step
TOUCHES = 1e-6  # mm between a contact point and the object at rest, and, of its radius, how far a surface is within it
UNLOADED = {"loads": {}}


@dataclass(frozen=True)
class RobotsAndObject:
    """Several robots and what they hold, with the interface that control asks of one (`Robot` of cfem.equilibrium).
    X (n, 3) and facets are of all robots, one after the other, at rest, and of the object, whose points are the last.
    object_radius: mm from its centre to its farthest point
    forces: no bounds stated"""

    rows: Rows
    rest_e: np.ndarray
    reach: np.ndarray
    unilateral: np.ndarray
    length: float
    X: np.ndarray
    facets: np.ndarray
    object_points: int
    object_radius: float
    actuator_units: tuple[tuple[str, str], ...]
    forces: None = None

    @property
    def aims(self) -> np.ndarray:
        """Mask (n_e,) of the effector rows that every goal is set for: the object's place."""
        return ~np.array(self.rows.turns)


@dataclass(frozen=True)
class Holding:
    """Robots and their object, ready for control.

    robot: what control asks of one robot
    models: by name
    fem: the finite elements that control by FE matrices plans with, None where nothing does
    grip: what plans keep of the grip, None for contact points that are glued
    plant: of finite elements"""

    robot: RobotsAndObject
    models: Mapping[str, Any]
    fem: CoupledFem | None
    grip: Grip | None
    plant: GripPlant


def holding(
    spec: HoldingSpec, base: Path, robot: Robot, predictors: Mapping[str, Predictor], models: Mapping[str, Path]
) -> Holding:
    """Robots that hold an object as the spec says: by their contact points, where the models were sampled with these
    held, else by all of their surface. InputError where a model is not of the scene's robot, SpecError where the robots
    cannot hold the object."""
    body = body_of(spec.object, base)
    if any(predictor.meta.get("n_c") for predictor in predictors.values()):
        facts, coupled, fem = assembled(spec, body, robot, predictors, models)
        grip, plans, plant = gripped(spec, body, robot, coupled)
        return Holding(facts, plans, fem, grip, plant)
    (name, predictor), places = next(iter(predictors.items())), _places(spec)
    if spec.object.law != "coulomb":
        do = "give object.law: coulomb, or train on samples with `contact`"
        raise InputError("a model of the free robot holds an object by friction alone", where=str(models[name]), do=do)
    demand_same_rows(replace(robot, rows=replace(robot.rows, contacts=())), predictors, models)
    with located(models[name]):
        for robot_spec, (R, t) in zip(spec.robots, places, strict=True):
            _demand_outside(body, robot_spec.name, robot.X[predictor.skin.nodes] @ R.T + t)
        touched = node_model_of(
            predictor, models[name], robot, made_from(base / spec.scene, base / spec.mesh) | UNLOADED
        )
    points, skin = fe_points(touched, robot), predictor.skin
    fingers = [
        PlacedSurface.at_rest(SkinnedRobot(robot, skin.nodes, skin.triangles, points, R, t, itself=False))
        for R, t in places
    ]
    learned = [SurfaceFinger(touched, R, t) for R, t in places]
    names = tuple(robot_spec.name for robot_spec in spec.robots)
    of_object = object_rows(spec.oriented, names, robot.rows.actuators)
    plans = _plans(spec, body, robot, learned, of_object)
    plant = _grip(spec, body, robot, fingers, plans.home)
    return Holding(_facts(spec, body, robot, of_object), {name: plans}, None, Grip.of(plans, plant), plant)


def assembled(
    spec: HoldingSpec, body: HeldBody, robot: Robot, predictors: Mapping[str, Predictor], models: Mapping[str, Path]
) -> tuple[RobotsAndObject, dict[str, Coupled], CoupledFem | None]:
    """Robots and their object, models of these whose points are glued, and the finite elements that control by FE
    matrices plans with, None where nothing does. InputError where a model is not of the scene's robot with its contact
    points held."""
    n_pose = {name: _pose_rows(predictor, robot, models[name]) for name, predictor in predictors.items()}
    turns = spec.object.turns
    if turns and min(n_pose.values()) < 6:
        raise InputError(
            "was sampled with a patch that cannot turn, but the object can turn", do="set object.turns: false"
        )
    n = 6 if turns else 3
    held = RigidObject(body.centre, turns, np.concatenate([_force(spec), np.zeros(n - 3)]), spec.oriented)
    places = _places(spec)
    n_a, count = robot.rows.n_a, len(places)
    origin = patch_of(contact_points(Problem(robot)), turns).origin

    def holds(models_of: list[Model], n_of: int) -> list[Holder]:
        return [
            Holder(robot_spec.name, model, n_a, n_of, turn, shift, origin)
            for robot_spec, model, (turn, shift) in zip(spec.robots, models_of, places, strict=True)
        ]

    coupled = {}
    for name, predictor in predictors.items():
        mine = holds([predictor] * count, n_pose[name])
        start = _stable(mine, held, np.tile(_taut_state(predictor, n_pose[name]), count))
        coupled[name] = Coupled(mine, held, start, spec.updates)
    first, fem = next(iter(coupled.values())), None
    if spec.fe_based:
        rows = max(n_pose.values())
        fem = CoupledFem(holds([FemPatch(robot, turns=rows == 6) for _ in places], rows), held, first.home)
    return _facts(spec, body, robot, first.rows), coupled, fem


def _facts(spec: HoldingSpec, body: HeldBody, robot: Robot, rows: Rows) -> RobotsAndObject:
    """Robots and object as control sees them; rows: of the object, and of all actuators."""
    mesh, places = robot.body.mesh, _places(spec)
    points, surface = body.facets(mesh.facets.shape[1])
    count = len(places)
    return RobotsAndObject(
        rows,
        np.concatenate([body.centre, np.zeros(3)]) if spec.oriented else body.centre,
        np.tile(robot.reach, (count, 1)),
        np.tile(robot.unilateral, count),
        robot.length,
        np.concatenate([*(mesh.X @ turn.T + shift for turn, shift in places), points]),
        np.concatenate([*(mesh.facets + i * len(mesh.X) for i in range(count)), surface + count * len(mesh.X)]),
        len(points),
        body.radius,
        robot.actuator_units * count,
    )


def gripped(
    spec: HoldingSpec, body: HeldBody, robot: Robot, models: Mapping[str, Coupled]
) -> tuple[Grip | None, Mapping[str, Model], GripPlant]:
    """Grip, models and FE plant; no grip, and the models as they are, for contact points that are glued. InputError
    where a contact point that may open does not touch the object at rest, SpecError where the robots cannot hold it."""
    fingers = [PlacedRobot(Problem(robot), *place) for place in _places(spec)]
    if spec.object.law == "bilateral":
        return None, models, _grip(spec, body, robot, fingers, None)
    _demand_touch(spec, robot, body.shape, fingers)
    if any(hold.n_pose < 6 for glued in models.values() for hold in glued.holds):
        do = "add contact.rotation to sample.yaml, sample and train"
        raise InputError(
            "points that open one by one turn their patch, and the model was sampled with one that cannot", do=do
        )
    patch = patch_of(contact_points(fingers[0].problem), turns=True)
    within, plans_by_name = WithinPatch(*within_patch(robot, patch)), {}
    for name, glued in models.items():
        learned = [LearnedFinger(hold.model, patch, within, hold.turn, hold.shift) for hold in glued.holds]
        plans_by_name[name] = _plans(spec, body, robot, learned, glued.rows)
    first = next(iter(plans_by_name.values()))
    fe = _grip(spec, body, robot, fingers, first.home)
    return Grip.of(first, fe), plans_by_name, fe


def _plans(spec: HoldingSpec, body: HeldBody, robot: Robot, learned: Sequence[PointRobot], of_object: Rows) -> Gripping:
    """Plans of learned robots that grip the object, from its table where it stands on one."""
    about, preload, names = spec.object, spec.search.preload, tuple(robot_spec.name for robot_spec in spec.robots)
    held = _free(spec, body)
    grasp = np.full(len(of_object.actuators), preload)
    if about.balanced:
        grasp = balanced(chosen(learned, None, held)[0], held, [robot.rows.n_a] * len(learned), preload)
    robots = _grip(spec, body, robot, learned, grasp)
    if about.table:
        return from_table(robots, of_object, names, about.friction, about.margin, grasp, preload)
    return Gripping(robots, of_object, names, about.friction, about.margin, grasp, margin_of(robots))


def _grip(
    spec: HoldingSpec, body: HeldBody, robot: Robot, robots: Sequence[PointRobot], grasp: np.ndarray | None
) -> GripPlant:
    """Robots that grip the object; grasp: (n_a,) mm that they close by, where the spec gives a preload."""
    about, count = spec.object, len(robots)
    mu = about.friction if about.law == "coulomb" else 0.0
    return GripPlant(
        robots,
        robot.rows.n_a * np.arange(count + 1),
        _free(spec, body),
        about.law,
        mu,
        body.facets(robot.body.mesh.facets.shape[1])[0],
        grasp if spec.search.preload else None,
        about.margin,
        body.table(_force(spec)) if about.table else None,
        np.tile(LONGEST * np.abs(robot.reach).max(axis=1), count),
    )


def _free(spec: HoldingSpec, body: HeldBody) -> FreeObject:
    load = np.concatenate([_force(spec), np.zeros(3)])
    return FreeObject(body.shape, body.centre, load, spec.object.turns, oriented=spec.oriented)


def _force(spec: HoldingSpec) -> np.ndarray:
    return np.zeros(3) if spec.object.force is None else np.asarray(spec.object.force, float)


def _places(spec: HoldingSpec) -> list[tuple[np.ndarray, np.ndarray]]:
    """Poses of the robots: (3, 3) and (3,) mm from the frame of each to the scene's."""
    return [motion_of(robot_spec.rotate, robot_spec.translate) for robot_spec in spec.robots]


def _demand_outside(body: HeldBody, name: str, surface: np.ndarray) -> None:
    """Raises SpecError where the surface (m, 3) mm of the robot `name` at rest reaches into the object."""
    distance = body.shape.distance(surface)
    worst = int(distance.argmin())
    if distance[worst] < -TOUCHES * body.radius:
        place = ", ".join(f"{x:.3g}" for x in surface[worst])
        what = f"robot '{name}' starts {-distance[worst]:.3g} mm inside the object, at ({place}) mm"
        raise SpecError(what, where="object.centre", do="move the object or the robot")


def _demand_touch(spec: HoldingSpec, robot: Robot, shape: Obstacle, fingers: Sequence[PlacedRobot]) -> None:
    """Raises InputError where a contact point stands within the object, or away from one that nothing but the robots
    holds."""
    gaps = np.array([shape.distance(finger.points) for finger in fingers])
    do = "choose object.centre and the size of the object so that all contact points touch it"
    for wrong, what in (
        (-gaps, "is {0:.3g} mm inside the object"),
        (gaps, "does not reach the object: {0:.3g} mm are missing"),
    )[: 1 if spec.object.table else 2]:
        number, point = np.unravel_index(wrong.argmax(), gaps.shape)
        if wrong.max() > TOUCHES:
            name = robot.rows.contacts[3 * point].rsplit(".", 1)[0]
            fault = what.format(wrong.max())
            raise InputError(f"contact point '{name}' of robot '{spec.robots[number].name}' {fault}", do=do)


def _pose_rows(predictor: Predictor, robot: Robot, where: Path) -> int:
    n_pose = int(predictor.meta.get("n_c", 0))
    if not n_pose or predictor.rows.actuators[: robot.rows.n_a] != robot.rows.actuators:
        known, needed = (", ".join(rows_of.rows.actuators) for rows_of in (predictor, robot))
        what = f"the model has the inputs {known}; an object needs {needed} and the pose of the contact points"
        raise InputError(what, where=str(where), do="train it on samples with `contact`")
    return n_pose


def _stable(holds: list[Holder], held: RigidObject, taut: np.ndarray) -> np.ndarray:
    """The largest share of `taut` (n_a,) at which the robots hold the object. NumericalError where there is none."""
    for share in (1.0, 0.5, 0.25, 0.0):
        try:
            Coupled(holds, held).at_displacement(share * taut)
        except NumericalError:
            if not share:
                raise
        else:
            break
    return share * taut


def _taut_state(predictor: Predictor, n_pose: int) -> np.ndarray:
    """Displacements (n_a,) of the actuators at the most central training state: control starts among the data."""
    known = predictor.domain.states
    n = known.shape[1] // 2
    low, high = known.min(axis=0), known.max(axis=0)
    apart = (((known - (low + high) / 2) / np.where(high > low, high - low, 1.0)) ** 2).sum(axis=1)
    return known[int(np.argmin(apart)), : n - n_pose]
