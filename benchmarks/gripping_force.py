"""Force of a finger on what it touches, by learned models against finite elements that touch at nodes.

python benchmarks/gripping_force.py blocked [--pressures KPA ...] [--table MM] [--figure FILE]
python benchmarks/gripping_force.py pull-out [--pressures KPA ...] [--friction MU] [--figure FILE]

`blocked`: the tip of the PneuNet presses a table below it, without friction, at pressures. Needs
`cfem run pipelines/pneunet` and `cfem run pipelines/pneunet/train-blocked.yaml`.

`pull-out`: a ball between three fingers of `three-chamber-gripper`, at 120 degrees about its axis, is pulled out of
them. The fingers close on it up to a pressure, their valves are shut, and the ball goes: the largest force on the way,
of all three, and at how many stops of the way the model has no state. One finger is solved; the others do the same.
Needs
`cfem run pipelines/three-chamber-gripper/train-free.yaml`.

    FE        of finite elements that touch at every node of the surface, on the mesh of the samples
    stop      of the model that was trained with what stops the tip as a second actuator
    contact   of the model of the free robot, in contact at every node

with the errors of the models, and the error that the latter estimates (`ContactState.error`; above 0.035 it says that
it is not to be trusted)."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import root_scalar

from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.obstacle import Obstacle, Plane, Sphere
from cfem.contact.prescribed_motion import Translation
from cfem.core.errors import NumericalError
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.system.robot import Robot
from cfem.plant.touch_plant import TouchPlant
from cfem.predict.contact.model import ContactModel
from cfem.predict.contact.surface.kept_patches import node_model_of
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.load import load_model
from cfem.predict.protocol import Predictor
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh, made_from

ROOT = Path(__file__).parents[1]
STEPS = 15  # of the volume, from which a search for a pressure begins
PULLS = 40  # of the way of what is pulled out

Answers = Callable[[float], np.ndarray]  # at a volume mm^3: pressure kPa, force N, and more
Course = Callable[[float], np.ndarray]  # at a share of the way of the object: pressure kPa, force N, and more


def robot_and_model(name: str, trained: str) -> tuple[Robot, SurfaceModel, float]:
    """FE robot of a pipeline, its model in contact at every node, and its largest volume mm^3."""
    scene_path, mesh_path = ROOT / "pipelines" / name / "scene.yaml", ROOT / "data" / name / "mesh"
    folder = ROOT / "models" / name / trained
    scene, mesh = load_scene_and_mesh(scene_path, mesh_path)
    robot = build_robot(scene, mesh)
    touched = node_model_of(load_model(folder), folder, robot, made_from(scene_path, mesh_path) | {"loads": {}})
    return robot, touched, scene.actuators[0].reach[1]


def by_finite_elements(
    robot: Robot, obstacle: Obstacle, axis: int, mu: float, way: np.ndarray
) -> tuple[Answers, Course]:
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    points = at_nodes(robot.X, robot.body.mesh.facets, surface)
    skinned = SkinnedRobot(robot, surface.nodes, surface.triangles, points, itself=False)
    plant = TouchPlant(skinned, {"object": obstacle}, mu=mu, courses={"object": Translation(obstacle, way)})

    def now() -> np.ndarray:
        return np.array([1e3 * plant.met.solved[0].lambda_a[0], plant.met.forces.sum(axis=0)[axis]])

    def answers(volume: float) -> np.ndarray:
        status = plant.step(np.array([volume])).status
        assert status == "converged", status
        return now()

    def course(share: float) -> np.ndarray:
        plant.pass_to(share)
        return now()

    return answers, course


def by_contact(
    touched: SurfaceModel, obstacle: Obstacle, axis: int, mu: float, way: np.ndarray
) -> tuple[Answers, Course]:
    model = ContactModel(touched, {"object": obstacle}, mu=mu, courses={"object": Translation(obstacle, way)})

    def now() -> np.ndarray:
        state = model.before
        return np.array([1e3 * state.lambda_a[0][0], state.forces.sum(axis=0)[axis], state.error])

    def answers(volume: float) -> np.ndarray:
        model.settle(np.array([volume]))
        return now()

    def course(share: float) -> np.ndarray:
        try:
            model.pass_to(share)
        except NumericalError:  # it lets the object go
            return np.full(3, np.nan)
        return now()

    return answers, course


def by_stop(model: Predictor, way: float) -> Answers:
    def answers(volume: float) -> np.ndarray:
        state = model.at_displacement([volume, way])
        return np.array([1e3 * state.lambda_a[0], state.lambda_a[1], model.inside(state)])

    return answers


def at_pressures(answers: Answers, pressures: Sequence[float], largest: float) -> np.ndarray:
    """Answers (k, ...) at pressures kPa, NaN where the pressure takes more than the largest volume mm^3."""
    volumes = np.linspace(0.0, largest, STEPS)[1:]
    known = np.array([answers(volume) for volume in volumes])
    rows = []
    for pressure in pressures:
        beyond = np.flatnonzero(known[:, 0] >= pressure)
        if not len(beyond):
            rows.append(np.full(known.shape[1], np.nan))
            continue
        start, step = volumes[beyond[0]], volumes[0] / 4
        found = root_scalar(
            lambda volume, wanted=pressure: answers(volume)[0] - wanted, x0=start, x1=start - step, xtol=1e-4 * largest
        )
        rows.append(answers(found.root))
    return np.array(rows)


def pulled_out(grasp: Callable[[], tuple[Answers, Course]], pressures: Sequence[float], largest: float) -> np.ndarray:
    """Answers (pressures, PULLS + 1, ...) on the way out of a grasp that closes at each of the pressures kPa."""
    answers, _ = grasp()
    volumes = np.linspace(0.0, largest, STEPS)
    closing = np.array([answers(volume)[0] for volume in volumes[1:]])
    rows = []
    for volume in PchipInterpolator([0.0, *closing], volumes)(pressures):
        answers, course = grasp()
        rows.append([answers(volume), *(course(share) for share in np.linspace(0.0, 1.0, PULLS + 1)[1:])])
    return np.array(rows)


def draw(file: Path, x: np.ndarray, words: tuple[str, str], curves: dict[str, np.ndarray]) -> None:
    """Curves over x, finite elements first; words: of the axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    for (name, forces), style in zip(curves.items(), ("k-", "C3x--", "C0o"), strict=False):
        axes.plot(x, forces, style, label=name)
    axes.set(xlabel=words[0], ylabel=words[1], xlim=(0, None))
    axes.legend()
    figure.savefig(file, dpi=120)


def blocked(given: argparse.Namespace) -> None:
    robot, touched, largest = robot_and_model("pneunet", "spectral")
    table, still = Plane(t=np.array([0.0, 0.0, -given.table])), np.zeros((1, 3))
    exact, contact, stop = (
        at_pressures(answers, given.pressures, largest)
        for answers in (
            by_finite_elements(robot, table, 2, 0.0, still)[0],
            by_contact(touched, table, 2, 0.0, still)[0],
            by_stop(load_model(ROOT / "models" / "pneunet" / "blocked"), -given.table),
        )
    )
    print("| pressure (kPa) | FE (N) | stop (N) | off (%) | contact (N) | off (%) | its estimate |")
    print("|---|---|---|---|---|---|---|")
    for pressure, fe, by_two, free in zip(given.pressures, exact, stop, contact, strict=True):
        off = [100 * (each[1] / fe[1] - 1) for each in (by_two, free)]
        outside = "" if by_two[2] else " OUTSIDE"
        print(
            f"| {pressure:g} | {fe[1]:.4f} | {by_two[1]:.4f}{outside} | {off[0]:.2g} | {free[1]:.4f} | {off[1]:.2g} | "
            f"{free[2]:.2f} |"
        )
    if given.figure:
        curves = {"finite elements, at nodes": exact, "contact of the free model": contact, "model with a stop": stop}
        words = "pressure (kPa)", "force on the table (N)"
        draw(given.figure, given.pressures, words, {name: values[:, 1] for name, values in curves.items()})


def pull_out(given: argparse.Namespace) -> None:
    robot, touched, largest = robot_and_model("three-chamber-gripper", "free")
    ball = Sphere(given.radius, t=np.array([given.place, 0.0, -given.radius - given.gap]))
    way = np.array([[0.0, 0.0, 0.0], [given.way, 0.0, 0.0]])
    exact, contact = (
        pulled_out(grasp, given.pressures, largest)
        for grasp in (
            lambda: by_finite_elements(robot, ball, 0, given.friction, way),
            lambda: by_contact(touched, ball, 0, given.friction, way),
        )
    )
    shares = np.linspace(0.0, 1.0, PULLS + 1) * given.way
    print("| pressure (kPa) | FE (N) | after (mm) | contact (N) | after (mm) | off (%) | its estimate | no state |")
    print("|---|---|---|---|---|---|---|---|")
    for pressure, fe, free in zip(given.pressures, exact, contact, strict=True):
        ends = [int(np.nanargmax(each[:, 1])) for each in (fe, free)]
        forces = [3 * float(each[end, 1]) for each, end in zip((fe, free), ends, strict=True)]
        print(
            f"| {pressure:g} | {forces[0]:.4f} | {shares[ends[0]]:.2f} | {forces[1]:.4f} | {shares[ends[1]]:.2f} | "
            f"{100 * (forces[1] / forces[0] - 1):.2g} | {np.nanmax(free[:, 2]):.2f} | "
            f"{np.isnan(free[:, 1]).sum()} of {len(free)} |"
        )
    if given.figure:
        curves = {"finite elements, at nodes": exact[-1], "contact of the free model": contact[-1]}
        words = "way of the ball (mm)", f"force on it at {given.pressures[-1]:g} kPa (N)"
        draw(given.figure, shares, words, {name: 3 * values[:, 1] for name, values in curves.items()})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    cases = parser.add_subparsers(required=True)
    pneunet, gripper = cases.add_parser("blocked"), cases.add_parser("pull-out")
    pneunet.add_argument("--pressures", type=float, nargs="+", default=[5.0, 10.0, 20.0, 30.0, 40.0])
    pneunet.add_argument("--table", type=float, default=1.0, help="mm below the edge of the free end")
    gripper.add_argument("--pressures", type=float, nargs="+", default=[10.0, 20.0, 30.0])
    gripper.add_argument("--friction", type=float, default=0.5)
    gripper.add_argument("--radius", type=float, default=10.0, help="mm of the ball")
    gripper.add_argument("--place", type=float, default=38.0, help="mm of its middle along the fingers")
    gripper.add_argument("--gap", type=float, default=0.5, help="mm between the ball and the fingers at rest")
    gripper.add_argument("--way", type=float, default=6.0, help="mm that it is pulled")
    for case, run in ((pneunet, blocked), (gripper, pull_out)):
        case.add_argument("--figure", type=Path)
        case.set_defaults(run=run)
    given = parser.parse_args()
    given.run(given)


if __name__ == "__main__":
    main()
