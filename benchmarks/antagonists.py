"""Factorisations of states of robots whose cables oppose each other; prints one JSON object.

Usage: antagonists.py [--quick] [--commands N] [--spaces SPACE ...] [ROBOT ...]

ROBOT: trunk-3 to trunk-8, of so many cables on a coarse mesh (tests/support/trunks.py), or a robot of the catalogue,
diamond or trunk, on coarse meshes. For each, commands of every space (`space` of sample.yaml) in the order in which
`cfem sample` takes them, each state predicted from those before it; then the first ten of them cold, from rest.
Printed: the share of their reach to which all cables are pulled at once, the mean and the largest number of
factorisations, and how the states that were not found ended."""

import argparse
import json
import os
import sys
from collections import Counter
from functools import partial
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import numpy as np

from cfem.core.spec import load_spec
from cfem.equilibrium.predictor import following, knot, predict
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import force, pulling_only
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import Equilibrium
from cfem.robot.build import build_robot
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.spec import SceneSpec
from cfem.sample.plan import actuation, borne_together, shards, skeleton, unit_rows
from cfem.sample.spec import SplitSpec

ROOT = Path(__file__).parents[1]
GENERATED = tuple(f"trunk-{cables}" for cables in range(3, 9))
CATALOGUE = {"diamond": "cells=500", "trunk": "cells=400"}
COLD, SKELETON = 10, 16
SPACES = ("displacement", "pulling")


def robot_of(name: str) -> Robot:
    if name not in CATALOGUE:
        sys.path.insert(0, str(ROOT / "tests"))
        from support.trunks import trunk

        return trunk(int(name.removeprefix("trunk-")))
    path = ROOT / "pipelines" / name / "scene.yaml"
    scene = load_spec(path, SceneSpec, [f"mesh.{CATALOGUE[name]}"])
    return build_robot(scene, scene_mesh(scene, path.parent)[0])


def measured(robot: Robot, spaces: list[str], commands: int) -> dict:
    problem = Problem(robot)
    compliance = solve(problem, force(np.zeros(robot.rows.n_a))).condensed.W_aa
    start = partial(predict, shape=problem.rotation_strain)
    together = borne_together(following(partial(solve, problem), start), robot.reach[:, 1], compliance)
    u = unit_rows(SplitSpec(rows=commands, method="random", seed=0), robot.rows.n_a)
    first = skeleton(u, SKELETON)
    order = np.concatenate([first, *shards(u, np.setdiff1d(np.arange(len(u)), first), 50)])
    table = {"unknowns": problem.pattern.n_dof, "together": together}
    for space in spaces:
        knots, walked, cold = [], [], []
        for row in u[order]:
            asked = actuation(space, row, robot.reach, compliance, together=together)
            asked = pulling_only(asked, robot.unilateral)
            walked.append(solve(problem, asked, start(knots, row, asked)))
            if walked[-1].converged:
                knots.append(knot(row, walked[-1]))
        for row in u[: min(COLD, commands)]:
            cold.append(solve(problem, actuation(space, row, robot.reach, compliance, together=together)))
        table[space] = {"in order": account(walked), "cold": account(cold)}
    return table


def account(states: list[Equilibrium]) -> dict:
    counts = np.array([one.factorizations for one in states])
    return {
        "states": len(states),
        "factorizations": {"mean": round(float(counts.mean()), 2), "largest": int(counts.max())},
        "slack": round(float(np.mean([one.slack.sum() for one in states])), 1),
        "failed": dict(Counter(one.status.name for one in states if not one.converged)),
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", nargs="*", metavar="ROBOT")
    parser.add_argument("--commands", type=int, default=50)
    parser.add_argument("--spaces", nargs="+", default=list(SPACES), choices=SPACES)
    parser.add_argument("--quick", action="store_true", help="one trunk and few commands, to see that it runs")
    options = parser.parse_args()
    robots, commands = options.robots or [*GENERATED, *CATALOGUE], options.commands
    if options.quick:
        robots, commands = ["trunk-3"], 3
    found = {}
    for name in robots:
        found[name] = measured(robot_of(name), options.spaces, commands)
        print(json.dumps({name: found[name]}), file=sys.stderr, flush=True)
    print(json.dumps(found, indent=1))
