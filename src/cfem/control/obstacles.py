"""From what `control.yaml` says of obstacles to models that plan with contact, and to the FE robot that meets them."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cfem.condensed import Rows
from cfem.contact.obstacle import Obstacle, Plane
from cfem.contact.prescribed_motion import ActuatedRobot, PrescribedMotion
from cfem.control.spec import ControlSpec
from cfem.control.tick import Pilot
from cfem.core.errors import InputError, NumericalError, SpecError
from cfem.core.spec import meaning
from cfem.equilibrium.meet import Skinned
from cfem.equilibrium.robot import Robot
from cfem.plant.touch_plant import TouchPlant
from cfem.predict.contact_model import ContactModel
from cfem.predict.kept_patches import touchable_of
from cfem.predict.meeting import PlacedModel
from cfem.predict.obstacle_spec import RobotObstacle
from cfem.predict.protocol import Predictor
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh, made_from
from cfem.robot.same_robot import demand_robot

STOPS = 21  # places of a way that are looked at
PRESSED = 0.05  # of the force that is wanted: how far off it may be where a goal is reached
INSIDE = 1e-6  # of the length: how far the robot may reach into an obstacle at rest


@dataclass(frozen=True)
class World:
    """What control knows of obstacles. rows: of the models, the robot's and one for each that is pressed or avoided;
    goal (k,): of the latter rows, weights (k,) mm/N or 0, and bounds (k, 2)."""

    rows: Rows
    goal: np.ndarray
    weights: np.ndarray
    bounds: np.ndarray

    def rest(self, rest_e: np.ndarray) -> np.ndarray:
        """(n_e,) -> (n_e + k,)."""
        return np.concatenate([rest_e, np.zeros(len(self.goal))])

    def goals(self, points: np.ndarray) -> np.ndarray:
        """(m, n_e) -> (m, n_e + k)."""
        return np.hstack([points, np.tile(self.goal, (len(points), 1))])

    def pilot(self, pilot: Pilot) -> Pilot:
        """The pilot of the robot alone, with what it is to do with obstacles."""
        n_e = len(pilot.weights)
        bounds = np.vstack([np.tile([-np.inf, np.inf], (n_e, 1)), self.bounds])
        own = np.ones(n_e, dtype=bool) if pilot.places is None else pilot.places
        places = np.concatenate([own, np.zeros(len(self.goal), dtype=bool)])
        weights = np.concatenate([pilot.weights, self.weights])
        return replace(pilot, limits=replace(pilot.limits, delta_e=bounds), weights=weights, places=places)

    def met(self, e: np.ndarray, near: float) -> bool:
        """Whether forces are as wanted or allowed, within PRESSED, and distances within `near` (mm). e: (n_e + k,)."""
        found, forces = e[self.rows.n_e - len(self.goal) :], self.weights > 0
        off = np.abs(found - self.goal)[forces] <= PRESSED * self.goal[forces]
        low, high = self.bounds.T
        return bool(off.all() and (forces | (found >= low - near)).all() and (found <= (1 + PRESSED) * high).all())

    def said(self, spec: ControlSpec, records: Sequence[Mapping]) -> tuple[dict[str, dict], list[str]]:
        """What the plant had of each obstacle in the rows of a table: figures, and lines for people."""
        figures, lines, n_e = {}, [], self.rows.n_e - len(self.goal)
        x = np.array([row["x_e"] for row in records])[:, n_e:]
        for row, name in enumerate(self.rows.effectors[n_e:]):
            name, what = name.rsplit(".", 1)
            least, most = float(np.nanmin(x[:, row])), float(np.nanmax(x[:, row]))
            figures[name] = {"least": least, "largest": most, "unit": "N" if what == "force" else "mm"}
            one = spec.obstacles[name]
            if what == "distance":
                wanted = f"{one.avoid:.3g} mm wanted"
                figures[name]["wanted"] = one.avoid
                lines.append(f"{name}: the robot came within {least:.3g} mm, {wanted}")
                continue
            missed = np.abs(x[:, row] - one.press) if one.press else np.zeros(0)
            text = f"{name}: pressed with {least:.4g} to {most:.4g} N"
            if len(missed):
                figures[name] |= {"wanted": one.press, "error_mean": missed.mean(), "error_max": missed.max()}
                met = int((missed <= PRESSED * one.press).sum())
                text += f" where {one.press:.3g} N are wanted: held at {met} of {len(missed)} goals"
                text += f" (error mean {missed.mean():.2g} N, max {missed.max():.2g} N)"
            lines.append(text + (f"; at most {one.largest_force:.3g} N allowed" if one.largest_force else ""))
        return figures, lines


def with_obstacles(
    spec: ControlSpec, base: Path, robot: Robot, predictors: Mapping[str, Predictor], models: Mapping[str, Path]
) -> tuple[World, dict[str, ContactModel], TouchPlant]:
    """InputError where a model has no skin or its form does not fit, SpecError where the robot starts inside
    something."""
    met = {name: one for name, one in spec.obstacles.items() if one.kind == "robot" and one.avoid is None}
    itself = tuple(name for name, one in spec.obstacles.items() if one.kind == "itself")
    courses = {name: one.course(base) for name, one in spec.obstacles.items() if name not in {*met, *itself}}
    obstacles = {name: one.at(0.0) for name, one in courses.items()}
    moving = {name: one for name, one in courses.items() if one.way(0.0, 1.0) > 0}
    pressed = tuple(name for name, one in spec.obstacles.items() if one.pressed)
    avoided = {name: obstacles[name] for name, one in spec.obstacles.items() if one.avoid is not None}
    solid = {name: one for name, one in obstacles.items() if name not in avoided}
    found, plant, friction = {}, None, spec.contact.friction
    bends = {name: one.course(base) for name, one in met.items()}
    at_first = obstacles | {name: course.at(0.0) for name, course in bends.items()}
    for name, model in predictors.items():  # before finite elements take a while
        with naming(models[name]):
            demand_outside(robot, model.skin.nodes, at_first)
            demand_way(robot, model.skin.nodes, moving)
    others = {name: other_robot(spec, one, base, name, bends[name]) for name, one in met.items()}
    learned = {name: (placed, course) for name, (placed, _, course) in others.items()}
    made_of = made_from(base / spec.scene, base / spec.mesh) | {"loads": meaning(spec.loads)}
    for name, model in predictors.items():
        skin = model.skin
        with naming(models[name]):
            touchable = touchable_of(model, models[name], robot, made_of, *spec.contact.cut)
            known = {"courses": moving, "others": learned, "itself": itself, "unilateral": robot.unilateral}
            one = ContactModel(touchable, solid, pressed, avoided, friction, **known)
        demand_apart(one)
        found[name] = one
        if plant is None:
            own = Skinned(robot, skin.nodes, skin.triangles, touchable.patches)
            in_fe = {name: (skinned, course) for name, (_, skinned, course) in others.items()}
            plant = TouchPlant(own, obstacles, pressed, tuple(avoided), friction, moving, in_fe, itself)
    first = next(iter(found.values()))
    mine = [spec.obstacles[name] for name in pressed]
    far = [spec.obstacles[name] for name in avoided]
    goal = np.array([one.press or 0.0 for one in mine] + [0.0 for _ in far])
    weights = np.array([0.0 if one.press is None else 1 / first.stiffness for one in mine] + [0.0 for _ in far])
    top = [np.inf if one.largest_force is None else one.largest_force for one in mine]
    bounds = np.array([[-np.inf, one] for one in top] + [[one.avoid, np.inf] for one in far]).reshape(-1, 2)
    return World(first.rows, goal, weights, bounds), found, plant


@contextmanager
def naming(model: Path) -> Iterator[None]:
    """An InputError that says not where it is has this model in its place."""
    try:
        yield
    except InputError as error:
        raise InputError(error.what, where=error.where or str(model), do=error.do) from None


def other_robot(
    spec: ControlSpec, one: RobotObstacle, base: Path, name: str, course: ActuatedRobot
) -> tuple[PlacedModel, Skinned, ActuatedRobot]:
    """Learned and by finite elements, and the course of its actuators. InputError where its model is not of its
    scene."""
    own = base / (one.scene or spec.scene)
    scene, mesh = load_scene_and_mesh(own, None if one.scene else base / spec.mesh)
    model = course.model
    do = f"name its scene in obstacles.{name}.scene"
    demand_robot(scene, model.meta.get("robot"), base / one.model, do)
    robot, skin = build_robot(scene, mesh), model.skin
    made_of = made_from(own, own.parent / scene.out if one.scene else base / spec.mesh) | {"loads": {}}
    with naming(base / one.model):
        touchable = touchable_of(model, base / one.model, robot, made_of, *spec.contact.cut)
    place = course.R, course.t, False
    return (
        PlacedModel(touchable, *place, robot.unilateral),
        Skinned(robot, skin.nodes, skin.triangles, touchable.patches, *place),
        course,
    )


def demand_apart(model: ContactModel) -> None:
    """SpecError where robots overlap at rest, InputError where there is no contact state."""
    if not model.others and not model.itself:
        return
    try:
        model.standing(0.0).touched(np.zeros(model.touchable.model.rows.n_a))
    except InputError as error:
        raise SpecError(error.what, where="obstacles", do=error.do) from None
    except NumericalError as error:
        raise SpecError(str(error), where="obstacles", do="move them apart at the first goal") from None


def demand_outside(robot: Robot, nodes: np.ndarray, obstacles: Mapping[str, Obstacle]) -> None:
    """SpecError where the robot at rest reaches into an obstacle."""
    surface = robot.X[nodes]
    for name, one in obstacles.items():
        distance = one.distance(surface)
        worst = int(distance.argmin())
        if distance[worst] < -INSIDE * robot.length:
            place = ", ".join(f"{x:.3g}" for x in surface[worst])
            raise SpecError(
                f"the robot starts {-distance[worst]:.3g} mm inside it, at ({place}) mm",
                where=f"obstacles.{name}",
                do="turn its normal out of it, or move it"
                if isinstance(one, Plane)
                else "move it away at the first goal",
            )


def demand_way(robot: Robot, nodes: np.ndarray, courses: Mapping[str, PrescribedMotion]) -> None:
    """SpecError where an obstacle comes to where the robot is held, which cannot give way."""
    held = robot.X[nodes[np.isin(nodes, robot.fixed)]]
    for name, one in courses.items():
        for share in np.linspace(0.0, 1.0, STOPS):
            deep = -one.at(share).distance(held).min(initial=np.inf)
            if deep > INSIDE * robot.length:
                raise SpecError(
                    f"its way leads {deep:.3g} mm into where the robot is held, {100 * share:.0f} % through the goals",
                    where=f"obstacles.{name}",
                    do="end it before",
                )
