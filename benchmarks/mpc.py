"""What a tick of predictive control takes, part by part, and what solves its quadratic programs fastest.

    python benchmarks/mpc.py MODEL [--horizon 20] [--rate 100] [--moves 8]

MODEL: a folder of `cfem train` that has learned to move. The condensed model, 10 % stiffer and 20 % more viscous, with
noise of 0.1 mm and a delay of a tick, stands for the robot; forces swing between 0.3 and 0.7 of the largest that the
model knows. Prints JSON: milliseconds of CPU time of a tick (median, 99th percentile) and of its parts (medians), and
for each solver of the same programs, once with open bounds and once where bounds of force and rate hold: milliseconds
(median), constraints that hold (mean), and the largest difference from the exact solution as a share of the largest
command. Solvers other than cfem's and OSQP are taken where installed: pip install daqp piqp clarabel.

Where there is a C compiler the same ticks run in C (-O2) too: "c", milliseconds, and c_apart: the largest difference of
a command as a share of the largest; c_bytes: of the controller's state. Instructions of an emulated
Cortex-M7: `make emulate` in the folder of `cfem export` (docs/embedded.md)."""

import argparse
import json
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import scipy.sparse as sp

import cfem.control.motion.horizon as horizon
import cfem.export.firmware.mpc as c_mpc
from cfem.condensed.model import under_force
from cfem.control.motion.horizon import Bounds, HorizonCost
from cfem.control.motion.mpc import Mpc, Plan
from cfem.control.motion.observer import Doubt
from cfem.control.search.qp import QpSolution, solve_qp
from cfem.export.compiled.build import compiler
from cfem.export.compiled.mpc import CompiledMpc
from cfem.export.firmware.folder import write_c
from cfem.export.firmware.motion import write_c_motion
from cfem.export.spec import CSpec
from cfem.motion.altered import Altered
from cfem.motion.clocked import Clocked
from cfem.motion.load import load_motion
from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant
from cfem.plant.moving_plant import MovingModelPlant
from cfem.predict.load import read_arrays, read_model

TICKS = 150


def spent(watch: dict[str, list[float]], name: str, function):
    """The function, its CPU seconds noted under a name."""

    def timed(*args, **options):
        begin = time.process_time()
        out = function(*args, **options)
        watch[name].append(time.process_time() - begin)
        return out

    return timed


def in_c(
    place: Path,
    folder: Path,
    bounds: Bounds,
    cost: HorizonCost,
    about: np.ndarray,
    ticks: int,
    rate: float,
    moves: int | None,
):
    """The controller in C with these numbers; it begins at about (n_a,) mm."""
    meta, arrays = read_model(folder)
    moving = read_arrays(folder, "motion.npz")
    names = ["mm" if unit == "mm" else "mm^3" for unit, _ in load_motion(folder).static.actuator_units]
    start = {"start": {names[0]: about.tolist()}}
    spec = CSpec(
        controller={"command": "force", **start}, mpc={"ticks": f"{rate} Hz", "horizon": ticks, "moves": moves}
    )
    sizes, numbers, constants = c_mpc.mpc_constants(spec, meta, arrays, moving)
    constants |= {"smooth": cost.smooth, "effort": cost.effort, "command": bounds.command, "rate": bounds.rate}
    constants["course"] = np.ascontiguousarray(bounds.course)
    made, c_mpc.mpc_constants = c_mpc.mpc_constants, lambda *_: (sizes, numbers, constants)
    write_c(place, meta, arrays, spec, about[None])
    write_c_motion(place, meta, arrays, moving)
    c_mpc.write_c_mpc(place, spec, meta, arrays, moving)
    c_mpc.mpc_constants = made
    controller = CompiledMpc(place)
    controller.reset(about)
    return controller


def fly(
    model, ticks: int, rate: float, moves: int | None, tight: bool, folder: Path
) -> tuple[dict[str, list[float]], list[tuple], dict[str, float]]:
    """CPU seconds of the parts of TICKS ticks, their programs, and what the same ticks are in C."""
    static, largest = model.static, model.static.domain.lambda_a[1]
    t = np.arange(TICKS + ticks) / rate
    share = 0.5 + 0.1 * (np.sin(2 * np.pi * 4 * t)[:, None] + np.sin(2 * np.pi * 2 * t)[:, None] * [1, -1])
    share = share if len(largest) == 2 else np.repeat(share[:, :1], len(largest), axis=1)
    near = under_force(static, 0.5 * largest, static.at_displacement(static.domain.nearest(0.5 * largest, "force")))
    start, goals = near, []
    for one in share:
        near = under_force(static, one * largest, near)
        goals.append(model.rest_e + near.delta_e)
    size = static.length / largest
    cost = HorizonCost(np.ones(len(model.rest_e)), np.sqrt(1e-2) * size, (1e-3 if len(largest) > 3 else 1e-5) * size)
    high, speed = (0.58, 0.02) if tight else (1.0, np.inf)
    bounds = Bounds(np.stack([0 * largest, high * largest], 1), speed * largest, static.domain.delta_a.T)
    mpc = Mpc(
        Clocked(model, "force", 1 / rate, start.delta_a),
        Plan(ticks, cost, bounds, moves=moves),
        model.rest_e,
        start,
        Doubt(),
    )
    body = MovingModelPlant(Altered(model, 1.1, 1.2), 1 / rate, 4)
    body.settle(start.lambda_a, "force")
    plant = ImperfectPlant(body, Imperfection(0.1, 1.0, 1), 0)
    watch = {name: [] for name in ("observer", "linearisation", "program", "tick", "c")}
    programs: list[tuple] = []

    def noted(*args) -> QpSolution:
        programs.append(args[:6])
        begin = time.process_time()
        out = solve_qp(*args)
        watch["program"].append(time.process_time() - begin)
        return out

    horizon.solve_qp = noted
    linear = mpc._clocked.linear
    mpc._present = spent(watch, "observer", mpc._present)
    mpc._clocked.linear = lambda guess, material, every=1: (
        spent(watch, "linearisation", linear)(guess, material, every) if every > 1 else linear(guess, material, every)
    )
    tick, measured, c = spent(watch, "tick", mpc.tick), None, {}
    with tempfile.TemporaryDirectory() as place:
        fast = in_c(Path(place), folder, bounds, cost, start.delta_a, ticks, rate, moves) if compiler() else None
        c_tick, apart = None if fast is None else spent(watch, "c", fast.step), 0.0
        for k in range(TICKS):
            sample = () if measured is None else (measured.x_e, measured.t)
            u = tick(goals[k], measured, goals[k:]).u
            if c_tick:
                apart = max(apart, float(np.abs(c_tick(goals[k : k + ticks], *sample).u - u).max() / largest.max()))
            measured = plant.step(u, "force")
        if fast:
            c = {"c_apart": apart, "c_bytes": fast.bytes}
    horizon.solve_qp = solve_qp
    return watch, programs, c


def by_daqp(H, f, A, low, high, box):
    import daqp

    low, high = np.concatenate([box[:, 0], low]), np.concatenate([box[:, 1], high])
    return daqp.solve(H, f, np.ascontiguousarray(A), high, low)[0]


def by_piqp(H, f, A, low, high, box):
    import piqp

    solver = piqp.DenseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = 1e-9
    solver.setup(H, f, np.zeros((0, len(f))), np.zeros(0), A, low, high, box[:, 0], box[:, 1])
    solver.solve()
    return solver.result.x


def by_clarabel(H, f, A, low, high, box):
    import clarabel

    G = np.vstack([A, np.eye(len(f))])
    low, high = np.concatenate([low, box[:, 0]]), np.concatenate([high, box[:, 1]])
    above, below = np.isfinite(high), np.isfinite(low)
    K, h = np.vstack([G[above], -G[below]]), np.concatenate([high[above], -low[below]])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.NonnegativeConeT(len(h))]
    solver = clarabel.DefaultSolver(sp.csc_matrix(np.triu(H)), f, sp.csc_matrix(K), h, cones, settings)
    return np.array(solver.solve().x)


def solvers() -> dict[str, object]:
    """name -> (H, f, A, low, high, box) -> x, of those that are installed."""
    known = {"daqp": by_daqp, "piqp": by_piqp, "clarabel": by_clarabel}
    return {name: solve for name, solve in known.items() if find_spec(name)}


def compared(programs: list[tuple]) -> dict[str, dict[str, float]]:
    exact = [solve_qp(*one) for one in programs]
    holds = float(np.mean([(np.abs(one.y) > 0).sum() + (np.abs(one.z) > 0).sum() for one in exact]))
    size = max(float(np.abs(one.x).max()) for one in exact)
    ways = {
        "active_set": lambda M, d, A, low, high, box: solve_qp(M, d, A, low, high, box).x,
        "osqp": lambda M, d, A, low, high, box: solve_qp(M, d, A, low, high, box, "osqp").x,
    }
    for name, way in solvers().items():
        ways[name] = lambda M, d, A, low, high, box, way=way: way(M.T @ M, -M.T @ d, A, low, high, box)
    table = {}
    for name, way in ways.items():
        watch: dict[str, list[float]] = {name: []}
        answers = [spent(watch, name, way)(*one) for one in programs]
        off = max(float(np.abs(x - one.x).max()) for x, one in zip(answers, exact, strict=True)) / size
        table[name] = {"ms": 1e3 * float(np.median(watch[name])), "hold": holds, "off": off}
    return table


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("model", type=Path)
    parser.add_argument("--horizon", type=int, default=20)
    parser.add_argument("--moves", type=int)
    parser.add_argument("--rate", type=float, default=100.0)
    options = parser.parse_args()
    model = load_motion(options.model)
    out = {"n_a": model.n_a, "n_q": model.n_q, "horizon": options.horizon}
    for name, tight in (("open", False), ("bounded", True)):
        watch, programs, c = fly(model, options.horizon, options.rate, options.moves, tight, options.model)
        ms = {part: 1e3 * float(np.median(values)) for part, values in watch.items() if values}
        ms |= {f"{part}_p99": 1e3 * float(np.percentile(watch[part], 99)) for part in ("tick", "c") if watch[part]}
        out[name] = {"ms": ms, **c}
        out[name]["solvers"] = compared(programs)
    print(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
