"""The plant of a loop as the spec has it: finite elements, a model or a device, behind its sensors, under its push."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cfem.control.closed_loop.estimated import camera_of
from cfem.control.closed_loop.estimated_account import judged
from cfem.control.closed_loop.run_spec import ClosedLoopSpec
from cfem.control.closed_loop.spec import LoopSpec
from cfem.control.task.design import robot_at
from cfem.control.task.loads import under_loads
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.system.robot import Robot
from cfem.motion.altered import Altered
from cfem.motion.model import MotionModel
from cfem.plant.device.device_plant import DevicePlant
from cfem.plant.device.spec import transport_of
from cfem.plant.imperfect_plant import DriftingPlant, Imperfection, ImperfectPlant, Stiffer
from cfem.plant.marked_plant import MarkedPlant
from cfem.plant.model_plant import ModelPlant
from cfem.plant.moving_plant import MovingFemPlant, MovingModelPlant
from cfem.plant.protocol import Plant
from cfem.predict.at_parameters import AtParameters
from cfem.predict.protocol import Predictor
from cfem.robot.spec import SceneSpec

PlantOf = Callable[[int], Any]  # seed -> context of a plant


def plants_of(
    spec: ClosedLoopSpec,
    base: Path,
    robot: Robot,
    predictors: Mapping[str, Predictor],
    motions: Mapping[str, MotionModel],
) -> PlantOf:
    """Factory of plants, one for each run: the same robot for all, with sensors of its own; a device starts anew."""
    loop, rest_e = spec.loop, robot.rest_e
    if spec.plant == "device":
        markers = () if loop.estimate is None else tuple(loop.estimate.markers)
        known = {"markers": markers, "length": robot.length, "reach": robot.reach}
        period = 1 / loop.rate
        return lambda seed: DevicePlant(
            transport_of(loop.device, robot.rows, base, period), robot.rows, rest_e, loop.answer_within, period, **known
        )
    push, since = push_of(loop, robot)
    if spec.plant == "model" and loop.moving:
        real = Altered(motions[next(iter(predictors))], loop.real.stiffer, loop.real.viscosity)
        plain, pushed = MovingModelPlant(real, 1 / loop.rate, loop.moving.substeps, push, since), None
    elif spec.plant == "fem":
        places = None
        if loop.estimate:
            model = next(iter(predictors.values()))
            places = np.array(list(loop.estimate.markers.values())), model.skin.rest[judged(model)]
        plain, pushed = _fem_plants(spec, base, next(iter(predictors.values())), push, since, places)
    else:
        real = Stiffer(next(iter(predictors.values())), loop.real.stiffer)
        plain = ModelPlant(real, rest_e, unilateral=robot.unilateral)
        pushed = None if push is None else ModelPlant(real, rest_e, push, robot.unilateral)
    sensor, quantum = loop.sensor, loop.command.quantum
    imperfection = Imperfection(sensor.noise, 1 / loop.ticks_a_sample, sensor.delay, quantum or 0.0)

    @contextmanager
    def plant_for(seed: int) -> Iterator[Plant]:
        both = (plain, pushed)
        if loop.real.drift:  # from the beginning in each run
            both = tuple(
                plant and DriftingPlant(plant, loop.real.drift.stiffness, loop.ticks(loop.real.drift.within))
                for plant in both
            )
        yield ImperfectPlant(both[0], imperfection, seed, both[1], since, camera_of(loop.estimate, seed))

    return plant_for


def _on_effectors(force: np.ndarray, robot: Robot) -> np.ndarray:
    """Forces (n_e,) N on all effector rows: `force` (3,) on the first effector, whose first rows are x, y, z."""
    if robot.rows.n_e < 3:
        raise SpecError("needs an effector with rows x, y, z", where="loop.disturbance")
    return np.concatenate([force, np.zeros(robot.rows.n_e - 3)])


def push_of(loop: LoopSpec, robot: Robot) -> tuple[np.ndarray | None, int]:
    """The disturbance (n_e,) N on the effectors, None without one, and the tick since which it acts."""
    if loop.disturbance is None:
        return None, 0
    return _on_effectors(loop.disturbance.force, robot), loop.disturbance.tick


def _fem_plants(
    spec: ClosedLoopSpec,
    base: Path,
    model: Predictor | AtParameters,
    push: np.ndarray | None,
    since: int,
    places: tuple[np.ndarray, np.ndarray] | None = None,
) -> tuple[Plant, Plant | None]:
    """The plant of finite elements, and the same under a push (n_e,) N on its effectors; a plant that moves takes the
    push itself, from tick `since` on. model: bound where the spec states a design. places: of the markers, and of the
    points where the true surface is recorded."""
    from cfem.plant.fem_plant import FemPlant, pushed
    from cfem.robot.build import build_robot
    from cfem.robot.load import load_scene_and_mesh

    real = spec.loop.real
    scene = base / spec.scene
    _, nodes = load_scene_and_mesh(scene, base / (real.mesh or spec.mesh))
    described = load_spec(scene, SceneSpec, real.scene)
    if isinstance(model, AtParameters):
        robot = robot_at(described, nodes, model.predictor.parameters, model.p)[0]
    else:
        robot = under_loads(spec, build_robot(described, nodes))
    if spec.loop.moving:
        moved = None if push is None else pushed(robot, push)
        plant = MovingFemPlant(robot, 1 / spec.loop.rate, spec.loop.moving.substeps, moved, since)
        return plant if places is None else MarkedPlant(plant, robot, *places), None
    if real.wall:
        from cfem.plant.walled_plant import FrictionlessWall, WalledPlant

        normal = np.asarray(real.wall.normal, float)
        wall = FrictionlessWall(real.wall.point, normal / np.linalg.norm(normal))
        robots = [robot] if push is None else [robot, pushed(robot, push)]
        plants = [WalledPlant(fe_robot, wall) for fe_robot in robots]
    else:
        robots = [robot] + ([] if push is None else [pushed(robot, push)])
        plants = [
            FemPlant(fe_robot) if places is None else MarkedPlant(FemPlant(fe_robot), fe_robot, *places)
            for fe_robot in robots
        ]
    return plants[0], plants[1] if push is not None else None
