"""Condensed models that move against full finite elements in motion: the table of docs/dynamics.md.

    python benchmarks/motion.py soft-finger stiff-flop [--quick]

Of each pipeline named it samples and trains a copy whose materials have 1070 kg/m^3 and a relaxation time of 3 ms
(under data/motion/; what is up to date stays), and prints JSON:

frequency_error: largest relative error of the first three natural frequencies over 20 test states, actuators held and
free. tip_error: largest distance of the tip from that of full finite elements, over its travel, after a step within a
quarter of the first period and in a chirp from a third of the first frequency to all of it, in two periods each: cables
or growths commanded, from half of the reach by a tenth of it. energy_drift: of the undamped model in 1000 periods of
100 steps, by the straight line through its energy, over the vibration's own.
step_us, c_step_us: CPU time of a condensed step in Python and in C, and full_step_over: of a full one over each.
sampling: CPU time of a state with what dynamics: true adds over one without, with what loads: true adds to solids too,
and its factorisations. --quick: 20 periods, 10 training states, 2 others and no tip."""

import ctypes
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.viscosity import Viscosity
from cfem.core.stage import Options
from cfem.core.yaml import parse_yaml
from cfem.dataset.reader import read_dataset
from cfem.equilibrium.motion.inner_motions import rod_stresses
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.export.compiled.build import compiler, library
from cfem.export.firmware.folder import write_c
from cfem.export.firmware.motion import write_c_motion
from cfem.export.spec import CSpec
from cfem.fe_motion.modes import natural_modes as full_modes
from cfem.fe_motion.problem import MovingProblem
from cfem.fe_motion.scheme import Scheme
from cfem.fe_motion.simulate import StepControl
from cfem.fe_motion.simulate import simulate as full_simulate
from cfem.fe_motion.start import at_rest as full_at_rest
from cfem.motion.load import load_motion
from cfem.motion.model import MotionModel
from cfem.motion.modes import natural_modes
from cfem.motion.simulate import simulate
from cfem.motion.step import MotionCommand, at_rest, energy, step
from cfem.predict.load import read_arrays, read_model
from cfem.robot import stage as mesh_stage
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.sample.stage import run as sample
from cfem.surrogate.stage import run as train

ROOT = Path(__file__).parents[1]
HEAVY = {"density": "1070 kg/m^3", "viscosity": {"relaxation": "3 ms"}}
ROWS = {"stiff-flop": 1000}  # training states, 60 of others
STATES, REPEATS = 20, 5
QUIET = Options(quiet=True)


def prepared(name: str, quick: bool) -> tuple[MovingProblem, MotionModel, Any, Path]:
    """The full robot, the model that moves, its test states, and the model's folder."""
    root = ROOT / "data" / ("motion-quick" if quick else "motion")
    folder = root / "pipelines" / name
    folder.mkdir(parents=True, exist_ok=True)
    source = ROOT / "pipelines" / name
    scene, _ = parse_yaml((source / "scene.yaml").read_text(), "scene.yaml")
    for material in [scene["material"], *(one["material"] for one in scene.get("materials", []))]:
        material.update(HEAVY)
    (folder / "scene.yaml").write_text(json.dumps(scene))
    for spec in ("sample.yaml", "train.yaml"):
        (folder / spec).write_text((source / spec).read_text())
    mesh_stage.run(folder / "scene.yaml", [], None, QUIET)
    count, states = (10, 2) if quick else (ROWS.get(name, 60), STATES)
    rows = [f"splits.train.rows={count}", f"splits.test.rows={states}"]
    # of solids the skin's rows make inner motions, and loads arcs of the tip; a rod has its own inner motions
    plain = ["skin=null"] if scene["mesh"].get("element") == "beam" else ["loads=true"]
    sample(folder / "sample.yaml", ["dynamics=true", "third_order=false", *plain, *rows], None, QUIET, workers=1)
    train(folder / "train.yaml", ["learning_curve=[]", "skin=false"], None, QUIET)
    robot = build_robot(*load_scene_and_mesh(folder / "scene.yaml", root / "data" / name / "mesh"))
    test = read_dataset(root / "data" / name / "samples" / "test.parquet")
    trained = root / "models" / name / "spectral"
    return MovingProblem(robot), load_motion(trained), test, trained


def frequency_error(problem: MovingProblem, model: MotionModel, test: Any) -> dict[str, list[float]]:
    errors: dict[str, list] = {"held": [], "free": []}
    for delta in test.delta_a[:STATES]:
        state = solve(problem, displacement(delta), slack=False).state
        for kind, free in (("held", None), ("free", force(np.zeros(len(delta))))):
            full = full_modes(problem, state, 3, free).frequency
            ours = natural_modes(model, delta, kind == "held", 3).frequency
            errors[kind].append(np.abs(ours / full - 1))
    return {kind: np.max(each, axis=0).tolist() for kind, each in errors.items()}


def commands(model: MotionModel, delta: np.ndarray) -> dict[str, tuple[Any, float, list[float]]]:
    """By name: displacements over time, when they end, and where they have kinks."""
    change, f = 0.2 * delta, float(natural_modes(model, delta).frequency[0])
    rise, long = 0.25 / f, 2 / f

    def a_step(t: float) -> np.ndarray:
        return delta + change * (0.5 - 0.5 * np.cos(np.pi * min(t / rise, 1.0)))

    def chirp(t: float) -> np.ndarray:
        phase = 2 * np.pi * f * (t / 3 + t**2 / (3 * long))
        return delta + change * np.sin(phase)

    return {"step": (a_step, long, [rise]), "chirp": (chirp, long, [])}


def tip_error(problem: MovingProblem, model: MotionModel) -> tuple[dict[str, float], float, int]:
    """And CPU seconds and steps of the full model."""
    reach = model.static.domain.states[:, : model.n_a]
    delta = reach[np.argmin(np.linalg.norm(reach - reach.mean(axis=0), axis=1))]
    errors, spent, steps = {}, 0.0, 0
    for name, (told, end, kinks) in commands(model, delta).items():
        dt = end / 120
        state = solve(problem, displacement(delta), slack=False).state
        begin = time.process_time()
        full = full_simulate(
            problem,
            full_at_rest(problem, state),
            lambda t, told=told: displacement(told(t)),
            end,
            kinks,
            StepControl(dt, tolerance=None),
            Scheme(1.0),
        )
        spent, steps = spent + time.process_time() - begin, steps + len(full.samples) - 1
        ours = simulate(
            model, at_rest(model, delta), lambda t, told=told: MotionCommand(displacement=told(t)), end, dt / 2
        ).arrays()
        tip = np.array([np.interp(full.t, ours["t"], column) for column in ours["delta_e"].T]).T
        wanted = full.of("delta_e")
        travel = np.linalg.norm(np.ptp(wanted, axis=0))
        errors[name] = float(np.linalg.norm(tip - wanted, axis=1).max() / travel)
    return errors, spent, steps


def energy_drift(model: MotionModel, periods: int) -> float:
    still = MotionModel.__new__(MotionModel)
    vars(still).update(vars(model), losses=tuple(Viscosity(0.0, ()) for _ in model.losses))
    states = model.static.domain.states[:, : model.n_a]
    start = at_rest(still, states[np.argmin(np.linalg.norm(states - states.mean(axis=0), axis=1))])
    lam, period = 0.95 * start.lam, 1 / natural_modes(still, start.q[: model.n_a], False, 1).frequency[0]
    found, now, a_period = [], start, 100
    for _ in range(periods * a_period):
        now = step(still, now, MotionCommand(force=lam), period / a_period)
        found.append(energy(still, now) - float(lam @ now.q[: model.n_a]))
    own = max(
        0.5 * float((start.lam - lam) @ np.linalg.solve(model.at(start.q[: model.n_a]).stiff, start.lam - lam)), 0
    )
    return float(abs(np.polyfit(np.linspace(0, 1, len(found)), found, 1)[0]) / own)


def step_us(model: MotionModel) -> float:
    """The least of 10 runs of 100 steps: asking the clock at each step would cost as much as a step."""
    states = model.static.domain.states[:, : model.n_a]
    start = at_rest(model, states.mean(axis=0))
    lam, dt, times = 0.9 * start.lam, 0.02 / natural_modes(model, start.q[: model.n_a], False, 1).frequency[0], []
    for _ in range(10):
        now, begin = start, time.process_time()
        for _ in range(100):
            now = step(model, now, MotionCommand(force=lam), dt)
        times.append((time.process_time() - begin) / 100 * 1e6)
    return min(times)


def c_step_us(folder: Path, model: MotionModel) -> float | None:
    """Of the same motion in C, compiled with -O3 for this processor: the least of 10 runs; None without a compiler."""
    if compiler() is None:
        return None
    meta, arrays = read_model(folder)
    delta = model.static.domain.states[:, : model.n_a].mean(axis=0)
    with tempfile.TemporaryDirectory() as place:
        write_c(Path(place), meta, arrays, CSpec(), delta[None])
        write_c_motion(Path(place), meta, arrays, read_arrays(folder, "motion.npz"))
        code = library(Path(place), ("-O3", "-march=native"))
    doubles, count, times = ctypes.c_double * model.n_a, 500, []
    state = (ctypes.c_double * (1 + (5 + 8) * model.n_q + model.n_a))()
    lam = doubles(*(0.9 * at_rest(model, delta).lam))
    dt, none = 0.02 / natural_modes(model, delta, False, 1).frequency[0], (ctypes.c_int * model.n_a)()
    for _ in range(10):
        code.cfem_motion_rest(state, doubles(*delta))
        begin = time.process_time()
        missed = sum(code.cfem_motion_step(state, lam, none, ctypes.c_double(dt)) for _ in range(count))
        times.append((time.process_time() - begin) / count * 1e6)
        assert not missed, f"{missed} steps are not found"
    return min(times)


def sampling(problem: MovingProblem, test: Any) -> dict[str, Any]:
    stresses = rod_stresses(problem, problem.mass) if problem.body.rod is not None else None
    near = solve(problem, displacement(test.delta_a[0]), slack=False)

    def spent(**more: Any) -> tuple[float, int]:
        times = []
        for _ in range(REPEATS):
            begin = time.process_time()
            found = solve(problem, displacement(0.98 * test.delta_a[0]), near.state, slack=False, wanted=Wanted(**more))
            times.append(time.process_time() - begin)
        return min(times), found.factorizations

    plain, moving = spent(), spent(mass=problem.mass, stresses=stresses)
    found = {"ratio": moving[0] / plain[0], "factorizations": {"without": plain[1], "with": moving[1]}}
    if stresses is None:
        found["ratio_with_loads"] = spent(mass=problem.mass, loads=True)[0] / plain[0]
    return found


def main(name: str, quick: bool) -> dict[str, Any]:
    problem, model, test, folder = prepared(name, quick)
    results = {
        "unknowns": problem.pattern.n_dof,
        "coordinates": {"actuators": model.n_a, "inner": model.n_r},
        "frequency_error": frequency_error(problem, model, test),
        "energy_drift": energy_drift(model, 20 if quick else 1000),
        "step_us": step_us(model),
        "c_step_us": c_step_us(folder, model),
        "sampling": sampling(problem, test),
    }
    if not quick:
        errors, spent, steps = tip_error(problem, model)
        full = 1e6 * spent / steps
        ratio = {name: full / results[name] for name in ("step_us", "c_step_us") if results[name]}
        results |= {"tip_error": errors, "full_step_us": full, "full_step_over": ratio}
    return results


if __name__ == "__main__":
    names = [word for word in sys.argv[1:] if not word.startswith("--")]
    print(json.dumps({name: main(name, "--quick" in sys.argv) for name in names}, indent=1))
