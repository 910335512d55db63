"""Gradients of a design's objectives by many parameters from one equilibrium, against differences of whole solves:
their error, their CPU time in solves, and their factorisations.

    python benchmarks/design_gradients.py                    # twenty parameters of the finger of twelve shapes
    python benchmarks/design_gradients.py mesh.cells=2000    # on a finer mesh
    python benchmarks/design_gradients.py --quick            # three of the bar

Prints one JSON object. Times are CPU seconds of this process, the least of five runs each: read them as ratios."""

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np

from cfem.core.spec import load_spec
from cfem.core.stage import Options
from cfem.core.yaml import read_yaml
from cfem.design.formulation import problem_of
from cfem.design.spec import DesignSpec
from cfem.equilibrium.system.problem import Problem
from cfem.parametric.differentiable import Differentiable
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.stage import run as make_mesh
from cfem.sample.parameters import scene_parameters
from cfem.sample.spec import ParameterSpec

ROOT = Path(__file__).parents[1] / "pipelines"
RUNS = 5
MORE = {
    "young": {"key": "material.young", "range": {"kPa": [2000, 4000]}},
    "poisson": {"key": "material.poisson", "range": [0.45, 0.48]},
    "left_place": {"key": "actuators.0.route.x", "range": {"mm": [-5.5, -4.5]}},
    "right_place": {"key": "actuators.1.route.x", "range": {"mm": [4.5, 5.5]}},
    "plateau": {"key": "geometry.plateau", "range": {"mm": [2.8, 3.2]}},
    "joint_1_along": {"key": "shape.controls.0.move.2", "range": {"mm": [-1, 1]}},
    "joint_2_along": {"key": "shape.controls.1.move.2", "range": {"mm": [-1, 1]}},
    "back_along": {"key": "shape.controls.2.move.2", "range": {"mm": [-1, 1]}},
}
BAR = {
    "young": {"key": "material.young", "range": {"MPa": [0.5, 2]}},
    "poisson": {"key": "material.poisson", "range": [0.2, 0.4]},
    "radius": {"key": "actuators.0.radius", "range": {"mm": [2, 2.5]}},
}
SPEC = """
by: fe
scene: scene.yaml
mesh: mesh
out: out
parameters: {any: {key: material.young, range: {MPa: [1, 2]}}}
actuation: {displacement: {mm: %s}}
objectives:
  stiff: {kind: stiffness, direction: [0, 1, 0]}
  dexterity: {kind: dexterity}
  strain: {kind: strain}
  volume: {kind: volume}
largest_force: 1000 N
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("overrides", nargs="*", help="of the scene: mesh.cells=2000")
    parser.add_argument("--quick", action="store_true", help="the bar")
    asked = parser.parse_args()
    name = "bar" if asked.quick else "finger-shapes"
    given = BAR if asked.quick else read_yaml(ROOT / name / "sample.yaml")[0]["parameters"] | MORE
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(measured(Path(folder), name, given, asked.overrides), indent=2))


def measured(folder: Path, name: str, given: dict, overrides: list[str]) -> dict:
    """Of one design, away from the middle of its ranges."""
    scene = ROOT / name / "scene.yaml"
    make_mesh(scene, overrides, folder / "mesh", Options(quiet=True))
    spec, mesh = (
        load_scene_and_mesh(scene, folder / "mesh") if not overrides else with_overrides(scene, folder, overrides)
    )
    family = Differentiable(
        spec, mesh, scene_parameters({k: ParameterSpec.model_validate(v) for k, v in given.items()}, scene), ["strain"]
    )
    (folder / "design.yaml").write_text(SPEC % json.dumps([3.0] * family.rows.n_a))
    problem, _ = problem_of(load_spec(folder / "design.yaml", DesignSpec), family, None, folder)
    z = np.full(len(given), 0.4) + 0.02 * np.sin(np.arange(len(given)))
    family.at(problem.kind, problem.u, problem.p(z[None]))  # kernels compiled, attachments made
    p = problem.p(z[None])[0]

    def from_rest():
        family._solved.clear()
        return family.solve(problem.kind, problem.u, p, keep=True)

    cold = min(cpu(from_rest) for _ in range(RUNS))
    warm, factored = min(counted(lambda: family.solve(problem.kind, problem.u, p, keep=True))[1:] for _ in range(RUNS))
    runs = [counted(lambda: problem._with_slopes(z)) for _ in range(RUNS)]
    (values, slopes), gradient, with_gradient = min(runs, key=lambda one: one[1])
    plain = differences(problem, z)
    error = np.abs(slopes - plain).max(axis=1) / np.maximum(np.abs(slopes).max(axis=1), 1e-300)
    rows = [*problem.objectives, *problem.constraints]
    return {
        "parameters": len(given),
        "numbers": len(rows),
        "unknowns": int(family._problem(problem.p(z[None])[0])[1].pattern.n_dof),
        "values": dict(zip(rows, values.tolist(), strict=True)),
        "error": dict(zip(rows, error.tolist(), strict=True)),
        "factorisations of a warm solve": factored,
        "factorisations beside, of the gradient": with_gradient - factored,
        "CPU of a solve from rest, s": cold,
        "CPU of a solve from a neighbour, s": warm,
        "CPU of the gradient, in solves from rest": (gradient - warm) / cold,
        "CPU of solve and gradient, in solves from rest": (cold + gradient - warm) / cold,
        "CPU of differences (four solves a parameter), in solves from rest": problem.seconds / cold,
    }


def with_overrides(scene: Path, folder: Path, overrides: list[str]):
    from cfem.core.artefact.content import artefact_file
    from cfem.robot.mesh.mesh_file import read_mesh
    from cfem.robot.spec import SceneSpec
    from cfem.robot.stage import MESH

    return load_spec(scene, SceneSpec, overrides), read_mesh(artefact_file(folder / "mesh", MESH))


def differences(problem, z: np.ndarray, step: float = 5e-3) -> np.ndarray:
    """(r, n) of fourth order."""
    begin, columns = time.process_time(), []
    for way in np.eye(len(z)):
        ends = [np.hstack(problem((z + k * step * way)[None]))[0] for k in (2, 1, -1, -2)]
        columns.append((8 * (ends[1] - ends[2]) - (ends[0] - ends[3])) / (12 * step))
    problem.seconds = time.process_time() - begin
    return np.array(columns).T


def cpu(work) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def counted(work):
    """What it returns, CPU seconds, factorisations."""
    count, plain = [0], Problem.factor

    def factor(*words, **more):
        count[0] += 1
        return plain(*words, **more)

    Problem.factor = factor
    try:
        begin = time.process_time()
        found = work()
        return found, time.process_time() - begin, count[0]
    finally:
        Problem.factor = plain


if __name__ == "__main__":
    main()
