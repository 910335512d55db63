"""Whether the stated error of a mesh holds. Usage: mesh_error.py [NAME ...] [--commands N] [--times M].

One JSON object a robot.

Each robot, coarse, is asked for random commands over its reach. The error is stated from the two states that travel
farthest of 16 others (as `cfem sample` takes them of its training states), by `cfem.robot.mesh.error.mesh_error`. The
statement is compared with a reference: another mesh of the same geometry, with M times as many cells (8: half as
large; rods: a third as large). The true error is the distance between the two tips. The reference has an error of its
own. Where that is as large as the lower end of the statement, take M = 27.

coverage: share of commands at which the truth is not larger than the upper bound; ratio: upper bound to truth, median
and quantiles. Every command and the tip on both meshes go to data/mesh-error/NAME.json. `--again FILE ...` judges such
files instead of solving, as docs/figures/mesh-error.json, a list of them."""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cfem.condensed.mesh_error import mesh_error_of
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Equilibrium, State
from cfem.mechanics.mesh import Mesh
from cfem.robot.build import build_robot
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.mesh.error import chosen, mesh_error
from cfem.robot.mesh.error_spec import MeshErrorSpec
from cfem.robot.mesh.finer import carried_over, dimensions
from cfem.robot.spec import SceneSpec
from cfem.sample.plan import actuation, borne_together, unit_rows
from cfem.sample.spec import SplitSpec

ROOT = Path(__file__).parents[1]
PIPELINES, RAW = ROOT / "pipelines", ROOT / "data" / "mesh-error"
ROBOTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "bar": ("bar", ()),
    "bar, linear": ("bar", ("mesh.element=tet4", "mesh.size=4 mm")),
    "bar, hexahedra": ("bar", ("mesh.element=hex8", "mesh.size=5 mm")),
    "pincer": ("pincer", ()),
    "soft finger": ("soft-finger", ("mesh.cells=500",)),
    "crawler": ("crawler", ("mesh.cells=500",)),
    "trunk": ("trunk", ("mesh.cells=300",)),
    "diamond": ("diamond", ("mesh.cells=300", "mesh.size=30 mm")),
    "mckibben": ("mckibben", ("mesh.size=8 mm",)),
    "three-chamber gripper": ("three-chamber-gripper", ()),
    "fin-ray": ("fin-ray", ("mesh.size=20 mm",)),
    "tentacle": ("measured-tentacle", ()),
    "stiff-flop": ("stiff-flop", ()),
    "stiff-flop module": ("stiff-flop-module", ()),
}
TRIES, NEARLY = 5, 0.9


class Commands:
    """The robot on one mesh."""

    def __init__(self, scene: SceneSpec, mesh: Mesh):
        self.mesh, self.robot = mesh, build_robot(scene, mesh)
        self.problem = Problem(self.robot)

    def rest(self) -> Equilibrium:
        return solve(self.problem, force(np.zeros(self.robot.rows.n_a)))

    def drawn(self, rows: np.ndarray) -> list[Equilibrium]:
        """The converged states of rows of the unit cube."""
        robot, compliance = self.robot, self.rest().condensed.W_aa
        space, together = ("pulling", 1.0) if robot.forces is None else ("force", 1.0)
        if robot.forces is None:
            together = borne_together(lambda pull: solve(self.problem, pull), robot.reach[:, 1], compliance)
        found = [
            solve(self.problem, actuation(space, u, robot.reach, compliance, robot.forces, together)) for u in rows
        ]
        return [state for state in found if state.converged]

    def again(self, states: Sequence[Equilibrium], of: "Commands") -> list[Equilibrium]:
        """Commands of states on another mesh, carried out on this one. Each starts from the state on the other mesh,
        and is off it as the state of the nearest command before."""
        tetrahedra, found, known = of.mesh.cells.shape[1] in (4, 10), [], []
        for state in states:
            start = None
            if tetrahedra:
                carried = carried_over(of.mesh, state.state.x, self.mesh)
                nearest = min(known, key=lambda each: np.abs(each[0] - state.delta_a).max(), default=(None, 0.0))
                start = State(carried + nearest[1], np.empty(0), state.state.lam)
            command = displacement(state.delta_a) if self.robot.forces is None else force(state.lambda_a)
            solved = solve(self.problem, command, start, wanted=Wanted(condense=False))
            found.append(solved)
            if tetrahedra and solved.converged:
                known.append((state.delta_a, solved.state.x - carried))
            print(f"finer mesh: {solved.status.value}, {solved.factorizations} factorisations", file=sys.stderr)
        return found


def anew(scene: SceneSpec, folder: Path, cells: float) -> Mesh:
    """A mesh of its own of about so many cells, or more."""
    size, graded = scene.mesh.size, scene.mesh.cells
    for _ in range(TRIES):
        meshing = scene.mesh.model_copy(update={"size": size, "cells": graded})
        mesh, *_ = scene_mesh(scene.model_copy(update={"mesh": meshing}), folder)
        if len(mesh.cells) >= NEARLY * cells:
            return mesh
        ratio = cells / len(mesh.cells)
        size *= ratio ** (-1 / dimensions(scene))
        graded = graded and round(graded * ratio)
    return mesh


def measured(name: str, commands: int, times: int) -> dict:
    """The statement, and every command with the tip's way on both meshes."""
    robot, changes = ROBOTS[name]
    folder = PIPELINES / robot
    scene = load_spec(folder / "scene.yaml", SceneSpec, changes)
    here = Commands(scene, scene_mesh(scene, folder)[0])
    n_a = here.robot.rows.n_a
    known = here.drawn(unit_rows(SplitSpec(rows=16, method="scrambled-halton", seed=1), n_a))
    asked = here.drawn(unit_rows(SplitSpec(rows=commands, method="random", seed=7), n_a))
    farthest = [known[index] for index in chosen(np.array([each.delta_e for each in known]), 0.0 * known[0].delta_e, 2)]
    begin = time.process_time()
    found = mesh_error(scene, here.mesh, here.robot, folder, farthest, MeshErrorSpec())
    result = {"robot": name, "stated": found, "seconds": round(time.process_time() - begin, 1)}
    if mesh_error_of(found) is None:
        return result
    by = 3 if dimensions(scene) == 1 else times
    there = Commands(scene, anew(scene, folder, by * len(here.mesh.cells)))
    finer = there.again(asked, here)
    kept = [index for index, each in enumerate(finer) if each.converged]
    pairs = [[each[index] for index in kept] for each in (asked, finer)]
    names = here.robot.rows.effectors
    return {
        **result,
        "truth_cells": len(there.mesh.cells),
        "not_converged": len(finer) - len(kept),
        "commands": [(each.lambda_a if here.robot.forces is not None else each.delta_a).tolist() for each in pairs[0]],
        "tip": places(pairs[0], names),
        "finer_tip": places(pairs[1], names),
    }


def judged(result: dict) -> dict:
    """How well the statement holds at the commands."""
    error = mesh_error_of(result["stated"])
    if error is None:
        return result
    tip, finer = np.array(result["tip"]), np.array(result["finer_tip"])
    travel, truth = np.linalg.norm(tip, axis=1), np.linalg.norm(finer - tip, axis=1)
    low, high = np.array([error.tip.bounds(each) for each in travel]).T
    return {
        "robot": result["robot"],
        "cells": error.cells,
        "finer_cells": error.finer_cells,
        "truth_cells": result["truth_cells"],
        "factorizations": result["stated"]["factorizations"],
        "seconds": result["seconds"],
        "commands": len(truth),
        "not_converged": result["not_converged"],
        "truth_percent": figures(100 * truth / travel),
        "stated_percent": [round(100 * float(each), 3) for each in (*error.tip.rest, *error.tip.far)],
        "coverage": float(np.mean(truth <= high)),
        "below_low": float(np.mean(truth < low)),
        "ratio": figures(high / truth),
    }


def places(states: Sequence[Equilibrium], effectors: Sequence[str]) -> list[list[float]]:
    """Displacements of the effectors, orientations left out."""
    kept = [not name.split(".")[-1].startswith("r") for name in effectors]
    return [each.delta_e[kept].tolist() for each in states]


def figures(values: np.ndarray) -> list[float]:
    """5 %, median, 95 %."""
    return [float(f"{each:.3g}") for each in np.quantile(values, (0.05, 0.5, 0.95))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(ROBOTS)}; all by default")
    parser.add_argument("--commands", type=int, default=20)
    parser.add_argument("--again", nargs="+", type=Path, default=[], help="files of results")
    parser.add_argument("--times", type=int, default=8, help="cells of the truth over those of the mesh")
    asked = parser.parse_args()
    for path in asked.again:
        known = json.loads(path.read_text())
        for result in known if isinstance(known, list) else [known]:
            print(json.dumps(judged(result)))
    if asked.again:
        return
    RAW.mkdir(parents=True, exist_ok=True)
    for name in asked.names or ROBOTS:
        result = measured(name, asked.commands, asked.times)
        (RAW / f"{name}.json").write_text(json.dumps(result) + "\n")
        print(json.dumps(judged(result)), flush=True)


if __name__ == "__main__":
    main()
