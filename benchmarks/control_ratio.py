"""Times of control in two checkouts, side by side: how much longer does a search for a goal or a tick take now?

git worktree add /tmp/before COMMIT
python benchmarks/control_ratio.py models/soft-finger/spectral --before /tmp/before/src [--rounds 9]

Each round starts a process for each checkout, in turns, with one thread; a process takes the median over its
repetitions of the CPU time, and a case the median over the processes. Goals are those of the soft finger's demo, a
closed curve that the model can follow, and points beyond its reach. Prints one JSON object: us before and after, and
their ratio. It uses the public interface alone, which both checkouts have."""

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

SOURCES = Path(__file__).parents[1] / "src"
GOALS, REPETITIONS = 24, 15


def cpu_time(work: Callable[[np.ndarray], object], goals: np.ndarray) -> float:
    """Median CPU time (us) of `work` for a goal, over all goals of each repetition, after one that warms up."""
    times = []
    for _ in range(REPETITIONS + 1):
        begin = time.process_time()
        for goal in goals:
            work(goal)
        times.append(1e6 * (time.process_time() - begin) / len(goals))
    return float(np.median(times[1:]))


def measure(folder: Path) -> dict[str, float]:
    """CPU time (us) of each case with the package that is imported."""
    import cfem

    model = cfem.load_model(folder)
    angles = np.linspace(0.0, 2 * np.pi, GOALS, endpoint=False) + np.arange(model.rows.n_a)[:, None]
    forces = (0.5 + 0.3 * np.cos(angles.T)) * model.at_displacement(model.reach[:, 1]).lambda_a
    states = [model.at_force(lambda_a) for lambda_a in forces]
    reachable = model.rest_e + np.array([state.delta_e for state in states])
    beyond = model.rest_e + 1.5 * (reachable - model.rest_e)

    def ticks(goals: np.ndarray, **settings: object) -> float:
        return cpu_time(cfem.make_controller(model, gains=(0.0, 0.0), **settings).tick, goals)

    return {
        "query": cpu_time(lambda goal: model.at_displacement(states[0].delta_a), reachable),
        "inverse step": cpu_time(lambda goal: cfem.inverse_step(model, states[0], goal), reachable),
        "search": ticks(reachable, iterations=20),
        "search, out of reach": ticks(beyond, iterations=20),
        "find_actuation": cpu_time(lambda goal: cfem.find_actuation(model, goal), reachable),
        "tick, displacements": ticks(reachable),
        "tick, forces": ticks(reachable, command="force"),
        "tick, forces, previous step": ticks(reachable, command="force", observer="previous_step"),
    }


def compare(folder: Path, before: Path, rounds: int) -> dict[str, dict[str, float]]:
    """By case: us before and after, and their ratio."""
    times: dict[Path, list[dict[str, float]]] = {before: [], SOURCES: []}
    for _ in range(rounds):
        for sources, measured in times.items():
            one_thread = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
            environment = os.environ | one_thread | {"PYTHONPATH": str(sources.resolve())}
            command = [sys.executable, __file__, str(folder), "--measure"]
            result = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
            measured.append(json.loads(result.stdout))
    cases = {}
    for case in times[SOURCES][0]:
        old, new = (float(np.median([run[case] for run in times[sources]])) for sources in (before, SOURCES))
        cases[case] = {"before_us": round(old, 1), "after_us": round(new, 1), "ratio": round(new / old, 3)}
    return cases


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", type=Path)
    parser.add_argument("--before", type=Path, help="`src` of the other checkout")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--measure", action="store_true", help="this checkout alone, in this process")
    arguments = parser.parse_args()
    if not arguments.measure and arguments.before is None:
        parser.error("give --before, or --measure")
    if arguments.measure:
        print(json.dumps(measure(arguments.model)))
    else:
        print(json.dumps(compare(arguments.model, arguments.before, arguments.rounds), indent=1))
