"""Modules in a row under their own weight and a force at the tip, against finite elements of the whole trunk: a table
of docs/loads.md.

python benchmarks/rows.py                                  two modules of rods, of different stiffness
python benchmarks/rows.py --modules 5                      five
python benchmarks/rows.py --element hex8-full --size 11    hexahedra between rigid sections
python benchmarks/rows.py --element hex8 --size 11         a solid
python benchmarks/rows.py --mixed                          the second module has two actuators instead of three
python benchmarks/rows.py --order 2                         samples with `loads: true` instead of `loads: 2`
python benchmarks/rows.py --cases 120                      how often the stated error holds, in random cases
python benchmarks/rows.py --c                              the C code of the row under a tenth of its weight and 1 mN

Modules are sampled without any load, 50 states each. Loads at three random states, actuators held: shares of the weight
in six directions, as a silicone of 150 kPa and 1070 kg/m^3 has it (a fifth of it is the weight for one of 750 kPa), and
with it 2 mN at the tip, to the side. States in which a chamber would have to be sucked at are left out, and counted:
its wall buckles there, and no robot goes there. Random cases each have a state, a load (a force at the tip, the weight,
or both) and its direction of their own: shares of the weight of 4 to 400 % (2 / modules)^3, forces of 1.3 to 40 mN
(2 / modules)^3, evenly by their logarithm. It makes its own samples, in a folder that it deletes: two to ten
minutes on one core."""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml

import cfem
from cfem.core.errors import NumericalError
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.problem import Problem
from cfem.export.compiled.build import sizes
from cfem.export.compiled.controller import CompiledController
from cfem.export.firmware.folder import write_c
from cfem.export.spec import CSpec
from cfem.plant.fem_plant import pushed
from cfem.predict.load import load_model
from cfem.predict.loads.loaded import TRUSTED, loaded, wrench_of
from cfem.predict.rows.loaded_serial import LoadedSerialPredictor
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

PIPELINES = Path(__file__).parents[1] / "pipelines"
LENGTH, DENSITY, PUSH = 55.0, "1070 kg/m^3", 2e-3  # mm of a module; N
STATES = 3
SIDES = {"three": [[1, 2], [4, 3], [5, 0]], "two": [[5, 0, 1], [2, 3, 4]]}  # chambers of each actuator


def read(path: Path) -> dict:
    return yaml.safe_load(path.read_text())


def actuators(module: int, sides: list[list[int]], most: float) -> list[dict]:
    common = {"kind": "chambers", "module": module, "reach": {"mm^3": [0, 50]}, "pressure": {"kPa": [0, most]}}
    return [{**common, "name": f"m{module}-{i}", "chambers": one} for i, one in enumerate(sides)]


def made(folder: Path, name: str, scene: dict, sample: dict, train: dict) -> Path:
    """The scene, meshed, sampled and trained; its pipeline."""
    specs, paths = folder / "pipelines" / name, {"scene": "scene.yaml", "mesh": f"../../data/{name}/mesh"}
    specs.mkdir(parents=True)
    scene = {**scene, "name": name, "out": paths["mesh"]}
    sample = {**sample, **paths, "out": f"../../data/{name}/samples"}
    train = {**train, "dataset": sample["out"], "out": f"../../models/{name}/model"}
    for stage, spec in (("scene", scene), ("sample", sample), ("train", train)):
        (specs / f"{stage}.yaml").write_text(yaml.safe_dump(spec, sort_keys=False))
    for stage, file in (("mesh", "scene"), ("sample", "sample"), ("train", "train")):
        cfem.run_stage(stage, specs / f"{file}.yaml")
    return specs


def trained(folder: Path, given: argparse.Namespace) -> tuple:
    """The model of the row, and the FE robot of the whole."""
    base = read(PIPELINES / "stiff-flop-module" / "scene.yaml")
    base["mesh"] = {"size": f"{given.size} mm", "element": given.element}
    base["material"]["density"] = DENSITY
    centre = {"name": "body", "at": "centre-of-mass"}
    sample = read(PIPELINES / "stiff-flop-module" / "sample.yaml") | {"loads": 2 if given.order == 3 else True}
    kinds = ["three", "two"] if given.mixed else ["three"]
    for kind in kinds:
        scene = {**base, "actuators": actuators(1, SIDES[kind], 334.0), "effectors": [*base["effectors"], centre]}
        made(folder, kind, scene, sample, {"model": {"kind": "spectral"}})
    each = [kinds[i % len(kinds)] for i in range(given.modules)]
    young = [150.0 if i % 2 == 0 else 90.0 for i in range(given.modules)]
    scene = {**base, "length": f"{LENGTH * given.modules} mm"}
    scene["geometry"] = {"kind": "stiff-flop", "modules": given.modules}
    scene["materials"] = [
        {"region": {"kind": "name", "name": f"module-{i + 1}"}, "material": {**base["material"], "young": f"{E} kPa"}}
        for i, E in enumerate(young)
        if young[0] != E
    ]
    most = [200.0 if E == 150 else 180.0 for E in young]
    scene["actuators"] = [
        one for i, kind in enumerate(each) for one in actuators(i + 1, SIDES[kind], most[i] / (1 + (given.modules > 2)))
    ]
    scene["effectors"] = [{"name": "tip", "point": {"mm": [LENGTH * given.modules, 0, 0]}}, centre]
    if not scene["materials"]:
        del scene["materials"]
    splits = {name: {"rows": 8, "method": "random", "seed": seed} for seed, name in enumerate(("train", "test"))}
    few = {"space": "force", "splits": splits}
    row = [{"model": f"../../models/{kind}/model", "softer": 150 / E} for kind, E in zip(each, young, strict=True)]
    specs = made(folder, "whole", scene, few, {"model": {"kind": "serial", "modules": row}})
    model = load_model(folder / "models" / "whole" / "model")
    return model, build_robot(*load_scene_and_mesh(specs / "scene.yaml"))


def table(model, robot, shares: list[float]) -> None:
    rng, rows, low, high = np.random.default_rng(3), model.rows, *robot.forces.T
    (mass,) = robot.masses.values()
    states = [force(low + share * (high - low)) for share in rng.random((STATES, rows.n_a))]
    states = [solve(Problem(robot), one).condensed.delta_a for one in states]
    print(f"{robot.length:g} mm, {len(robot.X)} nodes, weight {9810 * mass * 1e3:.1f} mN")
    print("weight | the tip moves | error of the tip | of the motion | median | stated | refused | left out | beyond")
    for share in shares:
        for name, push in (("", 0.0), (" and 2 mN", PUSH)):
            moved, off, stated, here, sucked = [], [], [], [], 0
            for side in (*np.eye(3), *-np.eye(3)):
                forces = {"body": share * 9810 * mass * side, "tip": push * np.array([0.0, 0.6, -0.8])}
                wrench = wrench_of(rows, forces)
                carrying = LoadedSerialPredictor({**model.meta, "wrench": wrench.tolist()}, model.arrays)
                try:
                    stated.append(carrying.wrench_error())
                except NumericalError:  # at one of the training states the row finds no equilibrium
                    stated.append(np.inf)
                problem = Problem(pushed(robot, wrench))
                for at in states:
                    solved = solve(problem, displacement(at), slack=False)
                    if not solved.converged or solved.lambda_a.min() < 0:
                        sucked += 1
                        continue
                    truth = solved.delta_e[:3]
                    moved.append(np.linalg.norm(truth - model.at(at).delta_e[:3]))
                    off.append(np.linalg.norm(truth - carrying.at(at).delta_e[:3]))
                    here.append(carrying.error_at(at))
            motion = 100 * np.array(off) / np.array(moved)
            ratio = np.array(off) / np.array(here)
            refused = sum(one > TRUSTED * model.length for one in stated)
            print(
                f"{share:g} of it{name} | {min(moved):.2g} to {max(moved):.2g} mm | {max(off):.2g} mm |"
                f" {motion.max():.2g} % | {np.median(motion):.2g} % | {max(stated):.2g} mm | {refused} of 6 |"
                f" {sucked} | {sum(ratio > 1)} of {len(off)}, at most {ratio.max():.2g} times",
                flush=True,
            )


def covered(model, robot, count: int) -> None:
    """Random cases: how often the error of the tip is within what is stated at its state, and how much that is."""
    rng, (mass,), (low, high) = np.random.default_rng(3), robot.masses.values(), robot.forces.T
    bare, slender, held, left_out = Problem(robot), (2 / len(model.which)) ** 3, [], 0
    while len(held) < count:
        at = solve(bare, force(low + rng.random(model.rows.n_a) * (high - low))).delta_a
        sides = rng.normal(size=(2, 3))
        sides *= 10 ** rng.uniform([[-1.5], [-2]], 0) / np.linalg.norm(sides, axis=1)[:, None]
        sides *= np.array([[1, 0], [0, 1], [1, 1]])[rng.integers(3)][:, None]
        wrench = slender * np.concatenate([0.04 * sides[0], 4 * 9810 * mass * sides[1]])
        truth = solve(Problem(pushed(robot, wrench)), displacement(at), slack=False)
        carrying = LoadedSerialPredictor({**model.meta, "wrench": wrench.tolist()}, model.arrays)
        try:
            state, stated = carrying.at(at), carrying.error_at(at)
        except NumericalError:
            stated = np.inf
        if not truth.converged or truth.lambda_a.min() < 0 or stated > TRUSTED * model.length:
            left_out += 1
            continue
        held.append((np.linalg.norm((state.delta_e - truth.delta_e)[:3]), stated))
    off, stated = np.array(held).T
    ratios, most = np.quantile(stated / off, (0, 0.05, 0.5, 0.95)), off.max()
    print(
        f"{robot.length:g} mm: within the stated error {np.mean(off <= stated):.1%} of {count} cases, {left_out} left"
    )
    print(
        "out; stated over true, least, 5, 50, 95 %: " + ", ".join(f"{r:.2g}" for r in ratios) + f"; tip {most:.2g} mm"
    )


def compiled(model, robot) -> None:
    """What the C code of the loaded row costs, beside Python's."""
    (mass,) = robot.masses.values()
    row = loaded(model, wrench_of(model.rows, {"body": [0, 0, -0.1 * 9810 * mass], "tip": [0, 1e-3, 0]}))
    s = row.domain.states[:, : row.rows.n_a]
    for scalar in ("double", "float"):
        with tempfile.TemporaryDirectory() as place:
            report = write_c(Path(place), row.meta, row.arrays, CSpec(scalar=scalar), s)
            bytes_ = {name: one for name, one in sizes(Path(place)).items() if one}
            controller = CompiledController(Path(place))
            off = max(np.abs(controller.model(one)["lambda_a"] - row.at(one).lam).max() for one in s)
            goals = iter([row.rest_e + row.at(one).delta_e for one in s] * 1000)
            times = [
                fastest(ask)
                for ask in (
                    lambda: row.at(s[0]),
                    lambda: controller.model(s[0]),  # noqa: B023 - asked within the round
                    lambda: controller.step(next(goals)),  # noqa: B023
                )
            ]
        print(f"{scalar}: coefficients {report['coefficient_bytes']} B, {bytes_}")
        print(f"  forces off by {off:.1g} N of {np.abs(row.domain.lambda_a).max():.2g}")
        print(
            "  CPU us of an evaluation in Python, in C, of a tick in C: " + ", ".join(f"{1e6 * t:.0f}" for t in times)
        )


def fastest(ask) -> float:
    found = []
    for _ in range(30):
        start = time.process_time()
        ask()
        found.append(time.process_time() - start)
    return min(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--modules", type=int, default=2)
    parser.add_argument("--element", choices=("beam", "hex8-full", "hex8"), default="beam")
    parser.add_argument("--size", type=float, default=5.5, help="mm of the cells")
    parser.add_argument("--mixed", action="store_true")
    parser.add_argument("--shares", type=float, nargs="+", default=[0.1, 0.2, 0.4], help="of the weight")
    parser.add_argument("--order", type=int, choices=(2, 3), default=3, help="of the motion in the load, in samples")
    parser.add_argument("--cases", type=int, help="random cases instead of the table")
    parser.add_argument("--c", action="store_true")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        made_of = trained(Path(folder), given)
        if given.c:
            compiled(*made_of)
        elif given.cases:
            covered(*made_of, given.cases)
        else:
            table(*made_of, given.shares)


if __name__ == "__main__":
    main()
