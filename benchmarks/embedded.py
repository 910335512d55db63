"""The exported C controller against Python's, on the finger. Prints one JSON object.

Usage: embedded.py loop | tick | python | osqp, with the artefacts of `make embedded` in place:
  loop    both close the loop on the FE plant along the closed curve
  tick    bytes, time of a tick here and instructions on emulated Cortex-M4 and M7, scalar by scalar and kind by kind
  python  a process without torch: memory and time of a tick, free running and paced at 1 kHz
  osqp    the same inverse steps by OSQP as firmware has it (no polish), at three tolerances, and by the C active set"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import numpy as np

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "models/soft-finger/embedded/c"
MODEL = ROOT / "models/soft-finger/spectral-large"
NETWORK = ROOT / "models/soft-finger/mlp"
CLOCK = 480e6  # Hz, of the Cortex-M7 that rates are stated for


def loop(goals_count: int = 24, ticks: int = 3) -> dict:
    """Errors in mm at the end of each goal, open loop to convergence and closed with the paper's gains."""
    from cfem.control.closed_loop import Gains, Pace, run_loop
    from cfem.control.experiment import Controller, Tracker
    from cfem.control.fem_plant import FemPlant
    from cfem.control.inverse import Limits, ridge_of
    from cfem.control.loop import Settings
    from cfem.control.tick import Pilot
    from cfem.control.trajectory import loop_of_shares
    from cfem.export.compiled import CompiledController
    from cfem.predict.load import load_model
    from cfem.robot.build import build_robot
    from cfem.robot.load import load_scene_and_mesh

    robot = build_robot(*load_scene_and_mesh(ROOT / "pipelines/soft-finger/scene.yaml", ROOT / "data/soft-finger/mesh"))
    plant = FemPlant(robot)
    goals = np.array([plant.pull(share).x_e for share in loop_of_shares([0.45, 0.45], [0.25, 0.25], goals_count)])
    model, compiled = load_model(MODEL), CompiledController(FOLDER)
    limits = Limits.of(robot.reach, robot.unilateral)
    ridge, weights = ridge_of(1e-10, robot.reach, robot.length), np.ones(robot.rows.n_e)

    settings = Settings(iterations=20, tolerance=1e-5, step=5.0)
    tracker = Tracker(Controller("spectral", model, settings, settings), limits, weights, ridge, robot.rest_e)
    missed, apart = {"c": [], "python": []}, 0.0
    for goal in goals:
        for _ in range(20):
            command = compiled.step(goal)
        plan = tracker.towards(goal)
        apart = max(apart, float(np.abs(command.delta_a - plan.delta_a).max()))
        missed["c"].append(np.linalg.norm(plant.step(command.delta_a).x_e - goal))
        missed["python"].append(np.linalg.norm(plant.step(plan.delta_a).x_e - goal))
    result = {"length": robot.length, "goals": goals_count, "open": {k: _errors(v) for k, v in missed.items()}}
    result["open"]["commands_apart_mm"] = apart

    once = Settings(iterations=1, step=5.0)
    pilot = Pilot(model, "displacement", "previous_step", limits, weights, ridge, once)
    moments = run_loop(goals, pilot, plant, robot.rest_e, Pace(0.0, 1, ticks_a_goal=ticks), Gains(0.01, 0.002, 10.0))
    compiled.reset()
    error, mine = None, []
    for moment in moments:
        command = compiled.step(moment.goal, error)
        x_e = plant.step(command.delta_a).x_e
        error = command.reference - x_e
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
    return result | {"fe_solves": plant.solves, "fe_seconds": plant.seconds}


def _errors(values) -> dict[str, float]:
    return {"mean": float(np.mean(values)), "max": float(np.max(values))}


def tick() -> dict:
    """By variant: bytes and what measure.c says here and emulated."""
    variants = {
        "spectral, double": (MODEL, []),
        "spectral, float": (MODEL, ["c.scalar=float"]),
        "spectral, float, the paper's step": (MODEL, ["c.scalar=float", "c.controller.halvings=0"]),
        "mlp 3x450, float": (NETWORK, ["c.scalar=float"]),
        "mlp 3x450, 16-bit": (NETWORK, ["c.scalar=float", "c.hidden_weights=int16"]),
    }
    return {name: _variant(*one) for name, one in variants.items()}


def _variant(model: Path, overrides: list[str]) -> dict:
    from cfem.core.stage import Options
    from cfem.export.stage import run

    with tempfile.TemporaryDirectory() as place:
        spec = Path(place) / "export.yaml"
        spec.write_text(f"model: {model}\nout: out\nformats: [c]\n")
        results = run(spec, overrides, None, Options(quiet=True))["results"]
        folder = spec.parent / "out/c"
        here = make(folder, "test", "measure")
        found = {"parity": results["parity"]["c"], **{key: results["c"][key] for key in ("bytes", "coefficient_bytes")}}
        found["operations"] = results["c"]["operations"]
        found["here"] = {**read(here), **memory([str(folder / "measured")])}
        for cpu in ("m7", "m4"):
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


def memory(command: list[str]) -> dict[str, float]:
    """Peak memory of a process, MiB, counted by the system."""
    script = "import resource,subprocess,sys; subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=True); "
    script += "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    # -S: the parent's own pages are counted in the child before it starts the program
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", script, *command], capture_output=True, text=True, check=True
    )
    return {"peak_rss_mib": round(int(done.stdout) / 1024, 1)}


def python(steps: int = 20_000) -> dict:
    """benchmarks/control_process.py on the exported arrays, free running and paced, and the C step through ctypes."""
    script, model = str(ROOT / "benchmarks/control_process.py"), str(ROOT / "models/soft-finger/spectral-large-export")
    found = {}
    for name, more in (("free", []), ("paced at 1 kHz", ["--rate", "1000"])):
        count = steps if name == "free" else 10_000
        command = [sys.executable, script, model, "--steps", str(count), *more]
        done = subprocess.run(command, capture_output=True, text=True)
        found[name] = json.loads(done.stdout)
    from cfem.export.compiled import CompiledController

    compiled, times = CompiledController(FOLDER), np.empty(steps)
    goals = np.array([compiled.step(np.zeros(3)).reference + [0.0, 0.1 * i, 0.0] for i in range(50)])
    for i in range(steps):
        begin = time.perf_counter()
        compiled.step(goals[i % 50])
        times[i] = time.perf_counter() - begin
    found["c through ctypes"] = {f"p{q}_us": round(1e6 * float(np.percentile(times, q)), 1) for q in (50, 99, 99.9)}
    return found


def osqp() -> dict:
    """Largest error of lambda, as a share of its range, and iterations, on inverse steps along the closed curve."""
    import osqp as solver
    from scipy.sparse import csc_matrix, triu

    from cfem.control.inverse import Limits, ridge_of
    from cfem.control.qp import solve_qp
    from cfem.predict.load import load_model

    model = load_model(MODEL)
    limits, ridge = Limits.of(model.reach, np.ones(2, bool)), ridge_of(1e-10, model.reach, model.length)
    problems = []
    for angle in np.linspace(0, 2 * np.pi, 40, endpoint=False):
        pulls = [9 + 5 * np.cos(angle + shift) for shift in (0.0, 0.15)]
        others = [9 + 5 * np.sin(angle + shift) for shift in (0.0, 0.15)]
        at, to = (model.at_displacement(np.array(pair)) for pair in zip(pulls, others, strict=True))
        now = limits.within(at.delta_a, 5.0)
        free_a, free_e = at.delta_free[at.rows.a], at.delta_free[at.rows.e]
        course = np.diag(ridge**2)
        H = at.W_ea.T @ at.W_ea + at.W_aa @ course @ at.W_aa
        f = at.W_ea.T @ (free_e - to.delta_e) + at.W_aa @ course @ free_a
        problems.append((H, f, at.W_aa, now.delta_a[:, 0] - free_a, now.delta_a[:, 1] - free_a, now.lambda_a))
    exact = [solve_qp(*one).x for one in problems]
    size = np.abs(exact).max()
    found = {}
    for tolerance in (1e-3, 1e-6, 1e-9):
        worst, iterations, solved = 0.0, [], 0
        for (H, f, A, low, high, box), x in zip(problems, exact, strict=True):
            one = solver.OSQP()
            rows, bounds = (
                csc_matrix(np.vstack([np.eye(2), A])),
                (np.append(box[:, 0], low), np.append(box[:, 1], high)),
            )
            one.setup(triu(csc_matrix(H), format="csc"), f, rows, *bounds, eps_abs=tolerance, eps_rel=tolerance,
                      polishing=False, max_iter=4000, verbose=False)  # fmt: skip
            result = one.solve(raise_error=False)
            worst = max(worst, float(np.abs(result.x - x).max() / size))
            iterations.append(int(result.info.iter))
            solved += result.info.status == "solved"
        found[f"osqp {tolerance:g}"] = {
            "lambda_off": worst, "iterations_mean": float(np.mean(iterations)), "iterations_max": max(iterations),
            "says_solved": solved, "of": len(problems),
        }  # fmt: skip
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["loop", "tick", "python", "osqp"])
    print(json.dumps(globals()[parser.parse_args().what](), indent=1))
