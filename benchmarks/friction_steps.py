"""How far the answers of a control run with friction depend on the length of its steps, and on the parts in which
friction is followed along each. Usage: friction_steps.py CONTROL RUN [--set KEY=VALUE ...]

CONTROL: a control.yaml with obstacles and `contact.friction`; RUN: the folder of its results. The learned robot carries
out the run's own commands again. One JSON object a row: steps, as a share of the longest one of a run; parts; the
largest change of the rows against steps 256 times shorter, in mm and N; rounds; CPU seconds."""

import argparse
import json
import time
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from cfem.control.spec import ControlSpec
from cfem.control.task.prepared import prepare
from cfem.core.spec import load_spec

SHORTEST = 256
TRIALS = (1, 1), (1, 4), (1, 16), (1, 64), (4, 1), (4, 16), (16, 1), (64, 1)  # times shorter, parts


def main() -> None:
    """Prints the rows."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("control", type=Path)
    parser.add_argument("run", type=Path)
    parser.add_argument("--set", action="append", default=[], dest="changes")
    arguments = parser.parse_args()
    spec, base = load_spec(arguments.control, ControlSpec, arguments.changes), arguments.control.parent
    prepared = prepare(spec, base, base / spec.mesh, {name: base / path for name, path in spec.models.items()})
    name, model = next(iter(prepared.predictors.items()))
    table = pq.read_table(arguments.run / "trajectories.parquet").to_pylist()
    rows = [row for row in table if row["controller"] == name]

    def walked(shorter: int, parts: int) -> tuple[np.ndarray, int, float]:
        """Rows (m, n_e) after each command, rounds of the last steps, and CPU seconds."""
        answers, rounds, begin = [], 0, time.process_time()
        for _, trajectory in groupby(rows, key=lambda row: row["trajectory"]):
            robot = replace(model, step=model.step / shorter, parts=parts).standing(0.0)
            commands = [np.array(row["delta_a"]) for row in trajectory]
            for delta_a, share in zip(commands, np.linspace(0.0, 1.0, len(commands)), strict=True):
                robot.pass_to(share)
                robot.settle(delta_a)
                rounds += robot.before.iterations if robot.before else 0
                answers.append(robot.at_displacement(delta_a).delta_e)
        return np.array(answers), rounds, time.process_time() - begin

    truth, _, _ = walked(SHORTEST, 1)
    for shorter, parts in TRIALS:
        answers, rounds, seconds = walked(shorter, parts)
        missed = np.abs(answers - truth).max(axis=0)
        off = dict(zip(model.rows.effectors, missed.round(6).tolist(), strict=True))
        row = {"steps": f"1/{shorter}", "parts": parts, "off": off, "rounds": rounds, "cpu_s": round(seconds, 2)}
        print(json.dumps(row))


if __name__ == "__main__":
    main()
