"""The error and the cost of the discretisation: the same robot on several meshes, against a finer one."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.core.console.progress import progress
from cfem.core.errors import NumericalError
from cfem.mechanics.mesh import Mesh
from cfem.report.spec import Discretisation, MeshCase
from cfem.robot.spec import SceneSpec

# A sample starts from a neighbour this far away, as on a tour through some hundred samples.
_NEIGHBOUR = 0.95


@dataclass(frozen=True)
class Solved:
    """States of a robot on a mesh, and their cost.

    tip, W: (k, n_e) mm and (k, n, n_a) in each state
    sample_seconds: CPU, one state from a neighbour with its condensation, median
    factorizations: of a cold solve of each state, mean"""

    nodes: int
    cells: int
    tip: np.ndarray
    W: np.ndarray
    lam: np.ndarray
    sample_seconds: float
    factorizations: float


def study(scene: SceneSpec, folder: Path, spec: Discretisation) -> dict:
    """Rows (plain data) of all meshes at every Poisson's ratio, of all tolerances, and of the orders of convergence.
    Errors are relative to the reference: the tip's by the largest displacement of any state, W's by its norm, the
    forces' by the largest. Raises NumericalError where a state does not converge."""
    from cfem.robot.mesh.accuracy import scene_mesh

    ratios = spec.poisson or [scene.material.poisson]
    rows, reference = [], {}
    with progress("the robot on other meshes", len(ratios) * (len(spec.cases) + 1)) as advance:
        for case in (spec.reference, *spec.cases):
            case_scene = _at(scene, case)
            mesh, *_ = scene_mesh(case_scene, folder)
            for nu in ratios:
                material = case_scene.material.model_copy(update={"poisson": nu})
                solved = _solve(case_scene.model_copy(update={"material": material}), mesh, spec.states)
                rows.append(_row(case, nu, solved, reference.setdefault(nu, solved)))
                advance(1)
    for row in rows:
        row["front"] = not any(_beats(another, row) for another in rows if another["poisson"] == row["poisson"])
    return {"meshes": rows, "orders": orders(rows), "tolerances": _tolerances(scene, folder, spec)}


def orders(rows: Sequence[dict]) -> list[dict]:
    """Order of W's error in h ~ cells^(-1/3), by least squares over three meshes or more of one kind, none with more
    than half of the reference's cells: near it, the difference says little of the error."""
    by_kind = []
    finest = max((row["cells"] for row in rows if row["reference"]), default=np.inf)
    elements = {row["element"] for row in rows if row["reference"]}
    rows = [row for row in rows if row["element"] not in elements or row["cells"] <= finest / 2]
    kinds = {(row["poisson"], row["element"], row["graded"], row["radius"]) for row in rows if not row["reference"]}
    for kind in sorted(kinds, key=str):
        alike = [
            row
            for row in rows
            if not row["reference"] and (row["poisson"], row["element"], row["graded"], row["radius"]) == kind
        ]
        if len(alike) >= 3:
            h, error = (np.log([row[key] for row in alike]) for key in ("cells", "W"))
            slope = -3 * np.polyfit(h, error, 1)[0]
            by_kind.append(dict(zip(("poisson", "element", "graded", "radius"), kind, strict=True), order=float(slope)))
    return by_kind


def headline(meshes: Sequence[dict]) -> list[str]:
    """Sentences on the meshes that are not the reference, one each."""
    return [
        f"discretisation, {label(mesh)}, Poisson's ratio {mesh['poisson']:g}: error of W {100 * mesh['W']:.2g} %, of "
        f"the tip {100 * mesh['tip']:.2g} % ({mesh['tip_mm']:.2g} mm); {1e3 * mesh['sample_seconds']:.3g} ms per sample"
        for mesh in meshes
        if not mesh["reference"]
    ]


def kind(row: dict) -> str:
    """Kind of a mesh, whatever its number of cells."""
    return f"{row['element']}, {'graded' if row['graded'] else 'even'}"


def label(row: dict) -> str:
    """Label of a mesh, for a reader."""
    return f"{kind(row)}, {row['cells']} cells" + ("" if row["radius"] is None else f", radius {row['radius']:g} mm")


def _row(case: MeshCase, nu: float, solved: Solved, reference: Solved) -> dict:
    """Row of a mesh: errors and costs, beside the reference."""
    apart = np.linalg.norm(solved.tip - reference.tip, axis=1).max()
    W_apart = np.linalg.norm(solved.W - reference.W, axis=(1, 2)) / np.linalg.norm(reference.W, axis=(1, 2))
    return {
        "element": case.element,
        "graded": case.cells is not None,
        "radius": case.radius,
        "size": case.size,
        "poisson": nu,
        "reference": solved is reference,
        "nodes": solved.nodes,
        "cells": solved.cells,
        "tip_mm": float(apart),
        "tip": float(apart / np.linalg.norm(reference.tip, axis=1).max()),
        "W": float(W_apart.max()),
        "force": float(np.abs(solved.lam - reference.lam).max() / np.abs(reference.lam).max()),
        "W_11": float(solved.W[0, solved.tip.shape[1], 0]),
        "sample_seconds": solved.sample_seconds,
        "factorizations": solved.factorizations,
    }


def _beats(row: dict, another: dict) -> bool:
    return row["sample_seconds"] < another["sample_seconds"] and row["W"] < another["W"]


def _at(scene: SceneSpec, case: MeshCase) -> SceneSpec:
    """Scene with the mesh of a case."""
    ratio = 1.0 if case.size is None else case.size / scene.mesh.size
    refine = [part.model_copy(update={"size": part.size * ratio}) for part in scene.mesh.refine]
    size = scene.mesh.size if case.size is None else case.size
    changes = {"element": case.element, "size": size, "cells": case.cells, "refine": [] if case.cells else refine}
    update = {"mesh": scene.mesh.model_copy(update=changes)}
    if case.radius is not None:
        for family in ("actuators", "effectors", "contacts"):
            points = [(item, "radius" in type(item).model_fields) for item in getattr(scene, family)]
            update[family] = [item.model_copy(update={"radius": case.radius}) if has else item for item, has in points]
    return scene.model_copy(update=update)


def _solve(scene: SceneSpec, mesh: Mesh, shares: Sequence[Sequence[float]]) -> Solved:
    """Solved states of a robot on a mesh. NumericalError where one does not converge."""
    from cfem.equilibrium.predictor import knot, predict
    from cfem.equilibrium.solve import solve
    from cfem.equilibrium.system.actuation import pull
    from cfem.equilibrium.system.problem import Problem
    from cfem.robot.build import build_robot

    robot = build_robot(scene, mesh)
    problem, reach = Problem(robot), robot.reach[:, 1]
    tips, Ws, lams, seconds, factorizations = [], [], [], [], []
    for share in np.asarray(shares):
        near = solve(problem, pull(_NEIGHBOUR * share, reach))
        if not near.converged:
            raise NumericalError(f"discretisation, {scene.mesh.element}, {len(mesh.cells)} cells: {near.status.value}")
        near_knot = knot(_NEIGHBOUR * share, near)
        start = predict([near_knot], share, pull(share, reach), shape=problem.rotation_strain)
        begin = time.process_time()
        solved = solve(problem, pull(share, reach), start, near.state)
        seconds.append(time.process_time() - begin)
        if not solved.converged:
            raise NumericalError(
                f"discretisation, {scene.mesh.element}, {len(mesh.cells)} cells: {solved.status.value}"
            )
        factorizations.append(near.factorizations)
        tips.append(solved.delta_e)
        lams.append(solved.lambda_a)
        Ws.append(solved.condensed.W[:, robot.rows.a])
    return Solved(
        nodes=len(mesh.X),
        cells=len(mesh.cells),
        tip=np.array(tips),
        W=np.array(Ws),
        lam=np.array(lams),
        sample_seconds=float(np.median(seconds)),
        factorizations=float(np.mean(factorizations)),
    )


def _tolerances(scene: SceneSpec, folder: Path, spec: Discretisation) -> list[dict]:
    """Error of tip and W by the solver's tolerance alone, on the scene's own mesh, against 1e-12."""
    from cfem.equilibrium.newton import NewtonSettings
    from cfem.equilibrium.solve import solve
    from cfem.equilibrium.system.actuation import pull
    from cfem.equilibrium.system.problem import Problem
    from cfem.robot.build import build_robot
    from cfem.robot.mesh.accuracy import scene_mesh

    if not spec.tolerances:
        return []
    problem = Problem(build_robot(scene, scene_mesh(scene, folder)[0]))
    share = np.asarray(spec.states[0])
    how = pull(share, problem.robot.reach[:, 1])
    start = solve(problem, pull(_NEIGHBOUR * share, problem.robot.reach[:, 1])).state
    exact = solve(problem, how, start, settings=NewtonSettings(tolerance=1e-12))
    rows = []
    for tolerance in spec.tolerances:
        begin = time.process_time()
        solved = solve(problem, how, start, settings=NewtonSettings(tolerance=tolerance))
        seconds = time.process_time() - begin
        W, expected = solved.condensed.W, exact.condensed.W
        rows.append(
            {
                "tolerance": tolerance,
                "residual": solved.residual,
                "tip_mm": float(np.linalg.norm(solved.delta_e - exact.delta_e)),
                "W": float(np.linalg.norm(W - expected) / np.linalg.norm(expected)),
                "iterations": solved.iterations,
                "factorizations": solved.factorizations,
                "seconds": seconds,
            }
        )
    return rows
