"""Loads that the samples did not carry, against finite elements that carry them: the tables of docs/loads.md.

python benchmarks/loads.py bar       forces at the tip of the bar of 60 mm, without and with D = dC/dw
python benchmarks/loads.py gravity   the bar's own weight in three directions, on rows of its centre of mass
python benchmarks/loads.py modules   a force at the tip of two Stiff-Flop modules of different stiffness
python benchmarks/loads.py patches   forces on twenty patches of the soft finger, after cfem run pipelines/soft-finger

The first three make their own samples, in a folder that they delete: one to ten minutes on one core. The last takes
about fifteen."""

import argparse
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml

import cfem
from cfem.constraint.patch import PatchLoad
from cfem.core.errors import InputError
from cfem.equilibrium.contact.patch_effectors import patch_yield
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.problem import Problem
from cfem.plant.fem_plant import FemPlant, pushed
from cfem.predict.load import build, load_model
from cfem.predict.loads.loaded import TRUSTED, loaded, wrench_error, wrench_of
from cfem.predict.series.energy import THIRD
from cfem.predict.series.few_states import patch_states
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

PIPELINES = Path(__file__).parents[1] / "pipelines"
FORCES = (7, 29, 57)  # mN
DIRECTION = np.array([0.3, 1.0, -1.0]) / np.linalg.norm([0.3, 1.0, -1.0])
STATES = 5
PLACES, RADIUS, SIZES = 20, 5.0, (0.05, 0.1, 0.2, 0.5, 1.0)  # patches; mm; N


def edited(path: Path, change) -> None:
    spec = yaml.safe_load(path.read_text())
    change(spec)
    path.write_text(yaml.safe_dump(spec, sort_keys=False))


def trained(folder: Path, change_scene=lambda scene: None) -> tuple:
    """The bar with D in its model, and the FE robot."""
    specs = shutil.copytree(PIPELINES / "bar", folder / "pipelines" / "bar")

    def scene(spec):
        spec["mesh"] = {"size": "5 mm", "element": "hex8"}
        change_scene(spec)

    edited(specs / "scene.yaml", scene)
    edited(specs / "sample.yaml", lambda spec: spec.update(third_order=True, loads=True))
    for stage, name in (("mesh", "scene"), ("sample", "sample"), ("train", "train")):
        cfem.run_stage(stage, specs / f"{name}.yaml")
    robot = build_robot(*load_scene_and_mesh(specs / "scene.yaml"))
    return load_model(folder / "models" / "bar" / "spectral"), robot


def without_third(model):
    return build(model.meta, {name: one for name, one in model.arrays.items() if name != THIRD})


def places(model) -> np.ndarray:
    states = model.domain.states[:, : model.rows.n_a]
    return states[np.random.default_rng(0).choice(len(states), STATES, replace=False)]


def compared(model, robot, wrench: np.ndarray) -> np.ndarray:
    """(4,) the largest over states: mm by which the tip moves, mm of the tip's error, N of the error of a force, N."""
    found = loaded(model, wrench)
    rows, plant = [], FemPlant(pushed(robot, wrench))
    for place in places(model):
        truth, free, mine = (one.at_displacement(place) for one in (plant, model, found))
        apart = [np.linalg.norm((truth.delta_e - one.delta_e)[:3]) for one in (free, mine)]
        rows.append([*apart, np.abs(truth.lambda_a - mine.lambda_a).max(), np.abs(truth.lambda_a).max()])
    return np.array(rows).max(axis=0)


def bar(folder: Path) -> None:
    model, robot = trained(folder)
    print("force at the tip | the tip moves | error of the tip | stated | error of the cable's force")
    for name, one in (("without D", without_third(model)), ("with D", model)):
        print(name)
        for size in FORCES:
            wrench = wrench_of(model.rows, {"tip": 1e-3 * size * DIRECTION})
            try:
                moved, tip, force, largest = compared(one, robot, wrench)
            except InputError as error:
                print(f"{size} mN | refused: {error.what}")
                continue
            stated = wrench_error(one, wrench)
            print(f"{size} mN | {moved:.2g} mm | {tip:.2g} mm | {stated:.2g} mm | {force:.1g} N of {largest:.2g} N")


def gravity(folder: Path) -> None:
    def heavy(scene):
        scene["material"]["density"] = "1070 kg/m^3"
        scene["effectors"].append({"name": "body", "at": "centre-of-mass"})

    model, robot = trained(folder, heavy)
    (mass,) = robot.masses.values()
    print(f"own weight {9810 * mass * 1e3:.0f} mN, refused above an estimated error of {TRUSTED * model.length:.2g} mm")
    print("direction | the tip sags | error without D | with D | error of the cable's force with D")
    for axis, name in enumerate("xyz"):
        wrench = wrench_of(model.rows, {"body": -9810 * mass * np.eye(3)[axis]})
        moved, first, *_ = compared(without_third(model), robot, wrench)
        _, second, force, largest = compared(model, robot, wrench)
        print(
            f"-{name} | {moved:.2f} mm | {first:.2g} mm, {100 * first / moved:.2g} % | "
            f"{second:.2g} mm, {100 * second / moved:.2g} % | {force:.1g} N of {largest:.2g} N"
        )


def modules(folder: Path) -> None:
    for name in ("stiff-flop", "stiff-flop-module"):
        shutil.copytree(PIPELINES / name, folder / "pipelines" / name)
    whole, module = folder / "pipelines" / "stiff-flop", folder / "pipelines" / "stiff-flop-module"
    edited(whole / "sample.yaml", lambda spec: [split.update(rows=10) for split in spec["splits"].values()])
    for specs in (module, whole):
        cfem.run_stage("mesh", specs / "scene.yaml")
        cfem.run_stage("sample", specs / "sample.yaml")
    cfem.run_stage("train", module / "train.yaml")
    cfem.run_stage("train", whole / "train-serial.yaml")
    model = load_model(folder / "models" / "stiff-flop" / "serial")
    robot, rng = build_robot(*load_scene_and_mesh(whole / "scene.yaml")), np.random.default_rng(3)
    rows, low, high = model.rows, *robot.forces.T
    states = []
    for share in rng.random((3, rows.n_a)):
        free = solve(Problem(robot), force(low + share * (high - low))).condensed
        direction = rng.normal(size=3)
        states.append((free.delta_a, free, direction / np.linalg.norm(direction)))
    print("force at the tip | the tip moves | error without D | with D | by W of the whole trunk")
    for size in (1, 2, 5):
        found = []
        for at, free, direction in states:
            push = 1e-3 * size * direction
            truth = solve(Problem(pushed(robot, push)), displacement(at), slack=False).condensed.delta_e
            C = free.W[rows.e, rows.e] - free.effector_jacobian @ free.W_ea.T
            guesses = [loaded(one, push).at(at).delta_e for one in (without_third(model), model)]
            apart = [np.linalg.norm(truth - one) for one in (free.delta_e, *guesses, free.delta_e + C @ push)]
            found.append(apart)
        low_high = zip(np.min(found, axis=0), np.max(found, axis=0), strict=True)
        print(f"{size} mN | " + " | ".join(f"{low:.2g} to {high:.2g} mm" for low, high in low_high), flush=True)


def patches(folder: Path) -> None:
    """Random places, directions and states; the folder is not used."""
    where = PIPELINES.parent / "models" / "soft-finger" / "spectral"
    model, robot = load_model(where), build_robot(*load_scene_and_mesh(PIPELINES / "soft-finger" / "scene.yaml"))
    rng, free, rest = np.random.default_rng(0), FemPlant(robot), model.skin.rest
    off_root = np.flatnonzero(rest[:, 2] < -12)
    found, seconds = {size: [] for size in SIZES}, {"solved": [], "loaded": [], "FE": []}
    for _ in range(PLACES):
        at, direction = rest[rng.choice(off_root)], rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        delta = model.domain.states[rng.integers(len(model.domain.states)), :2]
        begin = time.process_time()
        by_fe = patch_yield(robot, [PatchLoad(at, RADIUS, direction)], patch_states(model.domain, 2))
        seconds["solved"].append(time.process_time() - begin)
        still = free.at_displacement(delta)
        for size in SIZES:
            load = PatchLoad(at, RADIUS, size * direction)
            begin = time.process_time()
            truth = FemPlant(pushed(robot, np.zeros(3), [load])).at_displacement(delta)
            seconds["FE"].append(time.process_time() - begin)
            row = [np.linalg.norm(truth.delta_e - still.delta_e)]
            for known in (None, by_fe):
                begin = time.process_time()
                mine = loaded(model, patches=[load], by_fe=known, trusted=np.inf)
                seconds["loaded"].append(time.process_time() - begin)
                here = mine.at_displacement(delta)
                off = np.linalg.norm(here.delta_e - truth.delta_e)
                row += [off, mine.meta["wrench_error"], np.abs(here.lambda_a - truth.lambda_a).max()]
            found[size].append(row)
    each = "error of the tip | beyond the stated error, beyond twice | refused | error of the cables' forces"
    print(f"force | the tip moves | by the skin alone: {each} | with FE at ten states: {each}")
    allowed = TRUSTED * model.length
    for size, rows in found.items():
        rows = np.array(rows)
        said = [f"{size:g} N", f"{rows[:, 0].min():.2g} to {rows[:, 0].max():.2g} mm"]
        for off, stated, held in (rows[:, 1:4].T, rows[:, 4:7].T):
            kept = stated <= allowed
            said.append(
                f"{np.median(off):.2g}, worst {off.max():.2g}, of those taken {off[kept].max(initial=0):.2g} mm"
            )
            said += [f"{np.sum(off > stated)}, {np.sum(off > 2 * stated)}", f"{np.sum(~kept)}", f"{held.max():.1g} N"]
        print(" | ".join(said))
    typical = {name: np.median(one) for name, one in seconds.items()}
    print(
        f"CPU: how a patch yields {typical['solved']:.0f} s, once a place; to load the model "
        f"{1e3 * typical['loaded']:.0f} ms; one state by FE {typical['FE']:.1f} s"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    tables = {one.__name__: one for one in (bar, gravity, modules, patches)}
    parser.add_argument("table", choices=tables)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        tables[given.table](Path(folder))


if __name__ == "__main__":
    main()
