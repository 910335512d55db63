"""How exact the mechanics is, on a real scene: prints one JSON object. Usage: verification.py SCENE_YAML
[KEY=VALUE ...]

Each figure is judged by something that it was not derived from: finite differences of whole equilibrium solves."""

import json
import sys
from pathlib import Path

import numpy as np

from cfem.core.spec import load_spec
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.assembly import symmetric_product
from cfem.robot.build import build_robot
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.spec import SceneSpec

EXACT = NewtonSettings(tolerance=1e-12)


def tangent_error(problem: Problem, base) -> float:
    """Relative error of A v against central differences of the residual along a random v."""
    v = np.random.default_rng(0).standard_normal(problem.pattern.n_dof)
    lambda_a = base.lambda_a
    at = problem.evaluate(base.state.x, np.empty(0))
    data, _ = problem.stiffness(at, lambda_a)
    product = symmetric_product(problem.pattern, data, v[:, None])[:, 0]
    h = 1e-4
    moved = (base.state.x + sign * h * problem.kinematics.spread(base.state.x, v) for sign in (1, -1))
    up, down = (problem.evaluate(x, np.empty(0)).residual(lambda_a) for x in moved)
    slope = (up - down) / (2 * h)
    return float(np.linalg.norm(product - slope) / np.linalg.norm(slope))


def solve_errors(problem: Problem, base) -> tuple[float, float]:
    """Largest relative errors of W_,a and of lambda = dPsi/ddelta_a against differences of whole solves."""
    rows = problem.robot.rows
    compliance, force = [], []
    for j in range(rows.n_a):
        h = 1e-2 * base.lambda_a[j] * np.eye(rows.n_a)[j]
        up, down, up2, down2 = (
            solve(problem, actuation.force(base.lambda_a + k * h), base.state, settings=EXACT) for k in (1, -1, 2, -2)
        )
        full = [np.concatenate([state.delta_e, state.delta_a]) for state in (up, down, up2, down2)]
        slope = (8 * (full[0] - full[1]) - (full[2] - full[3])) / (12 * h[j])
        column = base.condensed.W[:, rows.n_e + j]
        compliance.append(np.abs(column - slope).max() / np.abs(column).max())
        h = 0.05
        moved = (base.delta_a + k * h * np.eye(rows.n_a)[j] for k in (1, -1, 2, -2))
        up, down, up2, down2 = (
            solve(problem, actuation.displacement(delta_a), base.state, settings=EXACT) for delta_a in moved
        )
        slope = (8 * (up.energy - down.energy) - (up2.energy - down2.energy)) / (12 * h)
        force.append(abs(slope / base.lambda_a[j] - 1))
    return float(max(compliance)), float(max(force))


def main(scene: Path, overrides: list[str]) -> dict:
    spec = load_spec(scene, SceneSpec, overrides)
    robot = build_robot(spec, scene_mesh(spec, scene.parent)[0])
    problem = Problem(robot)
    target = robot.reach @ [0.4, 0.6] * np.linspace(1.0, 0.95, robot.rows.n_a)
    base = solve(problem, actuation.displacement(target), settings=EXACT)
    compliance, force = solve_errors(problem, base)
    return {
        "scene": robot.name,
        "tangent": tangent_error(problem, base),
        "W": compliance,
        "energy_gradient": force,
        "residual": base.residual,
        "cold_factorizations": base.factorizations,
        "n_dof": problem.pattern.n_dof,
    }


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), sys.argv[2:])))
