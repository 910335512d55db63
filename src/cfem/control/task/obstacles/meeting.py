"""A robot that meets obstacles, twice: its learned models with contact, and its finite elements."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cfem.condensed.model_error import ContactError
from cfem.contact.prescribed_motion import ActuatedRobot
from cfem.control.task.obstacles.clearance import demand_apart, demand_near, demand_outside, demand_way
from cfem.control.task.obstacles.read import ReadObstacles, read_obstacles
from cfem.control.task.obstacles.spec import ObstaclesSpec
from cfem.control.task.obstacles.world import ObstacleWorld, world_of
from cfem.core.errors import NumericalError, located
from cfem.core.spec import meaning
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.system.robot import Robot
from cfem.plant.touch_plant import TouchPlant
from cfem.predict.contact.kept_error import kept_contact_error
from cfem.predict.contact.model import ContactModel
from cfem.predict.contact.obstacle_spec import RobotObstacle
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.surface.kept_patches import fe_points, node_model_of, patched_model_of
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.protocol import Predictor
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh, made_from
from cfem.robot.same_robot import demand_robot
from cfem.surrogate.contact_error import calibrated_contact


@dataclass(frozen=True)
class OtherRobot:
    """A soft robot that is an obstacle.

    learned, fe: its model and its finite elements where they stand
    course: of its actuators
    stated: error of its contact, None where nothing is stated"""

    learned: PlacedModel
    fe: SkinnedRobot
    course: ActuatedRobot
    stated: ContactError | None


def with_obstacles(
    spec: ObstaclesSpec, base: Path, robot: Robot, predictors: Mapping[str, Predictor], models: Mapping[str, Path]
) -> tuple[ObstacleWorld, dict[str, ContactModel], TouchPlant]:
    """World that the spec asks for, the models with contact by name, and the FE robot. InputError where a model has no
    skin or its form does not fit, SpecError where the robot starts inside something."""
    obstacles = read_obstacles(spec, base)
    for name, model in predictors.items():  # before finite elements take a while
        with located(models[name]):
            demand_outside(robot, model.skin.nodes, obstacles.at_first)
            demand_way(robot, model.skin.nodes, obstacles.moving)
            demand_near(robot, model.skin.nodes, obstacles.touched)
    others = {
        name: other_robot(spec, spec.obstacles[name], base, name, course) for name, course in obstacles.robots.items()
    }
    made_of = made_from(base / spec.scene, base / spec.mesh) | {"loads": meaning(spec.loads)}
    learned = {}
    for name, model in predictors.items():
        with located(models[name]):
            touched = _touched(spec, model, models[name], robot, made_of)
            stated = _stated(spec, touched, models[name], robot, made_of)
        learned[name] = _contact_model(spec, obstacles, others, touched, robot, stated)
        demand_apart(learned[name])
    first, model = next(iter(learned.values())), next(iter(predictors.values()))
    skinned = SkinnedRobot(robot, model.skin.nodes, model.skin.triangles, fe_points(first.patched, robot))
    return world_of(spec, obstacles, first), learned, _fe_plant(spec, obstacles, others, skinned)


def _touched(
    spec: ObstaclesSpec, model: Predictor, folder: Path, robot: Robot, made_of: Mapping[str, Any]
) -> SurfaceModel:
    """A model that may be touched at the points that the spec asks for."""
    if spec.at_nodes:
        return node_model_of(model, folder, robot, made_of)
    return patched_model_of(model, folder, robot, made_of, *spec.contact.cut)


def _stated(
    spec: ObstaclesSpec, touched: SurfaceModel, folder: Path, robot: Robot, made_of: Mapping[str, Any]
) -> ContactError | None:
    """Error of the contact of a model of `folder`; None where the spec asks for none, or no place tells it."""
    mu, places = spec.contact.friction, spec.error_places

    def solve() -> ContactError | None:
        try:
            return calibrated_contact(touched, robot, places, mu)
        except NumericalError:
            return None

    return kept_contact_error(touched, folder, made_of, mu, places, solve) if places else None


def _contact_model(
    spec: ObstaclesSpec,
    obstacles: ReadObstacles,
    others: Mapping[str, OtherRobot],
    touched: SurfaceModel,
    robot: Robot,
    stated: ContactError | None,
) -> ContactModel:
    """A learned robot among the obstacles, which states its error where that of each robot is known."""
    errors = stated, *(soft_obstacle.stated for soft_obstacle in others.values())
    return ContactModel(
        touched,
        {name: body for name, body in obstacles.rigid.items() if name not in obstacles.avoided},
        obstacles.pressed,
        {name: obstacles.rigid[name] for name in obstacles.avoided},
        spec.contact.friction,
        courses=obstacles.moving,
        others={name: (soft_obstacle.learned, soft_obstacle.course) for name, soft_obstacle in others.items()},
        itself=obstacles.itself,
        unilateral=robot.unilateral,
        stated=() if None in errors else errors,
    )


def _fe_plant(
    spec: ObstaclesSpec, obstacles: ReadObstacles, others: Mapping[str, OtherRobot], skinned: SkinnedRobot
) -> TouchPlant:
    """The FE robot among the obstacles."""
    return TouchPlant(
        skinned,
        obstacles.rigid,
        obstacles.pressed,
        obstacles.avoided,
        spec.contact.friction,
        obstacles.moving,
        {name: (soft_obstacle.fe, soft_obstacle.course) for name, soft_obstacle in others.items()},
        obstacles.itself,
    )


def other_robot(
    spec: ObstaclesSpec, obstacle: RobotObstacle, base: Path, name: str, course: ActuatedRobot
) -> OtherRobot:
    """A robot that may be touched; name: of the obstacle. InputError where its model is not of its scene."""
    scene_path, folder, model = base / (obstacle.scene or spec.scene), base / obstacle.model, course.model
    scene, mesh = load_scene_and_mesh(scene_path, None if obstacle.scene else base / spec.mesh)
    demand_robot(scene, model.meta.get("robot"), folder, f"name its scene in obstacles.{name}.scene")
    robot, skin = build_robot(scene, mesh), model.skin
    mesh_folder = scene_path.parent / scene.out if obstacle.scene else base / spec.mesh
    made_of = made_from(scene_path, mesh_folder) | {"loads": {}}
    with located(folder):
        touched = _touched(spec, model, folder, robot, made_of)
        stated = _stated(spec, touched, folder, robot, made_of)
    place = course.R, course.t, False
    return OtherRobot(
        PlacedModel(touched, *place, robot.unilateral),
        SkinnedRobot(robot, skin.nodes, skin.triangles, fe_points(touched, robot), *place),
        course,
        stated,
    )
