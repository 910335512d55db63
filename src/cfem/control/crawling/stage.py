"""The `gait:` part of `cfem control`: a gait is found on the learned model, and finite elements walk it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cfem.constraint.contact import ContactPoint
from cfem.constraint.effector import PointEffector
from cfem.control.crawling.course import Course, account_of, headline, judged, known
from cfem.control.crawling.crawler import Crawler, Walk, crawler_of
from cfem.control.crawling.own_weight import own_weight
from cfem.control.crawling.spec import CrawlingSpec, GaitSpec
from cfem.control.holding.body import box_body
from cfem.control.open_loop.summary import summarise
from cfem.control.search.optimality import Verdict
from cfem.control.task.prepared import robot_and_models
from cfem.control.task.same_rows import demand_same_rows
from cfem.core.artefact.judgement import KEY, poor
from cfem.core.errors import InputError
from cfem.dataset.writer import write_records
from cfem.equilibrium.contact.points import PlacedRobot
from cfem.equilibrium.quasi_static import CONVERGED
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.plant.fem_plant import pushed
from cfem.predict.contact.leg import LearnedLeg, held_by
from cfem.robot.checks.plausible import gravity_doubts
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.mesh.placement import motion_of

Place = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class GaitSetting:
    """Setting of a gait run: one leg, its model and that model's name, the places of the legs, and the crawler with
    learned legs and with legs of finite elements."""

    robot: Robot
    name: str
    model: Any
    places: Sequence[Place]
    on: Course
    learned: Crawler
    fe: Crawler


def setting_of(spec: CrawlingSpec, base: Path, mesh: Path, models: Mapping[str, Path]) -> GaitSetting:
    """Setting of a spec; base: its folder; mesh and models: artefacts."""
    scene_and_mesh, gait = load_scene_and_mesh(base / spec.scene, mesh), spec.gait
    robot, predictors, _ = robot_and_models(spec, base, scene_and_mesh, models)
    demand_same_rows(robot, predictors, models)
    name, model = next(iter(predictors.items()))
    places, names = (
        [motion_of(robot_spec.rotate, robot_spec.translate) for robot_spec in spec.robots],
        [robot_spec.name for robot_spec in spec.robots],
    )
    loads, weights = own_weight(gait, robot, places)
    feet = [_with_feet(robot, load) for load in loads]
    rest = np.array([contact.rest for contact in feet[0].contacts])
    standing = [PlacedRobot(Problem(leg), *place) for leg, place in zip(feet, places, strict=True)]
    held = held_by(model, models[name])
    learning = [
        LearnedLeg(held, robot.unilateral, rest, *place, load) for place, load in zip(places, loads, strict=True)
    ]
    learned, fe = (crawler_of(gait, legs, names, weights) for legs in (learning, standing))
    course = Course(gait, [leg in gait.mirrored for leg in names], robot.rows.n_a)
    return GaitSetting(robot, name, model, places, course, learned, fe)


def crawl(folder: Path, spec: CrawlingSpec, base: Path, mesh: Path, models: Mapping[str, Path]) -> dict[str, Any]:
    """Writes trajectories.parquet, a row a command, and states.npz; returns the results."""
    setting, gait = setting_of(spec, base, mesh, models), spec.gait
    course, learned, fe, robot = setting.on, setting.learned, setting.fe, setting.robot
    best = course.best(learned)
    planned = course.plan(learned, best)
    walks = {
        "planned": planned, "half_steps": course.in_half_steps(learned, planned), "fe": course.repeat(fe, planned)
    }  # fmt: skip
    far = {key: course.distance(walk) for key, walk in walks.items()}
    sweep = [course.at_friction(friction, best, learned, fe) for friction in gait.frictions]
    alone = [course.at_friction(friction, best, learned) for friction in gait.planned_frictions]
    rows = _records(setting.name, planned, walks["fe"], spec.reached, setting.model)
    outside = sum(not row["inside"] for row in rows)
    ratio = max((leg.ratio for touch in planned.touches for leg in touch.solved[:-1]), default=0.0)
    _write(folder / "trajectories.parquet", rows, robot, [robot_spec.name for robot_spec in spec.robots], fe.centre)
    np.savez_compressed(folder / "states.npz", **_pictures(fe, walks["fe"], setting.places, robot, gait))
    account = account_of(walks["fe"])
    return {
        KEY: [
            *judged(far, course.unit, ratio),
            *map(poor, gravity_doubts([] if gait.gravity is None else [gait.gravity], "gait.gravity")),
        ],
        "headline": headline(far, course.unit, sweep, walks, account, gait.ground.friction, outside, alone),
        "gait": {key: getattr(best, key).tolist() for key in ("mean", "amplitude", "phase")},
        "per_cycle": {key: known(walk.per_cycle(gait.steps, course.direction)) for key, walk in walks.items()},
        "distance": {key: known(walk.travelled(course.direction)) for key, walk in walks.items()},
        "frictions": sweep,
        "planned_frictions": alone,
        "contact": account,
        "trajectories": {"gait": summarise(rows, robot.length)},
        "plant": spec.plant,
        "discretisation": None,
        "length": robot.length,
        "fe_cost": None,
        "nodes": len(robot.X),
    }


def _with_feet(robot: Robot, load: np.ndarray) -> Robot:
    """The robot with contact points for effectors, but for the last where it is its centre of mass, which carries the
    load (3,) N. InputError where one is no point of the body."""
    n = len(robot.effectors) - (len(load) > 0)
    if not n or not all(isinstance(effector, PointEffector) for effector in robot.effectors[:n]):
        what = "a leg touches the ground by effectors, and one of them is no point of its body"
        raise InputError(what, where="scene", do="leave out effectors that turn or lie outside")
    contacts, watched = (
        tuple(ContactPoint(effector.attachment) for effector in robot.effectors[:n]),
        robot.rows.effectors,
    )
    rows = replace(robot.rows, effectors=watched[3 * n :], contacts=watched[: 3 * n])
    heavy = pushed(robot, np.concatenate([np.zeros(3 * n), load])) if load.any() else robot
    return replace(heavy, effectors=robot.effectors[n:], contacts=contacts, rows=rows)


def _records(name: str, planned: Walk, fe: Walk, reached: float, model: Any) -> list[dict]:
    """Rows of the table, one a command, as open-loop control has them: the goal is where the plan sees the base."""
    rows, nan = [], float("nan")
    for index, u in enumerate(planned.commands):
        carried_out = index < len(fe.commands)
        goal, x = planned.base[index + 1], fe.base[index + 1] if carried_out else np.full(3, nan)
        error = float(np.linalg.norm(x - goal))
        states = [model.at_displacement(leg.delta_a) for leg in planned.touches[index].solved[:-1]]
        rows.append(
            {
                "trajectory": "gait",
                "controller": name,
                "goal_index": index,
                "goal": goal,
                "x_e": x,
                "error": error,
                "error_to_fe_based": nan,
                "delta_a": u,
                "lambda_a": np.concatenate([leg.lambda_a for leg in planned.touches[index].solved[:-1]]),
                "predicted_e": goal - planned.base[0],
                "predicted_distance": 0.0,
                "verdict": Verdict.REACHED.value,
                "reachable": True,
                "reached": error < reached,
                "inside": all(model.inside(state) for state in states),
                "distance_to_data": max(model.distance(state) for state in states),
                "status": planned.status,
                "plant_status": CONVERGED if carried_out else fe.status,
                "iterations": planned.touches[index].iterations,
                "queries": planned.touches[index].iterations,
                "softened": False,
                "kkt": planned.touches[index].check.largest,
                "seconds": planned.seconds[index],
                "step_us": 1e6 * planned.seconds[index],
            }
        )
    return rows


def _write(path: Path, rows: list[dict], robot: Robot, names: Sequence[str], centre: np.ndarray) -> None:
    displacements, forces = zip(*robot.actuator_units, strict=True)
    legs = len(names)
    units = dict.fromkeys(("error", "goal", "x_e", "predicted_e"), "mm") | {"step_us": "us", "seconds": "s"}
    units |= {"delta_a": displacements * legs, "lambda_a": forces * legs}
    rows_of = [f"base.{axis}" for axis in "xyz"] + [f"{leg}.{name}" for leg in names for name in robot.rows.actuators]
    meta = {"rows": rows_of, "rest_e": centre.tolist(), "length": robot.length, "units": units}
    write_records(path, rows, meta)


def _pictures(fe: Crawler, walk: Walk, places: Sequence[Place], robot: Robot, gait: GaitSpec) -> dict[str, np.ndarray]:
    """Shapes of legs and base over the ground, as open-loop control keeps them; base and ground are the last nodes."""
    mesh, surface = robot.body.mesh, np.unique(robot.facets)
    box, facets = box_body(gait.base.centre, gait.base.half_size).facets(robot.facets.shape[1])
    local = np.searchsorted(surface, robot.facets)
    legs = len(places)
    all_facets = [local + i * len(surface) for i in range(legs)] + [facets + legs * len(surface)]

    def seen(solved: Sequence[Any], index: int) -> np.ndarray:
        bodies = [
            (leg.state.x if leg else mesh.X)[surface] @ turn.T + shift
            for leg, (turn, shift) in zip(solved, places, strict=True)
        ]
        points = np.concatenate([*bodies, box])
        return walk.base[index] + (points - fe.centre) @ walk.turns[index].T

    x = np.array([seen(touch.solved[:-1], i + 1) for i, touch in enumerate(walk.touches)], np.float32)
    shown = {"X": seen([None] * legs, 0), "facets": np.concatenate(all_facets), "object_points": np.array(len(box))}
    return shown | {"gait/index": np.arange(len(x)), "gait/x": x}
