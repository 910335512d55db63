"""A controller as a process of its own: loads an exported model, runs predict + QP, prints time and memory.

python benchmarks/control_process.py models/soft-finger/spectral-export [--steps 20000] [--runtime arrays|onnx]
[--rate HZ] [--ticks]

A step is what a control loop does each tick: the condensed model where the actuators stand, then the inverse step
towards the next goal; with --ticks, one of the loop: forces, and an observer that tells where they lead. Prints
one JSON object; exits 1 where a package that control does not need was imported."""

import argparse
import json
import resource
import sys
import time
from pathlib import Path

import numpy as np

from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.tick import Belief, Pilot, drive
from cfem.control.search.inverse import Aim, Limits, inverse_step
from cfem.predict.load import load_model

NOT_NEEDED = ("torch", "numba", "pyarrow", "pandas", "scipy", "matplotlib", "gmsh")


def run(folder: Path, runtime: str, steps: int, rate: float | None = None, ticks: bool = False) -> dict:
    """Times in us, peak memory in MiB; rate: steps a second, with sleep between them, which leaves caches cold; ticks:
    of the loop, whose `drive` keeps no account of the program's residual."""
    model = load_model(folder, runtime)
    limits = Limits.of(model.reach, np.ones(model.rows.n_a, dtype=bool))
    ridge, weights = ridge_of(1e-10, model.reach, model.length), np.ones(model.rows.n_e)
    middle = model.reach @ [0.7, 0.3]
    goals = [model.at_displacement(middle * (1 + 0.3 * np.sin(angle))).delta_e for angle in np.linspace(0, 6.28, 200)]
    delta_a, times, worst = middle, np.empty(steps), 0.0
    damping = ridge_of(1e-4, model.reach, model.length)
    pilot = Pilot(model, "force", "equilibrium", limits, weights, ridge, damping=damping)
    belief, missed = Belief.at(pilot, middle), 0.0
    start = time.perf_counter()
    for tick in range(steps):
        aim = Aim(goals[tick % len(goals)], weights, ridge)
        if rate:
            time.sleep(max(0.0, start + tick / rate - time.perf_counter()))
        begin = time.perf_counter()
        if ticks:
            belief = drive(pilot, belief, aim.goal)
            times[tick] = time.perf_counter() - begin
            missed = max(missed, aim.distance(belief.iterate.condensed.delta_e)) if tick > 100 else missed
            continue
        step = inverse_step(model.at_displacement(delta_a), aim, limits)
        times[tick] = time.perf_counter() - begin
        delta_a, worst = step.delta_a, max(worst, step.qp.kkt.missed)
    return {
        "steps": steps,
        "median_us": round(1e6 * float(np.median(times)), 1),
        "p99_us": round(1e6 * float(np.percentile(times, 99)), 1),
        "p99_9_us": round(1e6 * float(np.percentile(times, 99.9)), 1),
        **({"missed_mm": missed} if ticks else {"qp_missed_mm": worst}),
        "peak_rss_mib": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, 1),
        "not_needed_but_imported": [name for name in NOT_NEEDED if name in sys.modules],
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", type=Path)
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--runtime", choices=["arrays", "onnx"], default="arrays")
    parser.add_argument("--rate", type=float, help="steps a second; as fast as they go unless given")
    parser.add_argument("--ticks", action="store_true", help="of the loop, observer included")
    arguments = parser.parse_args()
    result = run(arguments.model, arguments.runtime, arguments.steps, arguments.rate, arguments.ticks)
    print(json.dumps(result))
    sys.exit(1 if result["not_needed_but_imported"] else 0)
