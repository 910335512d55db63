"""From what `control.yaml` says of an object and the robots that hold it to models and a plant."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.coupling import Coupled, Holder, RigidObject
from cfem.condensed.model import Model
from cfem.contact.obstacle import Box
from cfem.control.holding.grasp import from_table, margin_of
from cfem.control.holding.gripping import Grip, Gripping
from cfem.control.holding.spec import HoldingSpec
from cfem.control.holding.squeeze import balanced
from cfem.core.errors import InputError, NumericalError
from cfem.equilibrium.contact.grasp import FreeObject
from cfem.equilibrium.contact.ground import Pads
from cfem.equilibrium.contact.held_patch import contact_points, patch_of
from cfem.equilibrium.contact.patch_compliance import within_patch
from cfem.equilibrium.contact.points import PlacedRobot, PointRobot
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.plant.fem_patch import CoupledFem, FemPatch
from cfem.plant.grip_plant import GripPlant
from cfem.predict.contact.gripping_finger import LearnedFinger, WithinPatch
from cfem.predict.protocol import Predictor
from cfem.robot.mesh.placement import motion_of

TABLE = 0.01  # mm/N of each of the four points of a table, in every direction
WITHIN = 0.8  # of the way from the middle of a side to its edges, where these points are
LONGEST = 0.05  # of its reach: the longest way of an actuator in one step
TOUCHES = 1e-6  # mm between a contact point and the object at rest


@dataclass(frozen=True)
class RobotsAndObject:
    """Several robots and what they hold, with the interface that control asks of one (`Robot` of cfem.equilibrium).
    X (n, 3) and facets are of all robots, one after the other, at rest, and of the object, whose points are the last.
    forces: no bounds stated."""

    rows: Rows
    rest_e: np.ndarray
    reach: np.ndarray
    unilateral: np.ndarray
    length: float
    X: np.ndarray
    facets: np.ndarray
    object_points: int
    actuator_units: tuple[tuple[str, str], ...]
    forces: None = None

    @property
    def aims(self) -> np.ndarray:
        """Mask (n_e,) of the effector rows that every goal is set for: the object's place."""
        return ~np.array(self.rows.turns)


def assembled(
    spec: HoldingSpec, robot: Robot, predictors: Mapping[str, Predictor], models: Mapping[str, Path]
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
    force = np.zeros(3) if spec.object.force is None else spec.object.force
    held = RigidObject(spec.object.centre, turns, np.concatenate([force, np.zeros(n - 3)]), spec.oriented)
    places = [motion_of(robot_spec.rotate, robot_spec.translate) for robot_spec in spec.robots]
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
    mesh = robot.body.mesh
    points, surface = box_surface(spec.object.centre, spec.object.half_size, mesh.facets.shape[1])
    facts = RobotsAndObject(
        first.rows,
        held.rest_e,
        np.tile(robot.reach, (count, 1)),
        np.tile(robot.unilateral, count),
        robot.length,
        np.concatenate([*(mesh.X @ turn.T + shift for turn, shift in places), points]),
        np.concatenate([*(mesh.facets + i * len(mesh.X) for i in range(count)), surface + count * len(mesh.X)]),
        len(points),
        robot.actuator_units * count,
    )
    return facts, coupled, fem


def gripped(
    spec: HoldingSpec, robot: Robot, models: Mapping[str, Coupled]
) -> tuple[Grip | None, Mapping[str, Model], GripPlant]:
    """Grip, models and FE plant; no grip, and the models as they are, for contact points that are glued. InputError
    where a contact point that may open does not touch the object at rest, SpecError where the robots cannot hold it."""
    about, law, mu = spec.object, spec.object.law, spec.object.friction if spec.object.law == "coulomb" else 0.0
    shape = Box(about.half_size, t=about.centre)
    force = np.zeros(3) if about.force is None else about.force
    held = FreeObject(shape, about.centre, np.concatenate([force, np.zeros(3)]), about.turns, oriented=spec.oriented)
    n_a, count = robot.rows.n_a, len(spec.robots)
    fingers = [
        PlacedRobot(Problem(robot), *motion_of(robot_spec.rotate, robot_spec.translate)) for robot_spec in spec.robots
    ]
    points, _ = box_surface(about.centre, about.half_size, robot.body.mesh.facets.shape[1])
    ends, preload = n_a * np.arange(count + 1), spec.search.preload
    longest = np.tile(LONGEST * np.abs(robot.reach).max(axis=1), count)

    def grip(robots: Sequence[PointRobot], grasp: np.ndarray, table: Pads | None) -> GripPlant:
        return GripPlant(robots, ends, held, law, mu, points, grasp if preload else None, about.margin, table, longest)

    if law == "bilateral":
        return None, models, GripPlant(fingers, ends, held, law, mu, points, longest=longest)
    _demand_touch(spec, robot, shape, fingers)
    if any(hold.n_pose < 6 for glued in models.values() for hold in glued.holds):
        do = "add contact.rotation to sample.yaml, sample and train"
        raise InputError(
            "points that open one by one turn their patch, and the model was sampled with one that cannot", do=do
        )
    patch = patch_of(contact_points(fingers[0].problem), turns=True)
    within, plans_by_name = WithinPatch(*within_patch(robot, patch)), {}
    table = table_under(about.centre, about.half_size, force) if about.table else None
    for name, glued in models.items():
        learned = [LearnedFinger(hold.model, patch, within, hold.turn, hold.shift) for hold in glued.holds]
        grasp = balanced(learned, held, preload) if about.balanced else np.full(n_a * count, preload)
        robots = grip(learned, grasp, table)
        if table:
            plans = from_table(robots, glued, mu, about.margin, grasp, preload)
        else:
            plans = Gripping(robots, glued, mu, about.margin, grasp, margin_of(robots))
        plans_by_name[name] = plans
    first = next(iter(plans_by_name.values()))
    fe = grip(fingers, first.home, table)
    return Grip.of(first, fe), plans_by_name, fe


def table_under(centre: np.ndarray, half_size: np.ndarray, force: np.ndarray) -> Pads:
    """Table under the side of a box that `force` points to, as four points of it."""
    axis = int(np.abs(force).argmax())
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], float)
    below = signs[signs[:, axis] == np.sign(force[axis])] * np.where(np.arange(3) == axis, 1.0, WITHIN)
    return Pads(np.asarray(centre) + below * half_size, TABLE)


def _demand_touch(spec: HoldingSpec, robot: Robot, shape: Box, fingers: Sequence[PlacedRobot]) -> None:
    """Raises InputError where a contact point stands within the object, or away from one that nothing but the robots
    holds."""
    gaps = np.array([shape.distance(finger.points) for finger in fingers])
    do = "choose object.centre and object.half_size so that all contact points touch it"
    for wrong, what in (
        (-gaps, "is {0:.3g} mm inside the object"),
        (gaps, "does not reach the object: {0:.3g} mm are missing"),
    )[: 1 if spec.object.table else 2]:
        number, point = np.unravel_index(wrong.argmax(), gaps.shape)
        if wrong.max() > TOUCHES:
            name = robot.rows.contacts[3 * point].rsplit(".", 1)[0]
            fault = what.format(wrong.max())
            raise InputError(f"contact point '{name}' of robot '{spec.robots[number].name}' {fault}", do=do)


def box_surface(centre: np.ndarray, half_size: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, 3) mm and facets of a box: quadrilaterals (width 4), or triangles of 3 or 6 nodes, as the mesh has."""
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], float)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    corners = np.asarray(centre) + signs * half_size
    if width == 4:
        return corners, quads
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    if width == 3:
        return corners, triangles
    ends = corners[triangles]  # (12, 3, 3)
    both = np.concatenate([ends, (ends + np.roll(ends, -1, axis=1)) / 2], axis=1)
    return both.reshape(-1, 3), np.arange(72).reshape(12, 6)


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
