"""The front of `cfem optimize-design` against NSGA-III's (pymoo) with ten times as many evaluations, on the same model.

    make finger-shapes && pip install pymoo && python benchmarks/front_nsga.py [pipelines/finger-shapes/design.yaml]

Prints JSON: designs of both fronts, evaluations of the model, CPU seconds, hypervolumes in the box of the scattered
designs' objectives, and how many designs of either front one of the other beats. pymoo (Apache-2.0; J. Blank and K.
Deb, IEEE Access 8, 2020) is needed here alone."""

import argparse
import json
import time
from pathlib import Path

import numpy as np

from cfem.core.spec import load_spec
from cfem.design.formulation import problem_of
from cfem.design.optimisers.front import best_of_each, hypervolume, non_dominated, pareto_front
from cfem.design.optimisers.search import evaluate_scattered
from cfem.design.spec import DesignSpec
from cfem.parametric.load import learned

ROOT = Path(__file__).resolve().parents[1]


def evolved(problem, of: list[int], grid, points: int, evaluations: int, seed: int):
    """(m, k) objectives of NSGA-III's last generation, between 0 and 1 on the grid."""
    from pymoo.algorithms.moo.nsga3 import NSGA3
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize
    from pymoo.util.ref_dirs import get_reference_directions

    class Batch(Problem):
        def __init__(self):
            super().__init__(n_var=len(problem.free), n_obj=len(of), n_ieq_constr=len(problem.constraints), xl=0, xu=1)

        def _evaluate(self, x, out, *_, **__):
            scores = problem(x)
            out["F"], out["G"] = grid.hat(scores.objectives)[:, of], -scores.constraints

    directions = get_reference_directions("energy", len(of), points, seed=seed)
    algorithm = NSGA3(ref_dirs=directions, pop_size=points)
    return minimize(Batch(), algorithm, ("n_eval", evaluations), seed=seed).F


def beaten(one: np.ndarray, other: np.ndarray) -> int:
    """How many rows of `one` some row of `other` beats."""
    return sum(bool(((other <= row + 1e-9).all(axis=1) & (other < row - 1e-9).any(axis=1)).any()) for row in one)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spec", type=Path, nargs="?", default=ROOT / "pipelines/finger-shapes/design.yaml")
    parser.add_argument("--seeds", type=int, default=3)
    asked = parser.parse_args()
    spec, base = load_spec(asked.spec, DesignSpec), asked.spec.parent
    family = learned(base / spec.model, base / spec.scene)
    problem, _ = problem_of(spec, family, base / spec.scene, base)
    begin = time.process_time()
    grid = evaluate_scattered(problem, spec.grid.designs)
    front = pareto_front(problem, grid, spec.front.of, spec.front.points, best_of_each(problem, grid, spec.starts))
    seconds, evaluations = time.process_time() - begin, problem.evaluations
    of = list(front.indices)
    mine = grid.hat(np.array([one.objectives for one in front.designs]))[:, of]
    found = {
        "designs": len(mine),
        "evaluations": evaluations,
        "seconds": seconds,
        "hypervolume": hypervolume(mine),
        "scattered_hypervolume": front.grid_volume,
        "nsga3": [],
    }
    for seed in range(asked.seeds):
        begin = time.process_time()
        other = np.atleast_2d(evolved(problem, of, grid, len(mine), 10 * evaluations, seed))
        other = other[non_dominated(other)]
        found["nsga3"].append(
            {
                "seed": seed,
                "designs": len(other),
                "evaluations": 10 * evaluations,
                "seconds": time.process_time() - begin,
                "hypervolume": hypervolume(other),
                "beaten_by_ours": beaten(other, mine),
                "ours_beaten": beaten(mine, other),
            }
        )
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
