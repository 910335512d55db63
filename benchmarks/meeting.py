"""Soft robots that touch each other, and one that touches itself, against finite elements whose surfaces do the same: a
table of docs/soft-contact.md.

python benchmarks/meeting.py bars    two bars that bend towards each other
python benchmarks/meeting.py bars --mu 0.3    with friction
python benchmarks/meeting.py push    one bends up below the other, whose cable goes slack
python benchmarks/meeting.py fork    one body: two bars on a common root
python benchmarks/meeting.py pincer    two prongs, at every node and by patches, against another code: walls that push
                                       each other by a pressure (`cfem.mechanics.self_contact`)

Each makes its own samples, in a folder that it deletes: one to three minutes on one core."""

import argparse
import shutil
import tempfile
import time
from pathlib import Path

import meshio
import numpy as np
import yaml

import cfem
from cfem.equilibrium.contact.patch_compliance import patch_response
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene as MeetingInFe
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.scene import ContactScene
from cfem.predict.contact.surface.kept_patches import fe_points, node_model_of, patched_model_of
from cfem.predict.contact.surface.patched_model import PatchedModel, patches_of
from cfem.predict.load import load_model
from cfem.predict.series.few_states import patch_states
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.self_contact import SelfContactSpec

PIPELINES = Path(__file__).parents[1] / "pipelines"
OVER = np.array([0.0, 0.0, 16.0])  # mm: of the other bar
PATCHES = 6.0  # mm


def run(specs: Path) -> None:
    for stage, name in (("mesh", "scene"), ("sample", "sample"), ("train", "train")):
        cfem.run_stage(stage, specs / f"{name}.yaml")


def bar(folder: Path) -> Path:
    specs = shutil.copytree(PIPELINES / "bar", folder / "pipelines" / "bar")
    scene = yaml.safe_load((specs / "scene.yaml").read_text())
    scene["mesh"] = {"size": "5 mm", "element": "hex8"}
    (specs / "scene.yaml").write_text(yaml.safe_dump(scene))
    run(specs)
    return specs


def fork(folder: Path) -> Path:
    """Two bars of 10 x 10 x 60 mm, 6 mm apart, on a root of 10 mm that is held; a cable in each pulls it inwards."""
    specs = folder / "pipelines" / "fork"
    specs.mkdir(parents=True)
    x, y = np.arange(-10.0, 60.1, 5.0), np.arange(-5.0, 5.1, 5.0)
    z = np.array([-5.0, 0.0, 5.0, 8.0, 11.0, 16.0, 21.0])
    grid = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    number, cells = np.arange(grid[..., 0].size).reshape(grid.shape[:3]), []
    for i, j, k in np.ndindex(len(x) - 1, len(y) - 1, len(z) - 1):
        if x[i] < 0 or not 5.0 <= z[k] < 11.0:
            low, high = number[i : i + 2, j : j + 2, k], number[i : i + 2, j : j + 2, k + 1]
            cells.append([*low[[0, 1, 1, 0], [0, 0, 1, 1]], *high[[0, 1, 1, 0], [0, 0, 1, 1]]])
    used, cells = np.unique(cells, return_inverse=True)
    meshio.write(specs / "fork.vtu", meshio.Mesh(grid.reshape(-1, 3)[used], [("hexahedron", cells.reshape(-1, 8))]))
    scene = yaml.safe_load((PIPELINES / "bar" / "scene.yaml").read_text())
    scene |= {"name": "fork", "out": "../../data/fork/mesh", "length": "70 mm"}
    scene |= {"geometry": {"kind": "mesh-file", "path": "fork.vtu"}, "mesh": {"size": "5 mm", "element": "hex8"}}
    scene["fixed"][0]["point"] = {"mm": [-10, 0, 0]}
    scene["actuators"] = [
        {
            "kind": "cable",
            "name": name,
            "pull_point": {"mm": [-10, 0, at]},
            "points": {"mm": [[15, 0, at], [35, 0, at], [55, 0, at]]},
            "reach": {"mm": [0, 4]},
        }
        for name, at in (("low", 4), ("high", 12))
    ]
    scene["effectors"] = [{"name": f"tip-{at}", "point": {"mm": [59, 0, at]}} for at in (0, 16)]
    sample = yaml.safe_load((PIPELINES / "bar" / "sample.yaml").read_text())
    sample |= {"mesh": "../../data/fork/mesh", "out": "../../data/fork/samples"}
    sample["splits"]["train"]["rows"] = 30
    train = {"dataset": "../../data/fork/samples", "out": "../../models/fork/spectral", "model": {"kind": "spectral"}}
    for name, spec in (("scene", scene), ("sample", sample), ("train", train)):
        (specs / f"{name}.yaml").write_text(yaml.safe_dump(spec, sort_keys=False))
    run(specs)
    return specs


def prongs(folder: Path) -> Path:
    """The pincer, of tetrahedra."""
    specs = shutil.copytree(PIPELINES / "pincer", folder / "pipelines" / "pincer")
    scene = specs / "scene.yaml"
    scene.write_text(scene.read_text().replace("element: hex8", "element: tet10p0"))
    run(specs)
    return specs


def judged(specs: Path, way: list[list[float]]) -> None:
    """Prints how far the tips of the two prongs, and the forces of their cables, are from those of walls that push each
    other from 0.5 % of the gap on, as shares of what contact changes; no friction."""
    folder = specs.parents[1] / "models" / "pincer" / "spectral"
    model, (scene, mesh) = load_model(folder), load_scene_and_mesh(specs / "scene.yaml")
    robot = build_robot(scene, mesh)
    pushed = SelfContactSpec(within="7 mm", onset=0.005)
    judge = Problem(build_robot(scene.model_copy(update={"self_contact": pushed}), mesh))
    surface = model.skin.nodes, model.skin.triangles
    touched = {"every node": node_model_of(model, folder, robot, {})}
    touched |= {f"patches of {mm:g} mm": patched_model_of(model, folder, robot, {}, mm) for mm in (2.5, 4.0, 6.0)}
    print("cables, mm | contact moves a tip by | touches at | FE: tip, force off | learned: tip, force off | mN | ms")
    for name, points in touched.items():
        learned = ContactScene([PlacedModel(points, unilateral=robot.unilateral)])
        truth, state, solved, base = (
            MeetingInFe([SkinnedRobot(robot, *surface, fe_points(points, robot))]),
            None,
            None,
            None,
        )
        for deltas in map(np.array, way):
            free, exact = (solve(problem, displacement(deltas), base=base) for problem in (Problem(robot), judge))
            begin = time.process_time()
            state, base = learned.go([deltas], state), exact.state
            spent, solved = time.process_time() - begin, truth.go([deltas], solved)
            moved, eased = of_tips(exact.delta_e - free.delta_e), np.abs(exact.lambda_a - free.lambda_a).max()
            off = [
                f"{100 * of_tips(delta_e - exact.delta_e) / moved:.2g} %, "
                f"{100 * np.abs(lambda_a - exact.lambda_a).max() / eased:.2g} %"
                for delta_e, lambda_a in (
                    (solved.solved[0].delta_e, solved.solved[0].lambda_a),
                    (state.delta_e[0], state.lambda_a[0]),
                )
            ]
            print(
                f"{deltas.tolist()} | {moved:.2f} mm | {name} | {' | '.join(off)} | "
                f"{1e3 * solved.pressed:.3g}, {1e3 * state.pressed:.3g} | {1e3 * spent:.0f}",
                flush=True,
            )


def of_tips(delta_e: np.ndarray) -> float:
    """The larger displacement, mm, of two tips (6,) mm."""
    return float(np.linalg.norm(delta_e.reshape(2, 3), axis=1).max())


def table(specs: Path, poses: list[tuple], mu: float, way: list[list[list[float]]]) -> None:
    """way: states, each of delta_a of each robot."""
    name = specs.name
    model = load_model(specs.parents[1] / "models" / name / "spectral")
    robot = build_robot(*load_scene_and_mesh(specs / "scene.yaml"))
    patches, states = patches_of(model, PATCHES), patch_states(model.domain, robot.rows.n_a)
    patched = PatchedModel(model, patches, patch_response(robot, model.skin.watched, patches, states))
    learned = ContactScene([PlacedModel(patched, *pose, unilateral=robot.unilateral) for pose in poses], mu=mu)
    surface = model.skin.nodes, model.skin.triangles, patches
    truth = MeetingInFe([SkinnedRobot(robot, *surface, *pose) for pose in poses], mu=mu)
    print(f"{len(patches)} patches, {patches.spacing:.2g} mm apart, friction {mu:g}")
    print("actuators, mm | force, FE | learned | tip of the way, FE | off | actuators, of the change | time, of a step")
    found = solved = None
    for deltas in way:
        deltas = [np.array(one) for one in deltas]
        begin = time.process_time()
        found = learned.go(deltas, found)
        spent = time.process_time() - begin
        solved = truth.go(deltas, solved)
        if not (found.converged and solved.converged):
            print(f"{deltas}: learned {found.status.value}; FE {solved.status.value}")
            break
        free = [model.at_displacement(one) for one in deltas]
        pairs = list(zip(found.delta_e, solved.solved, free, found.lambda_a, strict=True))
        moved = max(np.linalg.norm(one.delta_e - base.delta_e) for _, one, base, _ in pairs)
        off = max(np.linalg.norm(mine - one.delta_e) for mine, one, _, _ in pairs)
        change = max(np.abs(one.lambda_a - base.lambda_a).max() for _, one, base, _ in pairs)
        wrong = max(np.abs(mine - one.lambda_a).max() for _, one, _, mine in pairs)
        share = f"{100 * wrong / change:.2g} %" if solved.pressed else "-"
        print(
            f"{' '.join(str(one.tolist()) for one in deltas)} | {1e3 * solved.pressed:.4g} mN | "
            f"{1e3 * found.pressed:.4g} mN | {moved:.3f} mm | {off:.4f} mm | {share} | {1e3 * spent:.0f} ms",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", choices=("bars", "push", "fork", "pincer"))
    parser.add_argument("--mu", type=float, default=0.0, help="coefficient of friction")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if given.table == "bars":
            poses = [(np.eye(3), np.zeros(3)), (np.diag([1.0, -1.0, -1.0]), OVER)]
            way = [[[d], [0.8 * d]] for d in (0.9, 1.0, 1.1, 1.2)] + [
                [[d], [0.9 + 0.1 * (d - 0.6)]] for d in (1.4, 1.6)
            ]
            table(bar(Path(folder)), poses, given.mu, way)
        elif given.table == "push":
            poses = [(np.eye(3), np.zeros(3)), (np.eye(3), -OVER)]
            table(bar(Path(folder)), poses, given.mu, [[[0.05], [d]] for d in (1.8, 2.0, 2.4, 2.8, 1.9)])
        elif given.table == "pincer":
            judged(prongs(Path(folder)), [[1.0, 0.9], [1.2, 1.08], [1.5, 1.35], [2.0, 1.8]])
        else:
            way = [[[round(d, 2), round(0.9 * d, 3)]] for d in np.arange(1.0, 1.26, 0.05)]
            table(fork(Path(folder)), [()], given.mu, way)


if __name__ == "__main__":
    main()
