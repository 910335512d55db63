"""Everything that a control run needs: the robot, the models that plan, the plant that carries out, and the goals."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.control.closed_loop.run_spec import ClosedLoopSpec
from cfem.control.holding.assembly import holding
from cfem.control.holding.spec import HoldingSpec
from cfem.control.task.design import designed
from cfem.control.task.goals.from_spec import demand_near, goals_of
from cfem.control.task.loads import carrying
from cfem.control.task.obstacles.meeting import with_obstacles
from cfem.control.task.obstacles.spec import ObstaclesSpec
from cfem.control.task.obstacles.world import ObstacleWorld
from cfem.control.task.run_spec import FamilySpec, LoadedSpec, RunSpec, TrackingSpec
from cfem.control.task.same_rows import demand_same_rows
from cfem.core.actuator_units import demand_units
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.mesh import Mesh
from cfem.plant.fem_plant import FemPlant
from cfem.plant.model_plant import ModelPlant
from cfem.plant.protocol import Plant
from cfem.predict.load import LiveModel, load_model
from cfem.predict.protocol import Predictor
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.same_robot import demand_robot
from cfem.robot.spec import SceneSpec


@dataclass(frozen=True)
class Prepared:
    """Run that is ready to begin.

    robot: what control asks of it, with its object where it has one
    fem: the FE model that plans by FE matrices, which grades too where there is no contact; None without one
    touched: the plant of contact, None without any
    world: what plans know of contact beside the effectors
    goals: (m, n_e) mm absolute by trajectory
    load_error: mm that the models miss under the loads, None without loads"""

    scene: SceneSpec
    mesh: Mesh
    robot: Any
    predictors: Mapping[str, Predictor]
    plant: Plant
    fem: Any
    touched: Any
    world: ObstacleWorld | None
    goals: Mapping[str, np.ndarray]
    load_error: float | None

    @property
    def rest_e(self) -> np.ndarray:
        """Rest positions (n_e,) mm of all rows that goals are set for."""
        return self.world.rest(self.robot.rest_e) if self.world else self.robot.rest_e


def prepare(
    spec: TrackingSpec,
    base: Path,
    mesh: Path,
    models: Mapping[str, Path],
    goals: Mapping[str, np.ndarray] | None = None,
) -> Prepared:
    """Robot, models, plant and goals of a run. goals: where they are known already. InputError where a model is not of
    this robot, SpecError where the spec does not fit it."""
    scene_and_mesh = load_scene_and_mesh(base / spec.scene, mesh)
    robot, predictors, shift = robot_and_models(spec, base, scene_and_mesh, models)
    demand_units(spec, robot.actuator_units)
    world = touched = None
    if isinstance(spec, HoldingSpec):
        held = holding(spec, base, robot, predictors, models)
        robot, predictors, fem, world, touched = held.robot, held.models, held.fem, held.grip, held.plant
        plant, error = touched, None
    else:
        demand_same_rows(robot, predictors, models)
        robot, predictors = carrying(spec, base, robot, predictors, models)
        fem, error = FemPlant(robot) if spec.plant == "fem" else None, _load_error(spec, predictors)
        rest_e = robot.rest_e
        if isinstance(spec, ObstaclesSpec):
            world, predictors, touched = with_obstacles(spec, base, robot, predictors, models)
            rest_e = world.rest(rest_e)
        unilateral = None if world else robot.unilateral  # a model with contact lets cables go itself
        by_model = ModelPlant(next(iter(predictors.values())), rest_e, unilateral=unilateral)
        plant = (touched or fem) if fem else by_model
    if goals is None:
        goals = {
            name: goals_of(name, trajectory, base, robot, fem, shift) for name, trajectory in spec.trajectories.items()
        }
        for name, points in goals.items():
            if spec.trajectories[name].kind != "image":
                demand_near(name, points, robot)
        if world:
            goals = {name: world.goals(points) for name, points in goals.items()}
    return Prepared(*scene_and_mesh, robot, predictors, plant, fem, touched, world, goals, error)


def robot_and_models(
    spec: RunSpec, base: Path, scene_and_mesh: tuple[SceneSpec, Mesh], models: Mapping[str, Path]
) -> tuple[Robot, dict[str, Predictor], np.ndarray]:
    """Robot and models of a spec, and by how much goals move with the design (n_e,) mm, empty without one."""
    read = LiveModel if isinstance(spec, ClosedLoopSpec) and spec.loop.live else load_model
    predictors = {name: read(path, spec.runtime) for name, path in models.items()}
    for name, predictor in predictors.items():
        do = f"train a model of {base / spec.scene}, or name the scene of this one"
        demand_robot(scene_and_mesh[0], predictor.meta.get("robot"), models[name], do)
    if not isinstance(spec, FamilySpec) or not spec.design:
        return build_robot(*scene_and_mesh), predictors, np.zeros(0)
    return designed(*scene_and_mesh, predictors, spec.design)


def _load_error(spec: LoadedSpec, predictors: Mapping[str, Predictor]) -> float | None:
    """Error (mm) of the models under the loads, None without loads."""
    return max(model.meta["wrench_error"] for model in predictors.values()) if spec.loads else None
