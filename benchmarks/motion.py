"""What mass adds to the time of a sampled state, and how near the rows' frequencies are to the full model's.

    python benchmarks/motion.py SCENE [KEY=VALUE ...]

KEY=VALUE overrides the scene; all its materials get a density of 1070 kg/m^3 and a relaxation time of 3 ms. Prints
JSON: unknowns, rows, factorisations of a state without and with, ratio of CPU time with to without (medians of some
solves from a state nearby; third: with third order both times), and the relative errors of the first three natural
frequencies, actuators free and held, from the moments W, V, V2, V3 of the rows."""

import json
import sys
import time
from pathlib import Path

import numpy as np
from scipy.linalg import eigh

from cfem.core.spec import load_spec
from cfem.dynamics.modes import natural_modes
from cfem.dynamics.problem import MovingProblem
from cfem.equilibrium.actuation import force, pull
from cfem.equilibrium.solve import solve
from cfem.robot.build import build_robot
from cfem.robot.grading import scene_mesh
from cfem.robot.spec import SceneSpec

REPEATS = 5


def problem_of(path: Path, overrides: list[str]) -> MovingProblem:
    heavy = ["density=1070 kg/m^3", "viscosity.relaxation=3 ms"]
    others = len(load_spec(path, SceneSpec).materials)
    names = ["material", *(f"materials.{index}.material" for index in range(others))]
    scene = load_spec(path, SceneSpec, [f"{name}.{each}" for name in names for each in heavy] + overrides)
    return MovingProblem(build_robot(scene, scene_mesh(scene, path.parent)[0]))


def frequencies(found, held: bool, rows) -> np.ndarray:
    """Hz, of the Galerkin model on (Z, Y)."""
    W, own = found.condensed.W, found.inertia
    K, M = np.block([[W, own.V], [own.V, own.V2]]), np.block([[own.V, own.V2], [own.V2, own.V3]])
    size = 1 / np.sqrt(np.diag(K))
    K, M = K * np.outer(size, size), M * np.outer(size, size)
    basis = np.eye(len(K))
    if held:
        _, _, Vt = np.linalg.svd(np.hstack([W, own.V])[rows.a] * size)
        basis = Vt[rows.n_a :].T
    value, vector = np.linalg.eigh(basis.T @ K @ basis)
    kept = value > 1e-10 * value[-1]
    basis = basis @ vector[:, kept] / np.sqrt(value[kept])
    return 1 / np.sqrt(eigh(basis.T @ M @ basis)[0][::-1][:3]) / (2 * np.pi)


def main(path: Path, overrides: list[str]) -> dict:
    problem = problem_of(path, overrides)
    rows, reach = problem.robot.rows, problem.robot.reach[:, 1]
    shares = np.linspace(0.4, 0.6, rows.n_a)
    near = solve(problem, pull(shares, reach))

    def spent(**more) -> tuple[float, int]:
        times = []
        for _ in range(REPEATS):
            begin = time.process_time()
            found = solve(problem, pull(1.02 * shares, reach), near.state, **more)
            times.append(time.process_time() - begin)
        return float(np.median(times)), found.factorizations

    plain, moving = spent(), spent(mass=problem.mass)
    third = spent(third_order=True)[0], spent(third_order=True, mass=problem.mass)[0]
    found = solve(problem, pull(shares, reach), near.state, mass=problem.mass)
    errors = {}
    for name, held in (("free", False), ("held", True)):
        full = natural_modes(problem, found.state, 3, None if held else force(np.zeros(rows.n_a))).frequency
        errors[name] = np.abs(frequencies(found, held, rows)[: len(full)] / full - 1).tolist()
    return {
        "unknowns": problem.pattern.n_dof,
        "rows": rows.n,
        "factorizations": {"without": plain[1], "with": moving[1]},
        "ratio": moving[0] / plain[0],
        "ratio_third": third[1] / third[0],
        "frequency_error": errors,
    }


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), sys.argv[2:]), indent=1))
