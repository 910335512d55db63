"""What docs/measured.md states of loading and unloading with friction.

python benchmarks/hysteresis.py SCENE [--cable 0] [--largest 6] [--friction 0.2] [--steps 4] [--set KEY=VALUE ...]

    One cable of the scene, with this coefficient of friction in its guides, is pulled to the largest tension (N), let
    out, and pulled again, in equal steps. At each command: place of the last effector (mm), tension at the cable's far
    end by that at the drive (least and most: if it slipped everywhere one way), and the tip's distance from where the
    first loading had it at that tension. worked_mJ: by the drive around the closed loop, heat in the guides."""

import argparse
import json
import tempfile
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from cfem.core.spec import load_spec
from cfem.equilibrium.friction.sticking import Follower
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import Status
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec


def loop(robot: Robot, cable: int, largest: float, steps: int) -> dict:
    follower, (begin, commands) = Follower(Problem(robot)), (time.process_time(), _commands(largest, steps))
    _, now = follower.rest()
    rows, first, drive = [], {}, []
    for tension in commands:
        forces = tension * (np.arange(len(robot.actuators)) == cable)
        found, now = follower.go(forces, now)
        if found.status is not Status.CONVERGED:
            raise SystemExit(f"no equilibrium at {tension:g} N: {found.status.value}")
        tip = (found.delta_e + robot.rest_e)[-len(robot.effectors[-1].rest) :][:3]
        slipping = robot.actuators[cable].friction * robot.actuators[cable].turned(found.state.x).sum()
        rows.append({"tension_N": round(float(tension), 3), "tip_mm": [round(float(x), 2) for x in tip]})
        rows[-1] |= {"end": round(float(now.tension[-1] / tension), 3), "least": round(float(np.exp(-slipping)), 3)}
        rows[-1]["most"] = round(float(np.exp(slipping)), 3)
        rows[-1]["apart_mm"] = round(float(np.linalg.norm(tip - first.setdefault(round(tension, 9), tip))), 2)
        drive.append(float(now.delta.sum()))
    closed = [i for i, tension in enumerate(commands) if i >= steps - 1]
    worked = sum((commands[a] + commands[b]) / 2 * (drive[b] - drive[a]) for a, b in pairwise(closed))
    return {
        "commands": rows,
        "widest_mm": max(row["apart_mm"] for row in rows),
        "worked_mJ": round(worked, 3),
        "cpu_seconds_a_command": round((time.process_time() - begin) / len(commands), 3),
    }


def _commands(largest: float, steps: int) -> list[float]:
    up = [largest * (i + 1) / steps for i in range(steps)]
    return [*up, *up[-2::-1], *up[1:]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--cable", type=int, default=0)
    parser.add_argument("--largest", type=float, default=6.0)
    parser.add_argument("--friction", type=float, default=0.2)
    parser.add_argument("--steps", type=int, default=4)
    parser.add_argument("--set", action="append", default=[])
    given = parser.parse_args()
    scene = load_spec(given.scene, SceneSpec, given.set)
    with tempfile.TemporaryDirectory() as folder:
        robot = build_robot(scene, make_mesh(scene, Path(folder))[0])
    actuators = list(robot.actuators)
    actuators[given.cable] = replace(actuators[given.cable], friction=given.friction)
    print(
        json.dumps(loop(replace(robot, actuators=tuple(actuators)), given.cable, given.largest, given.steps), indent=2)
    )


if __name__ == "__main__":
    main()
