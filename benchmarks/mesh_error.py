"""Whether the stated error of a mesh holds. Usage: mesh_error.py [NAME ...] [--commands N]. One JSON object a robot.

Each robot, coarse, is asked for random commands over its reach. The error is stated from the two states that travel
farthest of 16 others (as `cfem sample` takes them of its training states), by `cfem.robot.mesh.error.mesh_error`. The
truth at each command is the distance of the tip to that on a mesh of its own, made anew from the geometry with cells
less than half as large, which the statement has not seen; for rods, that of cells a third as large.

coverage: share of commands at which the truth is not larger than the upper bound; ratio: upper bound to truth, median
and quantiles; before: the same of what was stated before, one figure for all commands, from the difference to a mesh
of 2.5 times as many cells by order two."""

import argparse
import json
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
from cfem.robot.mesh.error import chosen, mesh_error
from cfem.robot.mesh.error_spec import MeshErrorSpec
from cfem.robot.mesh.finer import carried_over, dimensions
from cfem.robot.mesh.scene_mesh import scene_mesh
from cfem.robot.spec import SceneSpec
from cfem.sample.plan import actuation, borne_together, unit_rows
from cfem.sample.spec import SplitSpec

PIPELINES = Path(__file__).parents[1] / "pipelines"
ROBOTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "bar": ("bar", ()),
    "bar, linear": ("bar", ("mesh.element=tet4", "mesh.size=4 mm")),
    "bar, hexahedra": ("bar", ("mesh.element=hex8", "mesh.size=5 mm")),
    "pincer": ("pincer", ()),
    "soft finger": ("soft-finger", ("mesh.cells=500",)),
    "crawler": ("crawler", ("mesh.cells=500",)),
    "trunk": ("trunk", ("mesh.cells=300",)),
    "diamond": ("diamond", ("mesh.cells=300", "mesh.size=30 mm")),
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
        """Commands of states on another mesh, carried out on this one."""
        tetrahedra, found = of.mesh.cells.shape[1] in (4, 10), []
        for state in states:
            x = carried_over(of.mesh, state.state.x, self.mesh) if tetrahedra else None
            start = State(x, np.empty(0), state.state.lam) if tetrahedra else None
            command = displacement(state.delta_a) if self.robot.forces is None else force(state.lambda_a)
            found.append(solve(self.problem, command, start, wanted=Wanted(condense=False)))
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


def measured(name: str, commands: int) -> dict:
    robot, changes = ROBOTS[name]
    folder = PIPELINES / robot
    scene = load_spec(folder / "scene.yaml", SceneSpec, changes)
    begin = time.process_time()
    here = Commands(scene, scene_mesh(scene, folder)[0])
    n_a = here.robot.rows.n_a
    known = here.drawn(unit_rows(SplitSpec(rows=16, method="scrambled-halton", seed=1), n_a))
    asked = here.drawn(unit_rows(SplitSpec(rows=commands, method="random", seed=7), n_a))
    sampling, begin = time.process_time() - begin, time.process_time()
    farthest = [known[index] for index in chosen(np.array([each.delta_e for each in known]), 0.0 * known[0].delta_e, 2)]
    found = mesh_error(scene, here.mesh, here.robot, folder, farthest, MeshErrorSpec())
    seconds, error = time.process_time() - begin, mesh_error_of(found)
    result = {"robot": name, "cells": len(here.mesh.cells), "states": len(known), "seconds_states": round(sampling, 1)}
    if error is None:
        return {**result, **found}
    by = 3 if dimensions(scene) == 1 else 8
    there = Commands(scene, anew(scene, folder, by * len(here.mesh.cells)))
    coarser = Commands(scene, anew(scene, folder, 2.5 * len(here.mesh.cells)))
    smaller = (len(coarser.mesh.cells) / len(here.mesh.cells)) ** (1 / dimensions(scene))
    factor = smaller**2 / (smaller**2 - 1)
    before = factor * max(map(np.linalg.norm, moved(farthest, coarser.again(farthest, here))))
    finer = there.again(asked, here)
    kept = [index for index, each in enumerate(finer) if each.converged]
    truth = np.linalg.norm(moved([asked[index] for index in kept], [finer[index] for index in kept]), axis=1)
    travel = np.linalg.norm(places([asked[index] for index in kept]), axis=1)
    low, high = np.array([error.tip.bounds(each) for each in travel]).T
    return {
        **result,
        "finer_cells": error.finer_cells,
        "truth_cells": len(there.mesh.cells),
        "factorizations": found["factorizations"],
        "seconds": round(seconds, 1),
        "commands": len(kept),
        "not_converged": len(finer) - len(kept),
        "truth_percent": figures(100 * truth / travel),
        "stated_percent": [round(100 * float(each), 3) for each in (*error.tip.rest, *error.tip.far)],
        "coverage": float(np.mean(truth <= high)),
        "below_low": float(np.mean(truth < low)),
        "ratio": figures(high / truth),
        "before": {"coverage": float(np.mean(truth <= before)), "ratio": figures(before / truth)},
    }


def places(states: Sequence[Equilibrium]) -> np.ndarray:
    """Displacements of the effectors, orientations left out."""
    names = states[0].condensed.rows.effectors
    return np.array([each.delta_e for each in states])[:, [not name.split(".")[-1].startswith("r") for name in names]]


def moved(states: Sequence[Equilibrium], others: Sequence[Equilibrium]) -> np.ndarray:
    where = [not name.split(".")[-1].startswith("r") for name in states[0].condensed.rows.effectors]
    return np.array([b.delta_e - a.delta_e for a, b in zip(states, others, strict=True)])[:, where]


def figures(values: np.ndarray) -> list[float]:
    """5 %, median, 95 %."""
    return [float(f"{each:.3g}") for each in np.quantile(values, (0.05, 0.5, 0.95))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(ROBOTS)}; all by default")
    parser.add_argument("--commands", type=int, default=20)
    asked = parser.parse_args()
    for name in asked.names or ROBOTS:
        print(json.dumps(measured(name, asked.commands)), flush=True)


if __name__ == "__main__":
    main()
