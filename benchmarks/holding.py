"""Objects that fingers hold by every node of their surface, by the model of the free finger and by finite elements.

python benchmarks/holding.py carry [--objects block cylinder bracket]
python benchmarks/holding.py moment [--moments NMM ...] [--preload MM] [--model FOLDER]
python benchmarks/holding.py steps

`carry`: `pipelines/soft-finger/control-carry.yaml` with three objects of 30 g, which three fingers lift off a table,
carry aside, put down and let go. The errors are those of finite elements at the goals in the air and on the table.

`moment`: a cube of 29 mm and 50 g between two fingers that face each other. A moment about the line between them turns
it, in finite elements and in the learned model; so does its weight where it is taken over.

`steps`: the learned fingers close on the block on its table in steps of several lengths, which follow friction in one
part or as `cfem.contact.law.sliding` has it. Errors are distances of the block from where it is by the shortest steps
with one part.

All need `cfem run pipelines/soft-finger`."""

import argparse
import time
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from scipy.spatial.transform import Rotation

import cfem
from cfem.contact.law.sliding import PARTS, slid_on_object
from cfem.contact.obstacle import Box
from cfem.control.holding.assembly import LONGEST
from cfem.control.holding.body import body_of
from cfem.control.holding.spec import HoldingSpec
from cfem.core.spec import load_spec
from cfem.equilibrium.contact import posed
from cfem.equilibrium.contact.grasp import FreeObject
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surface_robot import PlacedSurface
from cfem.plant.grip_plant import GripPlant
from cfem.plant.grip_walk import CLOSING
from cfem.predict.contact.surface.kept_patches import fe_points, node_model_of
from cfem.predict.contact.surface_finger import SurfaceFinger
from cfem.predict.load import load_model
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh, made_from
from cfem.robot.mesh.placement import motion_of

ROOT = Path(__file__).parents[1]
FINGER = ROOT / "pipelines" / "soft-finger"
AXIS = np.array([0.0, 35.0, 0.0])  # mm, a point of the line about which three fingers stand around a cylinder
FORCE = "force: {mN: [0, 0, -300]}, law: coulomb, friction: 0.8, margin: 1.5, table: true"
ROUND = Rotation.from_rotvec([0.0, 0.0, 2 * np.pi / 3]).as_matrix()
POINTS = np.array([[0, 0, 1.8], [0.15, 0.1, 2], [0.3, 0.2, 2], [0.3, 0.2, 1.6], [0.3, 0.2, 1], [0.3, 0.2, 0]])


def around() -> str:
    """Three fingers at 120 degrees around the line."""
    shifts = {"right": (120, AXIS - ROUND @ AXIS), "left": (-120, AXIS - ROUND.T @ AXIS)}
    turned = [
        f"{{name: {name}, rotate: {{axis: [0, 0, 1], angle: {angle} deg}}, translate: {{mm: {t.round(9).tolist()}}}}}"
        for name, (angle, t) in shifts.items()
    ]
    return f"robots=[{{name: below}}, {', '.join(turned)}]"


def goals(centre: tuple[float, float, float]) -> str:
    points = (np.array(centre) + POINTS).tolist()
    rotation = [[0, 0, 0]] * len(points)
    return (
        f"trajectories={{pick-and-place: {{kind: goals, points: {{mm: {points}}}, rotation: {{deg: {rotation}}}, "
        "let_go: true}}"
    )


CLOSED = np.array([2.2, 2.2, 1.15, 1.15, 1.15, 1.15])  # mm of the cables, by which the block keeps its place
BRACKET = (5.556, 30.972, -95.0)  # mm: its lower side is 0.5 mm from the finger below
OBJECTS = {
    "block": [],
    "cylinder": [
        f"object={{centre: {{mm: [0, 35, -95]}}, radius: 14.5 mm, half_length: 15 mm, {FORCE}}}",
        around(),
    ],
    "bracket": [
        f"object={{centre: {{mm: {list(BRACKET)}}}, file: bracket.stl, balanced: true, {FORCE}}}",
        "robots=[{name: below}, "
        "{name: right, rotate: {axis: [0, 0, 1], angle: 180 deg}, translate: {mm: [30, 70, 0]}}, "
        "{name: left, rotate: {axis: [0, 0, 1], angle: 180 deg}, translate: {mm: [-30, 55.5, 0]}}]",
        goals(BRACKET),
    ],
}


def carry(given: argparse.Namespace) -> None:
    print("| object | in the air: mm, degrees | on the table: mm, degrees | margin planned, found | CPU time (s) |")
    print("|---|---|---|---|---|")
    for name in given.objects:
        out, begin = ROOT / "data" / "soft-finger" / f"carry-{name}", time.process_time()
        summary = cfem.run_stage("control", FINGER / "control-carry.yaml", overrides=OBJECTS[name], out=out)["results"]
        rows = pq.read_table(out / "trajectories.parquet").to_pylist()
        errors = np.array([[row["error"], row["rotation_error"]] for row in rows])
        air, table = errors[:-1].max(axis=0), errors[-1]
        account = summary["object"]
        print(
            f"| {name} | {air[0]:.4f}, {air[1]:.3f} | {table[0]:.4f}, {table[1]:.3f} | "
            f"{account['margin_planned']:.2f}, {account['margin']:.2f} | {time.process_time() - begin:.0f} |",
            flush=True,
        )


def moment(given: argparse.Namespace) -> None:
    scene_path, mesh_path = FINGER / "scene.yaml", ROOT / "data" / "soft-finger" / "mesh"
    folder = given.model
    robot, model = build_robot(*load_scene_and_mesh(scene_path, mesh_path)), load_model(folder)
    touched = node_model_of(model, folder, robot, made_from(scene_path, mesh_path) | {"loads": {}})
    half, centre = np.full(3, 14.5), np.array([0.0, 35.0, -100.0])
    turn = np.diag([-1.0, -1.0, 1.0])
    places = [(np.eye(3), np.zeros(3)), (turn, centre - turn @ centre)]
    skin, of_fe = model.skin, fe_points(touched, robot)
    fe = [
        PlacedSurface.at_rest(SkinnedRobot(robot, skin.nodes, skin.triangles, of_fe, R, t, itself=False))
        for R, t in places
    ]
    turned = []
    for fingers in (fe, [SurfaceFinger(touched, R, t) for R, t in places]):
        load = np.array([0.0, 0.0, -0.05 * 9.81, 0.0, 0.0, 0.0])
        held, grasp = FreeObject(Box(half, t=centre), centre, load), np.full(4, given.preload)
        longest = np.tile(LONGEST * np.abs(robot.reach).max(axis=1), 2)
        plant = GripPlant(fingers, np.array([0, 2, 4]), held, "coulomb", 0.8, centre[None], grasp, longest=longest)
        answers = []
        for wanted in (0.0, *given.moments):
            load[4] = wanted
            status = plant.grasp() if not answers else plant.take(1.0)
            assert status == "converged", status
            state = plant.last.around
            answers.append([*state.x, *np.degrees(Rotation.from_matrix(state.R).as_rotvec()), plant.forces()[0][1]])
        turned.append(np.array(answers))
    print("| moment (N mm) | turned by it, FE (degrees) | model | off (%) | place off (mm) | pinch, FE (N) | model |")
    print("|---|---|---|---|---|---|---|")
    exact, learned = turned
    for i, wanted in enumerate((0.0, *given.moments)):
        by = [answers[i, 4] - answers[0, 4] for answers in turned]
        turns = f"{by[0]:.4f} | {by[1]:.4f} | {100 * (by[1] / by[0] - 1):.2g}" if i else "| | "
        place = np.linalg.norm(exact[i, :3] - learned[i, :3])
        print(f"| {wanted:g} | {turns} | {place:.4f} | {abs(exact[i, 6]):.4f} | {abs(learned[i, 6]):.4f} |")


def steps(given: argparse.Namespace) -> None:
    scene_path, mesh_path = FINGER / "scene.yaml", ROOT / "data" / "soft-finger" / "mesh"
    folder, spec = ROOT / "models" / "soft-finger" / "spectral", load_spec(FINGER / "control-carry.yaml", HoldingSpec)
    robot, model = build_robot(*load_scene_and_mesh(scene_path, mesh_path)), load_model(folder)
    touched = node_model_of(model, folder, robot, made_from(scene_path, mesh_path) | {"loads": {}})
    body, force = body_of(spec.object, FINGER), np.asarray(spec.object.force, float)
    held = FreeObject(body.shape, body.centre, np.concatenate([force, np.zeros(3)]))
    fingers = [SurfaceFinger(touched, *motion_of(item.rotate, item.translate)) for item in spec.robots]
    at, table, friction = body.centre[None], body.table(force), spec.object.friction

    def closed(longest: float, parts: int) -> tuple[np.ndarray, str]:
        """Motion (3,) mm of the block in steps of that share of a longest one, and their cost."""
        posed.slid_on_object = partial(slid_on_object, parts=parts)
        step = longest / CLOSING * np.tile(LONGEST * np.abs(robot.reach).max(axis=1), len(fingers))
        ends = robot.rows.n_a * np.arange(len(fingers) + 1)
        plant = GripPlant(fingers, ends, held, "coulomb", friction, at, CLOSED, table=table, longest=step)
        begin = time.process_time()
        assert plant.grasp() == "converged"
        return plant.last.around.x, f"{plant.steps}, {plant.iterations} | {time.process_time() - begin:.1f}"

    exact = closed(1 / 256, 1)[0]
    print("| longest step, of that in the air | parts | error (mm) | steps, rounds | CPU time (s) |")
    print("|---|---|---|---|---|")
    for longest in (1, 1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 64):
        for parts in (1, PARTS):
            place, cost = closed(longest, parts)
            print(f"| {longest:g} | {parts} | {np.linalg.norm(place - exact):.4f} | {cost} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    cases = parser.add_subparsers(required=True)
    carried, turning = cases.add_parser("carry"), cases.add_parser("moment")
    carried.add_argument("--objects", nargs="+", choices=OBJECTS, default=list(OBJECTS))
    carried.set_defaults(run=carry)
    turning.add_argument("--moments", type=float, nargs="+", default=[0.5, 1.0, 2.0])
    turning.add_argument("--preload", type=float, default=2.0, help="mm of each cable")
    turning.add_argument("--model", type=Path, default=ROOT / "models" / "soft-finger" / "spectral")
    turning.set_defaults(run=moment)
    cases.add_parser("steps").set_defaults(run=steps)
    given = parser.parse_args()
    given.run(given)


if __name__ == "__main__":
    main()
