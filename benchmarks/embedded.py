"""The exported C controller against Python's, on the finger. Prints one JSON object.

Usage: embedded.py loop | arc | trunk | tick | python, with the artefacts of `make embedded` in place:
  loop    both close the loop on the FE plant along the closed curve
  trunk   both follow the pneumatic trunk's circle of 40 mm on its FE plant, open and closed, with the artefacts of
          `make stiff-flop`
  arc     both follow the paper's quarter circle, mostly out of reach
  tick    bytes, time of a tick here and instructions on emulated Cortex-M4 and M7, scalar by scalar and kind by kind;
          tick finger, tick trunk: of one robot
  python  a process without torch: memory and time of a tick, free running and paced at 1 kHz"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import numpy as np

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "models/soft-finger/embedded/c"
MODEL = ROOT / "models/soft-finger/spectral-large"
NETWORK = ROOT / "models/soft-finger/mlp"
TRUNK = ROOT / "pipelines/stiff-flop"
PUBLISHED = ["c.scalar=float", "c.controller.halvings=0", "c.controller.observer=previous_step"]
CLOCK = 480e6  # Hz, of the Cortex-M7 that rates are stated for


def loop(goals_count: int = 24, ticks: int = 3) -> dict:
    """Errors in mm at the end of each goal, open loop to convergence and closed with the paper's gains."""
    from cfem.condensed.strokes import ridge_of
    from cfem.control.closed_loop.controller import Controller
    from cfem.control.closed_loop.run import Pace, run_closed_loop
    from cfem.control.closed_loop.tick import Pilot
    from cfem.control.search.goal_search import SearchSettings
    from cfem.control.search.inverse import Limits
    from cfem.control.task.goals.trajectory import loop_of_shares
    from cfem.export.compiled.controller import CompiledController
    from cfem.plant.fem_plant import FemPlant
    from cfem.plant.gains import Gains
    from cfem.predict.load import load_model
    from cfem.robot.build import build_robot
    from cfem.robot.load import load_scene_and_mesh

    scene = ROOT / "pipelines/soft-finger/scene-large.yaml"
    robot = build_robot(*load_scene_and_mesh(scene, ROOT / "data/soft-finger/mesh-large"))
    plant = FemPlant(robot)
    goals = np.array([plant.pull(share).x_e for share in loop_of_shares([0.45, 0.45], [0.25, 0.25], goals_count)])
    model, compiled = load_model(MODEL), CompiledController(FOLDER)
    limits = Limits.of(robot.reach, robot.unilateral)
    ridge, weights = ridge_of(1e-10, robot.reach, robot.length), np.ones(robot.rows.n_e)

    settings = SearchSettings(iterations=20, tolerance=1e-5, step=5.0)
    search = Controller(Pilot(model, "displacement", "equilibrium", limits, weights, ridge, settings), robot.rest_e)
    missed, apart = {"c": [], "python": []}, 0.0
    for goal in goals:
        for _ in range(20):
            command = compiled.step(goal)
        plan = search.tick(goal).plan
        apart = max(apart, float(np.abs(command.delta_a - plan.delta_a).max()))
        missed["c"].append(np.linalg.norm(plant.step(command.delta_a).x_e - goal))
        missed["python"].append(np.linalg.norm(plant.step(plan.delta_a).x_e - goal))
    result = {"length": robot.length, "goals": goals_count, "open": {k: _errors(v) for k, v in missed.items()}}
    result["open"]["commands_apart_mm"] = apart

    once = SearchSettings(iterations=1, step=5.0)
    plants = {name: FemPlant(robot) for name in missed}  # a fresh one each: ticks are counted from its first
    pilot = Pilot(model, "displacement", "previous_step", limits, weights, ridge, once)
    pace, gains = Pace(0.0, 1, ticks_a_goal=ticks), Gains(0.01, 0.002, 10.0)
    moments = run_closed_loop(goals, pilot, plants["python"], robot.rest_e, pace, gains)
    compiled.reset()
    sample, mine = (), []
    for moment in moments:
        command = compiled.step(moment.goal, *sample)
        x_e = plants["c"].step(command.delta_a).x_e
        sample = x_e, command.tick
        mine.append(np.linalg.norm(x_e - moment.goal))
    last = slice(ticks - 1, None, ticks)
    after_the_first = slice(4 * ticks + ticks - 1, None, ticks)  # the way from rest to the curve takes a few goals
    python = [moment.error for moment in moments]
    result["closed"] = {
        "ticks_a_goal": ticks,
        "c": _errors(mine[after_the_first]),
        "python": _errors(python[after_the_first]),
        "largest_difference": float(np.abs(np.array(mine[last]) - python[last]).max()),
    }
    result["fe_solves"] = plant.solves + sum(one.solves for one in plants.values())
    return result


def _errors(values) -> dict[str, float]:
    return {"mean": float(np.mean(values)), "max": float(np.max(values))}


def arc(ticks: int = 5) -> dict:
    """The paper's quarter circle, mostly out of reach: mm by which C ends farther from each goal than Python's search,
    by the model."""
    from cfem.condensed.strokes import ridge_of
    from cfem.control.closed_loop.controller import Controller
    from cfem.control.closed_loop.tick import Pilot
    from cfem.control.search.goal_search import SearchSettings
    from cfem.control.search.inverse import Limits
    from cfem.control.task.goals.trajectory import arc
    from cfem.export.compiled.controller import CompiledController
    from cfem.predict.load import load_model

    model, compiled, settings = load_model(MODEL), CompiledController(FOLDER), SearchSettings(20, 1e-5, 5.0)
    limits, ridge = Limits.of(model.reach, np.ones(2, bool)), ridge_of(1e-10, model.reach, model.length)
    pilot = Pilot(model, "displacement", "equilibrium", limits, np.ones(3), ridge, settings)
    search = Controller(pilot, model.rest_e)
    farther, missed = [], []
    for goal in arc(np.zeros(3), 120.0, -np.pi / 2, 0.0, "yz", 40):
        for _ in range(ticks):
            command = compiled.step(goal)
        ends = (model.at_displacement(one).delta_e for one in (command.delta_a, search.tick(goal).plan.delta_a))
        mine, other = (float(np.linalg.norm(model.rest_e + end - goal)) for end in ends)
        farther.append(mine - other)
        missed.append(other)
    return {"ticks_a_goal": ticks, "farther_mm": {"max": max(farther), "min": min(farther)}, "missed_mm": max(missed)}


def trunk(goals_count: int = 40, ticks: int = 10) -> dict:
    """Errors in mm at the end of each goal of the circle: open loop into the robot of the model, by growths and by
    pressures; then by pressures, `ticks` a goal, into one whose modulus is 10 % higher, measured a tick late with noise
    of 0.1 mm, its pressures rounded to 0.2 kPa."""
    from cfem.condensed.strokes import ridge_of
    from cfem.control.closed_loop.controller import Controller
    from cfem.control.closed_loop.run import Pace, run_closed_loop
    from cfem.control.closed_loop.tick import Pilot
    from cfem.control.search.goal_search import SearchSettings
    from cfem.control.search.inverse import Limits
    from cfem.control.task.goals.trajectory import arc
    from cfem.core.spec import load_spec
    from cfem.plant.fem_plant import FemPlant
    from cfem.plant.gains import Gains
    from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant
    from cfem.predict.load import load_model
    from cfem.robot.build import build_robot
    from cfem.robot.load import load_scene_and_mesh
    from cfem.robot.spec import SceneSpec

    scene = TRUNK / "scene.yaml"
    spec, nodes = load_scene_and_mesh(scene, ROOT / "data/stiff-flop/mesh")
    robot = build_robot(spec, nodes)
    stiffer = build_robot(
        load_spec(scene, SceneSpec, ["material.young=165 kPa", "materials.0.material.young=99 kPa"]), nodes
    )
    goals = arc(robot.rest_e, 40.0, 0.0, 2 * np.pi * (1 - 1 / goals_count), "yz", goals_count)
    ridge, damping = ridge_of(1e-8, robot.reach, robot.length), ridge_of(1e-7, robot.reach, robot.length)
    weights, pace = np.ones(3), Pace(0.0, 1, ticks_a_goal=ticks, approach=20 * ticks)
    imperfection = Imperfection(noise=0.1, delay=1, quantum=2e-4)
    gains = {"open": None, "paper": Gains(0.01, 0.002, 10.0), "tuned": Gains(0.0, 0.347, 10.0)}
    result = {"length": robot.length, "goals": goals_count, "ticks_a_goal": ticks}
    for name in ("spectral", "serial"):
        model, found = load_model(ROOT / "models/stiff-flop" / name), {}
        limits = Limits(robot.forces, robot.reach)
        pilot = Pilot(model, "displacement", "equilibrium", limits, weights, ridge, SearchSettings(), damping=damping)
        search = Controller(pilot, robot.rest_e)
        plans = [search.tick(goal).plan.delta_a for goal in goals]
        plant = FemPlant(robot)
        found["python, open, growths"] = _errors(
            [_missed(plant, plan, goal) for plan, goal in zip(plans, goals, strict=True)]
        )
        for command, kind in (("displacement", "growths"), ("force", "pressures")):
            with _compiled(name, f"c.controller.command={command}") as compiled:
                missed, plant = [], FemPlant(robot)
                for goal in goals:
                    for _ in range(60):
                        told = compiled.step(goal)
                    told = told.delta_a if command == "displacement" else told.lambda_a
                    missed.append(_missed(plant, told, goal, command))
            found[f"c, open, {kind}"] = _errors(missed)

        low, high = np.stack([robot.reach, model.domain.delta_a.T], axis=-1).swapaxes(0, 1)
        limits = Limits(robot.forces, np.column_stack([low.min(axis=-1), high.max(axis=-1)]))
        pilot = Pilot(
            model, "force", "equilibrium", limits, weights, ridge, SearchSettings(iterations=1), damping=damping
        )
        for label, gain in gains.items():
            plant = ImperfectPlant(FemPlant(stiffer), imperfection, 0)
            moments = run_closed_loop(goals, pilot, plant, robot.rest_e, pace, gain)
            found[f"python, {label}"] = _at_the_end([one.index for one in moments], [one.error for one in moments])
            plant = ImperfectPlant(FemPlant(stiffer), imperfection, 0)
            gain = gain or Gains(0.0, 0.0)
            options = f"c.controller.K_P={gain.proportional}", f"c.controller.K_I={gain.integral}"
            with _compiled(name, *options) as compiled:
                errors, indices, sample = [], [], ()
                for index in (one.index for one in moments):
                    measured = plant.step(compiled.step(goals[index], *sample).lambda_a, "force")
                    sample = measured.x_e, measured.t
                    errors.append(float(np.linalg.norm(plant.actual.x_e - goals[index])))
                    indices.append(index)
            found[f"c, {label}"] = _at_the_end(indices, errors)
        result[name] = found
    return result


@contextmanager
def _compiled(model: str, *overrides: str):
    """The trunk's controller in C by the spec of its pipeline, with some of it overridden."""
    from cfem.core.stage import Options
    from cfem.export.compiled.controller import CompiledController
    from cfem.export.stage import run

    spec = TRUNK / ("export-c.yaml" if model == "spectral" else "export-c-serial.yaml")
    with tempfile.TemporaryDirectory() as place:
        run(spec, overrides, Path(place) / "out", Options(quiet=True))
        yield CompiledController(Path(place) / "out/c")


def _missed(plant, told: np.ndarray, goal: np.ndarray, command: str = "displacement") -> float:
    return float(np.linalg.norm(plant.step(told, command).x_e - goal))


def _at_the_end(indices: list[int], errors: list[float]) -> dict[str, float]:
    """Of each goal."""
    return _errors([errors[max(i for i, one in enumerate(indices) if one == goal)] for goal in sorted(set(indices))])


def tick(only: str = "") -> dict:
    """By variant whose name has `only` in it: bytes and what measure.c says here and emulated."""
    variants = {
        "finger, spectral, double": (MODEL, []),
        "finger, spectral, float": (MODEL, ["c.scalar=float"]),
        "finger, spectral, float, the paper's step": (MODEL, ["c.scalar=float", "c.controller.halvings=0"]),
        "finger, mlp 3x450, float": (NETWORK, ["c.scalar=float"]),
        "finger, mlp 3x450, 16-bit": (NETWORK, ["c.scalar=float", "c.hidden_weights=int16"]),
        "trunk, spectral, float": (TRUNK / "export-c.yaml", ["c.scalar=float"]),
        "trunk, spectral, float, the paper's step": (TRUNK / "export-c.yaml", PUBLISHED),
        "trunk, serial, double": (TRUNK / "export-c-serial.yaml", []),
        "trunk, serial, float": (TRUNK / "export-c-serial.yaml", ["c.scalar=float"]),
        "trunk, serial, float, the paper's step": (TRUNK / "export-c-serial.yaml", PUBLISHED),
    }
    return {name: _variant(*one) for name, one in variants.items() if only in name}


def _variant(source: Path, overrides: list[str]) -> dict:
    """source: of a spec, or the folder of a model."""
    from cfem.core.stage import Options
    from cfem.export.stage import run

    with tempfile.TemporaryDirectory() as place:
        spec = source
        if source.is_dir():
            spec = Path(place) / "export.yaml"
            spec.write_text(f"model: {source}\nout: out\nformats: [c]\n")
        results = run(spec, overrides, Path(place) / "out", Options(quiet=True))["results"]
        folder = Path(place) / "out/c"
        here = make(folder, "test", "measure")
        found = {"parity": results["parity"]["c"], **{key: results["c"][key] for key in ("bytes", "coefficient_bytes")}}
        found["operations"] = results["c"]["operations"]
        found["here"] = read(here) | {"peak_rss_kib": int(re.search(r"peak memory (\d+) KiB", here)[1])}
        for cpu in ("m7",) if source.suffix else ("m7", "m4"):  # the trunk's takes minutes on an M4
            said = make(folder, "emulate", f"CPU={cpu}")
            off = np.abs(commands(said) - commands(here)).max() / np.abs(commands(here)).max()
            found[cpu] = {**read(said), "off_from_here": float(off)}
        found["m7"]["hz_at_480_MHz_one_instruction_a_cycle"] = round(CLOCK / found["m7"]["max"])
    return found


def make(folder: Path, *targets: str) -> str:
    done = subprocess.run(["make", "-s", "-C", str(folder), *targets], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stdout[-2000:] + done.stderr)
    return done.stdout


def read(said: str) -> dict:
    cost = re.search(r"tick median (\d+) p99 (\d+) max (\d+) (\w+)", said)
    state, stack = re.search(r"state (\d+) bytes, stack (\d+)", said).groups()
    found = dict(zip(("median", "p99", "max"), map(int, cost.groups()[:3]), strict=True))
    return {**found, "unit": cost[4], "state_bytes": int(state), "stack_bytes": int(stack)}


def commands(said: str) -> np.ndarray:
    return np.array([line.split()[2:] for line in said.splitlines() if line.startswith("command")], float)


def python(steps: int = 20_000) -> dict:
    """benchmarks/control_process.py on the exported arrays, free running and paced, and the C step through ctypes."""
    script, model = str(ROOT / "benchmarks/control_process.py"), str(ROOT / "models/soft-finger/spectral-large-export")
    found = {}
    for name, more in (("free", []), ("paced at 1 kHz", ["--rate", "1000"])):
        count = steps if name == "free" else 10_000
        command = [sys.executable, script, model, "--steps", str(count), *more]
        done = subprocess.run(command, capture_output=True, text=True)
        found[name] = json.loads(done.stdout)
    from cfem.export.compiled.controller import CompiledController

    compiled, times = CompiledController(FOLDER), np.empty(steps)
    goals = np.array([compiled.step(np.zeros(3)).reference + [0.0, 0.1 * i, 0.0] for i in range(50)])
    for i in range(steps):
        begin = time.perf_counter()
        compiled.step(goals[i % 50])
        times[i] = time.perf_counter() - begin
    found["c through ctypes"] = {f"p{q}_us": round(1e6 * float(np.percentile(times, q)), 1) for q in (50, 99, 99.9)}
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["loop", "arc", "trunk", "tick", "python"])
    parser.add_argument("only", nargs="*", help="of tick: a part of the names of variants")
    asked = parser.parse_args()
    print(json.dumps(globals()[asked.what](*asked.only), indent=1))
